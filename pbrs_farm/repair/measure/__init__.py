"""What a house is like: closed rooms, light leaks, furniture that overlaps; no effects."""
