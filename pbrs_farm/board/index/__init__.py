"""Index of an output root in an SQLite file."""
