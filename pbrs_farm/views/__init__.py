"""Views read back as arrays, from an output root or from shards; numpy alone, no torch."""
