"""Bulbs, shades, and a light for rooms that have none; no effects."""
