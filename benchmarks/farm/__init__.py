"""The farm's own cost, without pictures."""
