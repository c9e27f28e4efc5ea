"""Furniture that people add to what was drawn: along free walls, beside beds; no effects."""

from pbrs_farm.dress.furnishing.stand_furniture import furniture

__all__ = ["furniture"]
