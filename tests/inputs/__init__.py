"""Writers of a house in each format that is read, for tests and benches."""
