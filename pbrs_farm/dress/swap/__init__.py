"""Furniture of the source -> another model of its class, in its old place."""

from pbrs_farm.dress.swap.swap_furniture import swap

__all__ = ["swap"]
