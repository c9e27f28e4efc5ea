"""Measures the board: pages at 100,000 views, memory, bytes, and relighting in a browser."""
