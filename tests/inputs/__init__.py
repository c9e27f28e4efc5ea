"""Writers of a house in each supported format, for tests and benches."""
