"""Templates of what fills a wall from side to side: fitted wardrobes, shelves, show cases. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.furnish.pieces import Shelf, single
from pbrs_farm.generate.furnish.places import BESIDE_M
from pbrs_farm.generate.furnish.template import Template

_LONGEST_M: Final = 4.4  # maximum length of a filled wall
_STRETCH: Final = (0.85, 1.2)  # what a piece may be narrowed and widened by
_CEILING_M: Final = 2.7  # as high as it goes at most; the room's ceiling makes it lower
_CHOICES: Final = 2  # designs to try at each wall


def fitted_wardrobes(
    shelf: Shelf, stretches: Sequence[float], deepest: float = 0.7
) -> tuple[Template, ...]:
    """A row of doors along each stretch of wall, one behind which clothes hang."""
    return _fitted(shelf, "fitted_wardrobe", stretches, deepest)


def fitted_bookcases(shelf: Shelf, stretches: Sequence[float]) -> tuple[Template, ...]:
    """Shelves along each stretch of wall."""
    return _fitted(shelf, "fitted_bookcase", stretches, 0.45, before=0.5)


def fitted_show_cases(shelf: Shelf, stretches: Sequence[float]) -> tuple[Template, ...]:
    """Doors of glass over cupboards, as long as each stretch of wall, 2.4 m at most."""
    return _fitted(shelf, "fitted_cabinet", stretches, 0.6, longest=2.4)


def _fitted(
    shelf: Shelf,
    group: str,
    stretches: Sequence[float],
    deepest: float,
    *,
    before: float = 0.7,
    longest: float = _LONGEST_M,
) -> tuple[Template, ...]:
    """A piece as long as each stretch (metres) and as high as the room, `before` free; the longest ranks first."""
    pieces = shelf.of(group, depth=(0.1, deepest))
    templates = []
    for width in dict.fromkeys(min(s - 2 * BESIDE_M - 0.004, longest) for s in stretches):
        fits = [p for p in pieces if _STRETCH[0] <= width / p.size[0] <= _STRETCH[1]]
        templates += [_filling(p, width, before) for p in fits[:_CHOICES]]
    return tuple(templates)


def _filling(piece: Piece, width: float, before: float) -> Template:
    size = (width, piece.size[1], max(piece.size[2], _CEILING_M))
    return single(piece, before=before, corner=0.3, rank=0.6 * width, size=size)
