"""What lies about in a home: things on furniture, books on shelves, cushions, some on the floor."""

from pbrs_farm.dress.clutter.clutter import add_clutter

__all__ = ["add_clutter"]
