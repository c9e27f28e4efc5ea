"""Homes as values in Python: read, change, look, render. `import pbrs_farm` has the names."""
