"""A farm as the board shows and steers it."""
