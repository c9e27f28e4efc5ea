"""Wall items: pictures, mirrors, clocks, shelves, sockets and switches; no effects."""

from pbrs_farm.dress.walls.hang_walls import furnish_walls

__all__ = ["furnish_walls"]
