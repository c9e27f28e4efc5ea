"""The verbs of the `pbrs-farm` command, grouped by purpose: look, make, use the output."""
