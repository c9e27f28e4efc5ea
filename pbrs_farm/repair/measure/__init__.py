"""Measurements of a house: closed rooms, light leaks, overlapping furniture; no effects."""
