"""The tasks: targets, losses, figures and baselines."""
