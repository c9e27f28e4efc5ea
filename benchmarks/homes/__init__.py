"""Reading and repairing whole homes."""
