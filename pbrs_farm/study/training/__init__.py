"""A plain training loop that can be killed and goes on to the same weights; needs torch and numpy alone."""
