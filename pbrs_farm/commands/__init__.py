"""The verbs of the `pbrs-farm` command, by what a user wants: to look, to make, to use what was made."""
