"""Cloth of a home: curtains and blinds, rugs and mats, towels; no effects."""

from pbrs_farm.dress.textiles.large_textiles import add_textiles

__all__ = ["add_textiles"]
