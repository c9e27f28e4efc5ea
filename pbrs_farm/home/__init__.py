"""The meaning of a home: room types, names, lamps, masses; no effects."""
