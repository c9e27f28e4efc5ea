"""pbrs_farm: houses designed by people in, physically-based pictures with exact labels out."""

__version__ = "0.1.0"
