"""A furnished home made in code; no effects."""
