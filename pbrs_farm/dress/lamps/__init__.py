"""Lamps for rooms that lack light: under the ceiling, on the floor, on nightstands; no effects."""

from pbrs_farm.dress.lamps.light_rooms import lamps

__all__ = ["lamps"]
