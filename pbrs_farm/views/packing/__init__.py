"""Views packed for training: tar shards and Parquet, at a size, with a split; numpy alone, no torch."""
