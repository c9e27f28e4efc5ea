"""A run: which steps a house needs, doing each once, on this machine's processes."""
