"""What the study's parts cost and reach."""
