"""Bulbs, lampshades, and lights for unlit rooms; no effects."""
