"""A training loop that resumes to the same weights after a kill."""
