"""Small items of a home: on furniture, on shelves, cushions, some on the floor."""

from pbrs_farm.dress.clutter.clutter import add_clutter

__all__ = ["add_clutter"]
