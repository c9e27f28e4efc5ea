"""Tiles: ceramic, stone, terracotta, mosaic, and bricks, laid in mortar; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.noise import coverage, sampled, smoothstep
from pbrs_farm.dress.style import Rgb
from pbrs_farm.dress.surface_maps import SurfaceMaps, ramp
from pbrs_farm.furnishings.textures.canvas import Canvas

_INTS = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class TileGrid:
    """Tiles that cover one repeat; arrays (H, W)."""

    tile: _INTS  # number of the tile
    row: _INTS  # of the tile
    column: _INTS
    edge_m: F32  # metres to the tile's nearest edge, the middle of the joint
    corner_m: F32  # metres inside both pairs of edges: product rule for rounded corners
    n_tiles: int


@dataclass(frozen=True, slots=True)
class Laying:
    """Number and bond of the tiles in one repeat."""

    rows: int
    columns: int
    shift: float = 0.0  # of every other row, in tiles
    joint_m: float = 0.003


def tile_grid(c: Canvas, laying: Laying, warp: tuple[F32, F32] | None = None) -> TileGrid:
    """The tiles of one repeat; warp: metres by which edges wander along u and v."""
    rows, columns = c.shape
    tile_u, tile_v = c.size_m[0] / laying.columns, c.size_m[1] / laying.rows
    u = ((np.arange(columns, dtype=np.float32) + 0.5) * (c.size_m[0] / columns))[None]
    v = ((np.arange(rows, dtype=np.float32) + 0.5) * (c.size_m[1] / rows))[:, None]
    if warp is not None:
        u, v = u + warp[0], v + warp[1]
    row_f = np.floor(v / np.float32(tile_v))
    across = u / np.float32(tile_u) + np.where(row_f % 2 == 1, np.float32(laying.shift), 0)
    column_f = np.floor(across)
    # Measure to the nearest edges along both axes.
    in_u = (across - column_f) * np.float32(tile_u)
    in_v = v - row_f * np.float32(tile_v)
    edge_u = np.minimum(in_u, np.float32(tile_u) - in_u)
    edge_v = np.minimum(in_v, np.float32(tile_v) - in_v) + np.zeros_like(edge_u)
    row = row_f.astype(np.int64) % laying.rows + np.zeros(c.shape, np.int64)
    column = column_f.astype(np.int64) % laying.columns
    edge = np.minimum(edge_u, edge_v)
    return TileGrid(
        row * laying.columns + column,
        row,
        column,
        np.asarray(edge, np.float32),
        np.asarray(np.sqrt(np.maximum(edge_u * edge_v, 0)), np.float32),
        laying.rows * laying.columns,
    )


@dataclass(frozen=True, slots=True)
class Glaze:
    """Materials of tiles."""

    colours: tuple[Rgb, ...]
    pattern: str = "plain"  # "plain", "checker", "mixed"
    mottle: float = 0.010  # clouds inside a tile
    variation: float = 0.012  # from tile to tile
    roughness: float = 0.16
    gloss: float = 0.5
    bevel_m: float = 0.002
    grout: Rgb = (0.72, 0.71, 0.68)


def tile_maps(c: Canvas, laying: Laying, glaze: Glaze, body: F32 | None = None) -> SurfaceMaps:
    """Tiles of one or several colours. body: (H, W, 3) colour of a stone instead of a glaze."""
    grid = tile_grid(c, laying)
    clouds = c.noise(slope=2.4, band=(2.0, 200.0))
    # Colour each tile, then let clouds and the kiln's chance vary it; round the tiles' edges.
    if body is None:
        colour = np.array(glaze.colours, np.float32)[_picks(c.rng, grid, glaze)]
    else:
        colour = body.copy()
    bevel = smoothstep(laying.joint_m / 2 + glaze.bevel_m, laying.joint_m / 2, grid.edge_m)
    tone = _brightness(c.rng, grid, glaze.variation) * (1.0 + np.float32(glaze.mottle) * clouds)
    colour *= (tone * (1.0 - 0.10 * bevel))[..., None]
    # Fill the joints, which are a small part of the picture.
    joint = coverage(grid.edge_m, laying.joint_m / 2, c.pixel_m)
    grain = c.noise(slope=0.8)
    rows, columns = np.nonzero(joint)
    shade = 0.93 * (1.0 + 0.035 * grain[rows, columns] + 0.03 * clouds[rows, columns])
    part, grout = colour[rows, columns], shade[:, None] * np.array(glaze.grout, np.float32)
    colour[rows, columns] = part + joint[rows, columns, None] * (grout - part)
    height = -0.0007 * bevel - 0.0006 * joint + 0.00002 * clouds + 0.00002 * joint * grain
    rough = glaze.roughness + joint * (0.85 - glaze.roughness) + 0.012 * clouds
    return c.maps(colour, rough, height, glaze.gloss)


def marble(c: Canvas, light: Rgb, vein: Rgb) -> F32:
    """(H, W, 3) colour of a periodic sheet of marble: clouds, and veins where noise is level."""
    clouds = c.noise(slope=3.0, band=(1.0, 60.0))
    bent = c.noise(slope=3.2, stretch=(1.0, 1.6), band=(1.5, 40.0))
    fine = c.noise(slope=2.6, band=(4.0, 150.0))
    # Draw veins along the zero lines, wider and fainter in turn.
    large = np.exp(-np.abs(bent + 0.10 * fine) / 0.035) * smoothstep(-0.6, 1.2, clouds)
    small = np.exp(-np.abs(fine + 0.5 * bent) / 0.05) * smoothstep(0.0, 1.6, -clouds)
    halo = np.exp(-np.abs(bent + 0.10 * fine) / 0.35)
    tone = 1.0 - np.clip(0.75 * large + 0.30 * small + 0.16 * halo + 0.05 * clouds, -0.1, 1.0)
    return ramp(np.asarray(tone, np.float32), vein, light)


def cut_from(rng: np.random.Generator, sheet: F32, grid: TileGrid) -> F32:
    """The sheet (H, W, 3) cut into tiles, each from a different place."""
    rows, columns = sheet.shape[:2]
    y = np.arange(rows)[:, None] + rng.integers(0, rows, grid.n_tiles)[grid.tile]
    x = np.arange(columns)[None] + rng.integers(0, columns, grid.n_tiles)[grid.tile]
    return np.stack([sampled(sheet[..., k], y, x) for k in range(3)], -1)


def terracotta_maps(c: Canvas, laying: Laying, clay: Rgb) -> SurfaceMaps:
    """Hand-made clay tiles: mottled, uneven at the edges, each fired to another shade."""
    warp = tuple(np.float32(0.0012) * c.noise(slope=2.0, band=(4.0, 80.0)) for _ in "uv")
    grid = tile_grid(c, laying, (warp[0], warp[1]))
    clouds = c.noise(slope=2.2, band=(3.0, 160.0))
    grain = c.noise(slope=0.7)
    # Shift each tile between a pale and a dark firing.
    firing = np.clip(c.rng.normal(0, 0.5, grid.n_tiles), -1, 1).astype(np.float32)[grid.tile]
    pale, dark = np.array(clay) * 1.13 + (0, 0.02, 0.03), np.array(clay) * 0.84
    tone = np.asarray(0.5 + 0.28 * firing + 0.13 * clouds + 0.025 * grain, np.float32)
    colour = ramp(tone, (dark[0], dark[1], dark[2]), (pale[0], pale[1], pale[2]))
    joint = smoothstep(laying.joint_m / 2 + c.pixel_m, laying.joint_m / 2 - c.pixel_m, grid.edge_m)
    worn = smoothstep(laying.joint_m / 2 + 0.008, laying.joint_m / 2, grid.edge_m)
    mortar = np.array((0.66, 0.61, 0.54), np.float32) * (1 + 0.05 * grain)[..., None]
    colour = colour * (1 - 0.13 * worn)[..., None]
    colour += joint[..., None] * (mortar * np.float32(0.95) - colour)
    height = -0.0016 * worn - 0.0010 * joint + 0.0003 * clouds + 0.00004 * grain
    rough = 0.48 + 0.05 * clouds + 0.40 * joint
    return c.maps(colour, rough, height, 0.35)


def brick_maps(c: Canvas, tint: Rgb, *, painted: bool) -> SurfaceMaps:
    """A wall of bricks of 24 x 7 cm in running bond; painted: all of one tint."""
    laying = Laying(round(c.size_m[1] / 0.0835), round(c.size_m[0] / 0.25), 0.5, 0.011)
    warp = tuple(np.float32(a) * c.noise(slope=1.8, band=(6.0, 250.0)) for a in (0.0012, 0.0010))
    grid = tile_grid(c, laying, (warp[0], warp[1]))
    clouds = c.noise(slope=2.0, band=(3.0, 150.0))
    grain = c.noise(slope=0.9)
    n = grid.n_tiles
    # Round the bricks off into the joints.
    half = laying.joint_m / 2
    brick = smoothstep(half - 0.001, half + 0.004, np.minimum(grid.edge_m, grid.corner_m * 0.8))
    depth = c.rng.normal(0, 0.0009, n).astype(np.float32)[grid.tile]
    height = brick * (0.006 + depth) + 0.00035 * clouds * brick + 0.00018 * grain
    shade = 1.0 - (0.13 if painted else 0.28) * (1.0 - brick)
    if painted:
        lightness = (shade + 0.012 * clouds + 0.012 * grain)[..., None]
        colour = np.array(tint, np.float32) * lightness
        rough: F32 = np.asarray(0.62 + 0.08 * (1 - brick), np.float32)
    else:
        # Fire bricks between orange, red and brown; some are nearly black.
        fired = np.clip(c.rng.normal(0, 0.10, n), -0.25, 0.2) - 0.22 * (c.rng.random(n) < 0.06)
        warm = c.rng.normal(0, 0.025, n)
        tints = (
            np.array(tint)[None]
            * (1 + fired[:, None])
            * np.stack([1 + warm, 1 + 0 * warm, 1 - warm], -1)
        )
        colour = tints.astype(np.float32)[grid.tile] * (1 + 0.07 * clouds + 0.05 * grain)[..., None]
        mortar = np.array((0.67, 0.64, 0.59), np.float32) * (1 + 0.06 * grain)[..., None]
        colour = (mortar + brick[..., None] * (colour - mortar)) * (shade * 0.5 + 0.5)[..., None]
        rough = np.asarray(0.88 + 0.04 * grain, np.float32)
    return c.maps(colour, rough, height, 0.0)


def _picks(rng: np.random.Generator, grid: TileGrid, glaze: Glaze) -> _INTS:
    # Which colour each pixel's tile has.
    n = len(glaze.colours)
    if glaze.pattern == "checker":
        return np.asarray((grid.row + grid.column) % n)
    if glaze.pattern == "mixed":
        return np.asarray(rng.integers(0, n, grid.n_tiles)[grid.tile])
    return np.zeros_like(grid.tile)


def _brightness(rng: np.random.Generator, grid: TileGrid, variation: float) -> F32:
    by_tile = 1.0 + np.clip(rng.normal(0, variation, grid.n_tiles), -2 * variation, 2 * variation)
    return np.asarray(by_tile.astype(np.float32)[grid.tile], np.float32)
