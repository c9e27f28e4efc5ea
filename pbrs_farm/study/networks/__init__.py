"""The networks of the study, the paper's and small ones, and their first weights."""
