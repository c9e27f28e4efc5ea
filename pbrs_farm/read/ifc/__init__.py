"""IFC: how it is read."""
