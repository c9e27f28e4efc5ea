"""Every kind of procedural surface by name; no effects."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from pbrs_farm.dress.noise import Shape2
from pbrs_farm.dress.patterns import Pattern
from pbrs_farm.dress.surface_maps import SurfaceMaps
from pbrs_farm.furnishings.textures.canvas import Canvas
from pbrs_farm.furnishings.textures.laid_tiles import (
    Glaze,
    Laying,
    brick_maps,
    cut_from,
    marble,
    terracotta_maps,
    tile_grid,
    tile_maps,
)
from pbrs_farm.furnishings.textures.panelling import (
    PANELS_M,
    board_maps,
    panel_maps,
    slat_maps,
    wall_plank_maps,
)
from pbrs_farm.furnishings.textures.plain_surfaces import (
    carpet_maps,
    concrete_maps,
    leather_maps,
    paint_maps,
    plaster_maps,
    weave_maps,
)
from pbrs_farm.furnishings.textures.planks import (
    PlankLook,
    chevron,
    grain_maps,
    herringbone,
    plank_maps,
    rows_of_planks,
)
from pbrs_farm.furnishings.textures.wallpaper import (
    PATTERNS,
    WIDTH_M,
    printed_carpet_maps,
    wallpaper_maps,
)

_TEXEL_M: Final = 0.0015  # greatest texel: what a camera of 640 pixels resolves from a metre away
_STEP_PX: Final = 128
_COARSE = (512, 512)  # pixels of one repeat of these:
_COARSE_ONES: Final = ("wallpaper", "weave", "twill", "leather")
_FLOOR_M = (2.0, 2.0)
# fmt: off
_SIZE_M: Final = {
    "strip": _FLOOR_M, "planks": (2.4, 2.4), "laminate": (2.6, 1.92), "herringbone": _FLOOR_M,
    "chevron": _FLOOR_M, "marble": (2.4, 2.4), "terracotta": _FLOOR_M, "brick": _FLOOR_M,
    "painted brick": _FLOOR_M, "paint": (1.0, 1.0), "plaster": _FLOOR_M,
    "smooth plaster": _FLOOR_M, "concrete": _FLOOR_M, "carpet": (1.0, 1.0),
    "loop carpet": (0.64, 0.64), "printed carpet": (0.8, 0.8), "wallpaper": (WIDTH_M, WIDTH_M), "grain": (1.0, 0.5),
    "weave": (0.25, 0.25), "twill": (0.25, 0.25), "leather": (0.3, 0.3),
    "upright boards": (1.2, 1.2), "level boards": (1.2, 1.2), "wall planks": (1.6, 1.6),
    "slats": (1.2, 1.2),
}
# fmt: on
"""Width and height of one repeat by family; tiles have that of their laying, panels their variant's."""


def pixels_of(size_m: tuple[float, float]) -> Shape2:
    """Rows and columns of a repeat of that size: texels of 1.5 mm or less."""
    width, height = (_STEP_PX * math.ceil(side / _TEXEL_M / _STEP_PX) for side in size_m)
    return height, width


_Painter = Callable[[Canvas, Pattern], SurfaceMaps]


def maps_of(pattern: Pattern) -> SurfaceMaps:
    """The pattern's pixels; KeyError for an unknown family."""
    size = size_of(pattern)
    shape = _COARSE if pattern.family in _COARSE_ONES else pixels_of(size)
    canvas = Canvas(np.random.default_rng(pattern.seed), shape, size)
    return FAMILIES[pattern.family](canvas, pattern)


def size_of(pattern: Pattern) -> tuple[float, float]:
    """Width and height of one repeat of the pattern, metres; KeyError for an unknown family."""
    if pattern.family == "tiles":
        return _TILES[_laid(pattern)[0]][0]
    if pattern.family == "panels":
        return PANELS_M.get(pattern.variant, PANELS_M["low"])
    return _SIZE_M[pattern.family]


def _strip_parquet(c: Canvas, p: Pattern) -> SurfaceMaps:
    return plank_maps(c, p.wood, rows_of_planks(c, 28, 4), PlankLook(variation=0.05), p.darkness)


def _board_floor(c: Canvas, p: Pattern) -> SurfaceMaps:
    # Long boards: a wide repeat, a joint or two in each row.
    layout = rows_of_planks(c, int(c.rng.choice([12, 14, 17])), 1)
    look = PlankLook(bevel_m=0.003, variation=0.04, roughness=0.42)
    return plank_maps(c, p.wood, layout, look, p.darkness)


def _laminate(c: Canvas, p: Pattern) -> SurfaceMaps:
    look = PlankLook(0.0006, 0.0, 0.03, 0.34, 0.5)
    return plank_maps(c, p.wood, rows_of_planks(c, 10, 2), look, p.darkness)


def _herringbone(c: Canvas, p: Pattern) -> SurfaceMaps:
    layout = herringbone(c, int(c.rng.choice([5, 6, 7])), 2)
    return plank_maps(c, p.wood, layout, PlankLook(variation=0.05), p.darkness)


def _chevron(c: Canvas, p: Pattern) -> SurfaceMaps:
    layout = chevron(c, 4, int(c.rng.choice([14, 16])))
    return plank_maps(c, p.wood, layout, PlankLook(variation=0.045), p.darkness)


# Rows and columns in one repeat of that size, shift of every other row, joint, bevel; pixels.
_TILES: dict[str, tuple[tuple[float, float], Laying, float]] = {
    "10": ((1.0, 1.0), Laying(10, 10, 0.0, 0.003), 0.003),
    "15": ((1.2, 1.2), Laying(8, 8, 0.0, 0.003), 0.003),
    "20": ((1.6, 1.6), Laying(8, 8, 0.0, 0.003), 0.003),
    "30": ((1.8, 1.8), Laying(6, 6, 0.0, 0.003), 0.002),
    "45": ((1.8, 1.8), Laying(4, 4, 0.0, 0.003), 0.002),
    "60": ((2.4, 2.4), Laying(4, 4, 0.0, 0.002), 0.001),
    "30x60": ((2.4, 2.4), Laying(8, 4, 0.5, 0.002), 0.001),
    "20x40": ((1.6, 1.6), Laying(8, 4, 0.0, 0.002), 0.002),
    "subway": ((1.2, 1.2), Laying(16, 8, 0.5, 0.002), 0.006),
    "mosaic": ((0.5, 0.5), Laying(20, 20, 0.0, 0.002), 0.002),
}


def _tile_floor(c: Canvas, p: Pattern) -> SurfaceMaps:
    """Variant: `<laying>[-checker|-mixed|-stone]`; the last tint is the grout where there are more."""
    laid, kind = _laid(p)
    _size, laying, bevel = _TILES[laid]
    grout = p.tints[-1] if len(p.tints) > 1 else (0.72, 0.71, 0.68)
    colours = p.tints[:-1] if len(p.tints) > 1 else p.tints
    if kind == "stone":
        # Stone ware: clouds through the whole tile, dull.
        glaze = Glaze(colours, "plain", 0.03, 0.02, 0.45, 0.4, bevel, grout)
    else:
        mottle = 0.004 if min(colours[0]) > 0.8 else 0.012
        glaze = Glaze(colours, kind or "plain", mottle, 0.009, 0.14, 0.5, bevel, grout)
    return tile_maps(c, laying, glaze)


def _laid(p: Pattern) -> tuple[str, str]:
    """How tiles are laid, a key of _TILES, and their kind."""
    laid, _, kind = p.variant.partition("-")
    return laid or "30", kind


def _marble(c: Canvas, p: Pattern) -> SurfaceMaps:
    laying = Laying(4, 4, 0.0, 0.002)
    body = cut_from(c.rng, marble(c, p.tints[0], p.tints[-1]), tile_grid(c, laying))
    glaze = Glaze((), "plain", 0.004, 0.008, 0.1, 0.5, 0.001, p.tints[0])
    return tile_maps(c, laying, glaze, body)


def _terracotta(c: Canvas, p: Pattern) -> SurfaceMaps:
    n = int(c.rng.choice([7, 8, 10]))
    return terracotta_maps(c, Laying(n, n, 0.0, 0.007), p.tints[0])


def _printed_carpet(c: Canvas, p: Pattern) -> SurfaceMaps:
    pattern = p.variant if p.variant in PATTERNS else PATTERNS[0]
    return printed_carpet_maps(c, pattern, p.tints)


def _woven_cloth(c: Canvas, p: Pattern, *, twill: bool) -> SurfaceMaps:
    second = p.tints[1] if len(p.tints) > 1 else None
    return weave_maps(c, p.tints[0], second=second, twill=twill)


FAMILIES: dict[str, _Painter] = {
    "strip": _strip_parquet,
    "planks": _board_floor,
    "laminate": _laminate,
    "herringbone": _herringbone,
    "chevron": _chevron,
    "tiles": _tile_floor,
    "marble": _marble,
    "terracotta": _terracotta,
    "brick": lambda c, p: brick_maps(c, p.tints[0], painted=False),
    "painted brick": lambda c, p: brick_maps(c, p.tints[0], painted=True),
    "paint": lambda c, p: paint_maps(c, p.tints[0]),
    "plaster": lambda c, p: plaster_maps(c, p.tints[0]),
    "smooth plaster": lambda c, p: plaster_maps(c, p.tints[0], depth=0.35),
    "concrete": lambda c, p: concrete_maps(c, p.tints[0]),
    "carpet": lambda c, p: carpet_maps(c, p.tints[0], loops=False),
    "loop carpet": lambda c, p: carpet_maps(c, p.tints[0], loops=True),
    # Variant: a name of wallpaper.PATTERNS or PLAIN.
    "wallpaper": lambda c, p: wallpaper_maps(c, p.variant, p.tints),
    "printed carpet": _printed_carpet,
    "grain": lambda c, p: grain_maps(c, p.wood),
    "weave": lambda c, p: _woven_cloth(c, p, twill=False),
    "twill": lambda c, p: _woven_cloth(c, p, twill=True),
    "leather": lambda c, p: leather_maps(c, p.tints[0]),
    "upright boards": lambda c, p: board_maps(c, p.tints[0], upright=True),
    "level boards": lambda c, p: board_maps(c, p.tints[0], upright=False),
    "wall planks": lambda c, p: wall_plank_maps(
        c, p.wood, p.darkness, upright=p.variant != "level"
    ),
    "slats": lambda c, p: slat_maps(c, p.wood, p.darkness),
    "panels": lambda c, p: panel_maps(c, p.tints[0]),
}
"""Painters by family; docs/dress.md shows them all."""
