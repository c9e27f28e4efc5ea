"""Every kind of procedural surface by name, and the material it gives a house.

Effects: JPEGs are encoded through a temporary file; a draft keeps what was made for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.catalogue import Catalogue, Picture
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Material, Note, Texture
from pbrs_farm.dress.draft import Draft, Painted
from pbrs_farm.dress.style import WOODS, Rgb, Wood
from pbrs_farm.dress.textures.laid_tiles import (
    Glaze,
    Laying,
    brick_maps,
    cut_from,
    marble,
    terracotta_maps,
    tile_grid,
    tile_maps,
)
from pbrs_farm.dress.textures.maps import (
    Shape2,
    SurfaceMaps,
    blurred,
    encoded,
    noise,
    smoothstep,
    surface_maps,
)
from pbrs_farm.dress.textures.planks import (
    BoardLayout,
    PlankLook,
    chevron,
    grain_maps,
    herringbone,
    plank_maps,
    rows_of_planks,
)
from pbrs_farm.dress.textures.wallpaper import WIDTH_M, wallpaper_maps
from pbrs_farm.images import decode_texture

# Photographed surfaces of libraries in the place of procedural ones but on the draft.


@dataclass(frozen=True, slots=True)
class _Shown:
    # Which pictures stand for a family, and how they reflect.
    group: str
    roughness: float
    gloss: float
    least_m: float = 0.8  # of one repeat: a smaller one is seen to repeat on a floor or a wall


_WOOD_FLOOR: Final = _Shown("planks", 0.4, 0.5)
_SHOWN: Final = {
    "strip": _WOOD_FLOOR, "planks": _WOOD_FLOOR, "laminate": _WOOD_FLOOR,
    "herringbone": _WOOD_FLOOR, "chevron": _WOOD_FLOOR,
    "tiles": _Shown("tiles", 0.22, 0.5, 0.15), "terracotta": _Shown("tiles", 0.4, 0.35, 0.15),
    "marble": _Shown("marble", 0.12, 0.5), "brick": _Shown("brick", 0.9, 0.0),
    "carpet": _Shown("carpet", 1.0, 0.0), "loop carpet": _Shown("carpet", 1.0, 0.0),
    "wallpaper": _Shown("wallpaper", 0.8, 0.0, 0.4), "plaster": _Shown("plaster", 0.9, 0.0),
    "concrete": _Shown("concrete", 0.62, 0.15), "grain": _Shown("wood", 0.4, 0.5, 0.0),
    "weave": _Shown("cloth", 0.95, 0.0, 0.0), "twill": _Shown("cloth", 0.95, 0.0, 0.0),
    "leather": _Shown("leather", 0.46, 0.4, 0.0),
}  # fmt: skip
_DRAWN: Final = 12  # pictures of which as many would be liked as much as drawn ones
_KEPT: Final = "photograph "  # before the id of a picture's texture, in Draft.kept


def photograph_for(draft: Draft, catalogue: Catalogue, family: str, seed: int) -> str:
    """The texture's id of a picture of the catalogue for a surface of that family; "" = draw it.

    The more fitting pictures there are, the likelier one is taken: n of n + 12 times. Equal
    arguments give the same one.
    """
    shown = _SHOWN.get(family)
    if shown is None:
        return ""
    fitting = [
        p for p in catalogue.pictures if p.group == shown.group and min(p.size) >= shown.least_m
    ]
    rng = np.random.default_rng([seed, len(fitting)])
    if rng.random() * (len(fitting) + _DRAWN) >= len(fitting):
        return ""
    picture = fitting[int(rng.integers(len(fitting)))]
    if _KEPT + picture.texture.id in draft.kept:
        return picture.texture.id
    # Take the mean colour now: a picture that cannot be read is drawn instead.
    try:
        mean = _mean_rgb(picture)
    except BadInput as error:
        note = Note("unreadable-texture", picture.texture.name[:80], error.message)
        if note not in draft.notes:
            draft.notes.append(note)
        return ""
    draft.kept[_KEPT + picture.texture.id] = (picture, mean)
    return picture.texture.id


def photograph_material(
    draft: Draft, texture_id: str, family: str
) -> tuple[int, tuple[float, float], Rgb]:
    """The material that shows a picture of photograph_for: its number, size in metres, mean linear colour."""
    kept = draft.kept[_KEPT + texture_id]
    assert isinstance(kept, tuple)
    picture, mean = kept
    shown = _SHOWN[family]
    material = Material(
        name=f"{family} {picture.texture.name[:40]}", texture_id=texture_id,
        specular=(shown.gloss,) * 3, roughness=shown.roughness,
        shininess=round(2.0 / max(shown.roughness, 0.1) ** 4 - 2.0, 1) if shown.gloss else 0.0,
    )  # fmt: skip
    return draft.material(material, (picture.texture,)), picture.size, mean


def _mean_rgb(picture: Picture) -> Rgb:
    pixels = decode_texture(picture.texture.data, picture.texture.name, picture.texture.media_type)
    table = linear_from_srgb(np.arange(256) / 255)
    r, g, b = (float(table[pixels[::4, ::4, k]].mean()) for k in range(3))
    return (r, g, b)


# Surfaces without a pattern: plaster, rolled paint, carpet, woven cloth, leather.


def paint_maps(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], tint: Rgb
) -> SurfaceMaps:
    """Wall paint put on by a roller: one tint, faintly clouded, with the roller's stipple."""
    clouds = noise(rng, shape, slope=3.0, band=(1.0, 30.0))
    per_metre = shape[1] / size_m[0]
    stipple = noise(rng, shape, slope=0.5, band=(size_m[0] * 50, min(size_m[0] * 220, per_metre)))
    colour = np.array(tint, np.float32) * (1.0 + 0.005 * clouds + 0.006 * stipple)[..., None]
    height = np.asarray(0.00009 * stipple + 0.0003 * clouds, np.float32)
    return surface_maps(colour, 0.85, height, size_m, 0.0)


def plaster_maps(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], tint: Rgb,
    *, depth: float = 1.0,
) -> SurfaceMaps:  # fmt: skip
    """Plaster worked with a trowel: strokes that cross, hollows a little darker."""
    clouds = noise(rng, shape, slope=2.6, band=(1.0, 60.0))
    # Lay strokes of two directions over each other, each where the other is low.
    a = noise(rng, shape, slope=1.8, stretch=(3.0, 1.0), band=(6.0, 300.0))
    b = noise(rng, shape, slope=1.8, stretch=(1.0, 3.0), band=(6.0, 300.0))
    strokes = np.maximum(a, b)
    grain = noise(rng, shape, slope=0.4)
    tone = 0.012 * clouds + 0.014 * (strokes - 0.56) + 0.008 * grain
    colour = np.array(tint, np.float32) * (1.0 + np.float32(depth) * tone)[..., None]
    height = depth * (0.00045 * strokes + 0.0006 * clouds + 0.00006 * grain)
    return surface_maps(colour, 0.9, height, size_m, 0.0)


def concrete_maps(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], tint: Rgb
) -> SurfaceMaps:
    """Smooth concrete: clouds of cement, pores."""
    # Bands are in cycles over the picture: clouds wide, streaks long, grain fine.
    clouds = noise(rng, shape, slope=2.2, band=(1.0, 120.0))
    streaks = noise(rng, shape, slope=2.0, stretch=(1.0, 2.5), band=(4.0, 200.0))
    grain = noise(rng, shape, slope=0.6)
    dots = noise(rng, shape, slope=0.0, band=(1.0, shape[0] / 4))
    # Pores are the tail of a noise, beyond about three standard deviations.
    pores = smoothstep(2.9, 3.4, dots)
    tone = 0.045 * clouds + 0.02 * streaks + 0.014 * grain - 0.22 * pores
    colour = np.array(tint, np.float32) * (1.0 + tone)[..., None]
    height = np.asarray(0.0002 * streaks - 0.0015 * pores, np.float32)
    return surface_maps(colour, 0.62 + 0.05 * clouds, height, size_m, 0.15)


def carpet_maps(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], tint: Rgb, *, loops: bool
) -> SurfaceMaps:
    """Carpet: cut pile brushed here and there, or loops in rows."""
    pile = noise(rng, shape, slope=0.3, band=(size_m[0] * 40, 1e9))
    brushed = noise(rng, shape, slope=1.5, band=(2.0, 25.0))
    fleck = noise(rng, shape, slope=0.6)
    if loops:
        # Set loops in rows, every other row half a loop on.
        n = round(size_m[0] / 0.008) // 2 * 2
        y = (np.arange(shape[0], dtype=np.float32) + 0.5) / shape[0] * n
        x = (np.arange(shape[1], dtype=np.float32) + 0.5) / shape[1] * n
        shift = np.where(np.floor(y) % 2 == 1, 0.5, 0.0)[:, None]
        loop = np.abs(np.sin(np.pi * (x[None] + shift))) * np.abs(np.sin(np.pi * y))[:, None]
        pile = 1.4 * (loop.astype(np.float32) - 0.4) + 0.6 * pile
    tone = 0.075 * pile + 0.014 * brushed + 0.04 * fleck
    colour = np.array(tint, np.float32) * (1.0 + tone)[..., None]
    return surface_maps(colour, 1.0, 0.0009 * pile, size_m, 0.0)


def weave_maps(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], tint: Rgb,
    *, threads_m: float = 500.0, second: Rgb | None = None, twill: bool = False,
) -> SurfaceMaps:  # fmt: skip
    """Woven cloth: warp and weft over and under each other. second: colour of the weft.

    threads_m: threads a metre, as many as the picture can show.
    """
    n = max(8, round(min(threads_m, shape[1] / size_m[0] / 3.2) * size_m[0]) // 4 * 4)
    y = ((np.arange(shape[0], dtype=np.float32) + 0.5) / shape[0] * n)[:, None]
    x = ((np.arange(shape[1], dtype=np.float32) + 0.5) / shape[1] * n)[None]
    # Let the warp lie on top in every other crossing, or in twos along a diagonal.
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    on_top = (i + j) % 4 < 2 if twill else (i + j) % 2 == 0
    thread_x = np.abs(np.sin(np.pi * x)) ** 0.6
    thread_y = np.abs(np.sin(np.pi * y)) ** 0.6
    over = np.where(on_top, thread_x * (0.5 + 0.5 * thread_y), thread_y * (0.5 + 0.5 * thread_x))
    # Vary each thread's thickness and dye.
    slub_x = noise(rng, shape, slope=1.0, stretch=(20.0, 1.0), band=(1.0, 1e9))
    slub_y = noise(rng, shape, slope=1.0, stretch=(1.0, 20.0), band=(1.0, 1e9))
    slub = np.where(on_top, slub_x, slub_y)
    light = 0.80 + 0.26 * over + 0.045 * slub
    first = np.array(tint, np.float32)
    weft = first * np.float32(0.93) if second is None else np.array(second, np.float32)
    colour = np.where(on_top[..., None], first, weft) * light[..., None]
    height = np.asarray(0.25 * size_m[0] / n * (over + 0.15 * slub), np.float32)
    return surface_maps(np.asarray(colour, np.float32), 0.95, height, size_m, 0.0)


def leather_maps(
    rng: np.random.Generator, shape: Shape2, size_m: tuple[float, float], tint: Rgb
) -> SurfaceMaps:
    """Leather: pebbles parted by fine creases, worn tones."""
    cells, second = _cells(rng, shape, int(size_m[0] * size_m[1] / 0.0045**2))
    crease = smoothstep(0.45, 0.0, second - cells)
    creases = blurred(crease, 0.7)
    clouds = noise(rng, shape, slope=2.6, band=(1.0, 40.0))
    colour = np.array(tint, np.float32) * (1.0 + 0.035 * clouds - 0.22 * creases)[..., None]
    height = np.asarray(-0.00035 * creases + 0.0004 * clouds, np.float32)
    return surface_maps(colour, 0.46 + 0.05 * clouds + 0.2 * creases, height, size_m, 0.4)


def _cells(rng: np.random.Generator, shape: Shape2, n: int) -> tuple[F32, F32]:
    # Distance to the nearest and second nearest of about n jittered points, in cell widths.
    side = max(4, round(float(np.sqrt(n))))
    jitter = rng.random((2, side, side)).astype(np.float32)
    y = ((np.arange(shape[0], dtype=np.float32) + 0.5) / shape[0] * side)[:, None]
    x = ((np.arange(shape[1], dtype=np.float32) + 0.5) / shape[1] * side)[None]
    j, i = np.floor(y).astype(int), np.floor(x).astype(int)
    first = np.full(shape, 9.0, np.float32)
    second = first.copy()
    for dj in (-1, 0, 1):
        for di in (-1, 0, 1):
            rows, columns = (j + dj) % side, (i + di) % side
            away_y = (j + dj) + jitter[0][rows, columns] - y
            away_x = (i + di) + jitter[1][rows, columns] - x
            d = np.sqrt(away_x * away_x + away_y * away_y)
            second = np.minimum(second, np.maximum(first, d))
            first = np.minimum(first, d)
    return first, second


# Every kind of procedural surface by name, and the material it gives a house.


_TEXEL_M: Final = 0.0015  # at most: what a camera of 640 pixels a metre away tells apart
_STEP_PX: Final = 128
_COARSE = (512, 512)  # pixels of one repeat of what is finer by itself
_FLOOR_M = (2.0, 2.0)
_SIZE_M: Final = {
    "strip": _FLOOR_M, "planks": (2.4, 2.4), "laminate": (2.6, 1.92), "herringbone": _FLOOR_M,
    "chevron": _FLOOR_M, "marble": (2.4, 2.4), "terracotta": _FLOOR_M, "brick": _FLOOR_M,
    "painted brick": _FLOOR_M, "paint": (1.0, 1.0), "plaster": _FLOOR_M,
    "smooth plaster": _FLOOR_M, "concrete": _FLOOR_M, "carpet": (1.0, 1.0),
    "loop carpet": (0.64, 0.64), "wallpaper": (WIDTH_M, WIDTH_M), "grain": (1.0, 1.0),
    "weave": (0.25, 0.25), "twill": (0.25, 0.25), "leather": (0.3, 0.3),
}  # fmt: skip
"""Width and height of one repeat by family; tiles have that of their laying."""


@dataclass(frozen=True, slots=True)
class Pattern:
    """What a procedural surface looks like: equal patterns give equal pixels."""

    family: str  # of FAMILIES
    seed: int
    tints: tuple[Rgb, ...] = ((0.9, 0.9, 0.9),)  # sRGB-encoded, the main one first
    wood: Wood = WOODS["oak"]  # of wood
    variant: str = ""  # of tiles and wallpaper: how they are laid or printed
    darkness: float = 0.0  # of wood: -1 bleached .. 1 stained
    photograph: str = ""  # id of a picture's texture that is shown instead: photographed()


@dataclass(frozen=True, slots=True)
class PatternMaterial:
    """A pattern as a house has it."""

    number: int  # in Draft.materials
    size_m: tuple[float, float]  # of one repeat: uv = metres / size
    mean: Callable[[], Rgb]  # gives the mean linear colour once it is painted

    @property
    def mean_rgb(self) -> Rgb:
        """The mean linear colour; waits for a material that is still painted."""
        return self.mean()


def pixels_of(size_m: tuple[float, float]) -> Shape2:
    """Rows and columns of a repeat of that size: texels of 1.5 mm or less."""
    width, height = (_STEP_PX * math.ceil(side / _TEXEL_M / _STEP_PX) for side in size_m)
    return height, width


_Painter = Callable[[np.random.Generator, Pattern], SurfaceMaps]


def maps_of(pattern: Pattern) -> SurfaceMaps:
    """The pattern's pixels; KeyError for an unknown family."""
    return FAMILIES[pattern.family](np.random.default_rng(pattern.seed), pattern)


def size_of(pattern: Pattern) -> tuple[float, float]:
    """Width and height of one repeat of the pattern, metres; KeyError for an unknown family."""
    if pattern.family == "tiles":
        return _TILES[_laid(pattern)[0]][0]
    return _SIZE_M[pattern.family]


def pattern_material(draft: Draft, pattern: Pattern) -> PatternMaterial:
    """The pattern as a material of the draft's house, made once a draft, beside what follows."""
    key = f"pattern {pattern!r}"
    kept = draft.kept.get(key)
    if isinstance(kept, PatternMaterial):
        return kept
    if pattern.photograph:
        number, size, mean = photograph_material(draft, pattern.photograph, pattern.family)
        made = PatternMaterial(number, size, lambda: mean)
    else:
        number, painting = draft.materials.paint(partial(_painted, pattern))
        made = PatternMaterial(number, size_of(pattern), lambda: painting.painted().mean_rgb)
    draft.kept[key] = made
    return made


def _painted(pattern: Pattern) -> Painted:
    maps = maps_of(pattern)
    material, textures = material_from_maps(maps, f"{pattern.family}-{pattern.seed:08x}")
    return Painted(material, textures, maps.mean_rgb)


def photographed(draft: Draft, catalogue: Catalogue, pattern: Pattern) -> Pattern:
    """The pattern, or a picture of the catalogue in its place, by its family and seed."""
    found = photograph_for(draft, catalogue, pattern.family, pattern.seed)
    return replace(pattern, photograph=found) if found else pattern


def material_from_maps(maps: SurfaceMaps, name: str) -> tuple[Material, tuple[Texture, ...]]:
    """A material that shows the maps, and the textures it names."""
    colour, rough, normal = encoded(maps, name)
    # Keep the Phong lobe that matches, for who reads no roughness.
    alpha = max(maps.mean_roughness, 0.1) ** 2
    coat = maps.gloss
    material = Material(
        name=name,
        specular=(coat, coat, coat),
        shininess=round(2.0 / alpha**2 - 2.0, 1) if coat else 0.0,
        texture_id=colour.id,
        roughness=1.0 if rough is not None else round(maps.mean_roughness, 4),
        roughness_texture_id=None if rough is None else rough.id,
        normal_texture_id=None if normal is None else normal.id,
    )
    return material, tuple(t for t in (colour, rough, normal) if t is not None)


def _strip(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    layout = rows_of_planks(rng, pixels_of(size_of(p)), size_of(p), 28, 4)
    return _planks(rng, p, layout, PlankLook(variation=0.05))


def _boards(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    # Long boards: a wide repeat, a joint or two in each row.
    layout = rows_of_planks(
        rng, pixels_of(size_of(p)), size_of(p), int(rng.choice([12, 14, 17])), 1
    )
    look = PlankLook(bevel_m=0.003, variation=0.04, roughness=0.42)
    return _planks(rng, p, layout, look)


def _laminate(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    layout = rows_of_planks(rng, pixels_of(size_of(p)), size_of(p), 10, 2)
    return _planks(rng, p, layout, PlankLook(0.0006, 0.0, 0.03, 0.34, 0.5))


def _herringbone(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    layout = herringbone(pixels_of(size_of(p)), size_of(p), int(rng.choice([5, 6, 7])), 2)
    return _planks(rng, p, layout, PlankLook(variation=0.05))


def _chevron(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    layout = chevron(pixels_of(size_of(p)), size_of(p), 4, int(rng.choice([14, 16])))
    return _planks(rng, p, layout, PlankLook(variation=0.045))


def _planks(
    rng: np.random.Generator, p: Pattern, layout: BoardLayout, look: PlankLook
) -> SurfaceMaps:
    return plank_maps(rng, p.wood, layout, size_of(p), look, p.darkness)


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


def _tiles(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    """Variant: `<laying>[-checker|-mixed|-stone]`; the last tint is the grout where there are more."""
    laid, kind = _laid(p)
    size, laying, bevel = _TILES[laid]
    grout = p.tints[-1] if len(p.tints) > 1 else (0.72, 0.71, 0.68)
    colours = p.tints[:-1] if len(p.tints) > 1 else p.tints
    if kind == "stone":
        # Stone ware: clouds through the whole tile, dull.
        glaze = Glaze(colours, "plain", 0.03, 0.02, 0.45, 0.4, bevel, grout)
    else:
        mottle = 0.004 if min(colours[0]) > 0.8 else 0.012
        glaze = Glaze(colours, kind or "plain", mottle, 0.009, 0.14, 0.5, bevel, grout)
    return tile_maps(rng, pixels_of(size), size, laying, glaze)


def _laid(p: Pattern) -> tuple[str, str]:
    """How tiles are laid, a key of _TILES, and their kind."""
    laid, _, kind = p.variant.partition("-")
    return laid or "30", kind


def _marble(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    size, laying = size_of(p), Laying(4, 4, 0.0, 0.002)
    shape = pixels_of(size)
    sheet = marble(rng, shape, p.tints[0], p.tints[-1])
    body = cut_from(rng, sheet, tile_grid(shape, size, laying))
    grout = p.tints[0]
    return tile_maps(rng, shape, size, laying, Glaze((), "plain", 0.004, 0.008, 0.1, 0.5, 0.001, grout), body)  # fmt: skip


def _terracotta(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    n = int(rng.choice([7, 8, 10]))
    return terracotta_maps(
        rng, pixels_of(size_of(p)), size_of(p), Laying(n, n, 0.0, 0.007), p.tints[0]
    )


def _wallpaper(rng: np.random.Generator, p: Pattern) -> SurfaceMaps:
    """Variant: a name of wallpaper.PATTERNS; tints: ground, print, accent."""
    return wallpaper_maps(rng, _COARSE, p.variant, p.tints[0], p.tints[1], p.tints[2])


def _cloth(rng: np.random.Generator, p: Pattern, *, twill: bool) -> SurfaceMaps:
    second = p.tints[1] if len(p.tints) > 1 else None
    return weave_maps(rng, _COARSE, size_of(p), p.tints[0], second=second, twill=twill)


FAMILIES: dict[str, _Painter] = {
    "strip": _strip,
    "planks": _boards,
    "laminate": _laminate,
    "herringbone": _herringbone,
    "chevron": _chevron,
    "tiles": _tiles,
    "marble": _marble,
    "terracotta": _terracotta,
    "brick": lambda r, p: brick_maps(
        r, pixels_of(size_of(p)), size_of(p), p.tints[0], painted=False
    ),
    "painted brick": lambda r, p: brick_maps(
        r, pixels_of(size_of(p)), size_of(p), p.tints[0], painted=True
    ),
    "paint": lambda r, p: paint_maps(r, pixels_of(size_of(p)), size_of(p), p.tints[0]),
    "plaster": lambda r, p: plaster_maps(r, pixels_of(size_of(p)), size_of(p), p.tints[0]),
    "smooth plaster": lambda r, p: plaster_maps(
        r, pixels_of(size_of(p)), size_of(p), p.tints[0], depth=0.35
    ),
    "concrete": lambda r, p: concrete_maps(r, pixels_of(size_of(p)), size_of(p), p.tints[0]),
    "carpet": lambda r, p: carpet_maps(
        r, pixels_of(size_of(p)), size_of(p), p.tints[0], loops=False
    ),
    "loop carpet": lambda r, p: carpet_maps(
        r, pixels_of(size_of(p)), size_of(p), p.tints[0], loops=True
    ),
    "wallpaper": _wallpaper,
    "grain": lambda r, p: grain_maps(r, p.wood, edge_px=pixels_of(size_of(p))[0]),
    "weave": lambda r, p: _cloth(r, p, twill=False),
    "twill": lambda r, p: _cloth(r, p, twill=True),
    "leather": lambda r, p: leather_maps(r, _COARSE, size_of(p), p.tints[0]),
}
"""Painters by family; docs/dress.md shows them all."""
