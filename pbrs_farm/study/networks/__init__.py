"""The networks of the study, the paper's and small ones, and where they start from; needs torch."""
