"""Data sets from a file: rendering, splits, exports, checksums and estimates of cost."""
