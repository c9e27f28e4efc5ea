"""Surfaces without a pattern: plaster, rolled paint, carpet, woven cloth, leather; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.dress.noise import Shape2, blurred, smoothstep
from pbrs_farm.dress.style import Rgb
from pbrs_farm.dress.surface_maps import SurfaceMaps
from pbrs_farm.furnishings.textures.canvas import Canvas

_THREADS_M = 500.0  # threads of cloth a metre, or as many as the picture can show


def paint_maps(c: Canvas, tint: Rgb) -> SurfaceMaps:
    """Wall paint put on by a roller: one tint, faintly clouded, with the roller's stipple."""
    clouds = c.noise(slope=3.0, band=(1.0, 30.0))
    per_metre = c.shape[1] / c.size_m[0]
    stipple = c.noise(slope=0.5, band=(c.size_m[0] * 50, min(c.size_m[0] * 220, per_metre)))
    colour = np.array(tint, np.float32) * (1.0 + 0.005 * clouds + 0.006 * stipple)[..., None]
    height = np.asarray(0.00009 * stipple + 0.0003 * clouds, np.float32)
    return c.maps(colour, 0.85, height, 0.0)


def plaster_maps(c: Canvas, tint: Rgb, *, depth: float = 1.0) -> SurfaceMaps:
    """Plaster worked with a trowel: strokes that cross, hollows a little darker."""
    clouds = c.noise(slope=2.6, band=(1.0, 60.0))
    # Lay strokes of two directions over each other, each where the other is low.
    a = c.noise(slope=1.8, stretch=(3.0, 1.0), band=(6.0, 300.0))
    b = c.noise(slope=1.8, stretch=(1.0, 3.0), band=(6.0, 300.0))
    strokes = np.maximum(a, b)
    grain = c.noise(slope=0.4)
    tone = 0.012 * clouds + 0.014 * (strokes - 0.56) + 0.008 * grain
    colour = np.array(tint, np.float32) * (1.0 + np.float32(depth) * tone)[..., None]
    height = depth * (0.00045 * strokes + 0.0006 * clouds + 0.00006 * grain)
    return c.maps(colour, 0.9, height, 0.0)


def concrete_maps(c: Canvas, tint: Rgb) -> SurfaceMaps:
    """Smooth concrete: clouds of cement, pores."""
    # Bands are in cycles over the picture: clouds wide, streaks long, grain fine.
    clouds = c.noise(slope=2.2, band=(1.0, 120.0))
    streaks = c.noise(slope=2.0, stretch=(1.0, 2.5), band=(4.0, 200.0))
    grain = c.noise(slope=0.6)
    dots = c.noise(slope=0.0, band=(1.0, c.shape[0] / 4))
    # Pores are the tail of a noise, beyond about three standard deviations.
    pores = smoothstep(2.9, 3.4, dots)
    tone = 0.045 * clouds + 0.02 * streaks + 0.014 * grain - 0.22 * pores
    colour = np.array(tint, np.float32) * (1.0 + tone)[..., None]
    height = np.asarray(0.0002 * streaks - 0.0015 * pores, np.float32)
    return c.maps(colour, 0.62 + 0.05 * clouds, height, 0.15)


def carpet_maps(c: Canvas, tint: Rgb, *, loops: bool) -> SurfaceMaps:
    """Carpet: cut pile brushed here and there, or loops in rows."""
    pile = c.noise(slope=0.3, band=(c.size_m[0] * 40, 1e9))
    brushed = c.noise(slope=1.5, band=(2.0, 25.0))
    fleck = c.noise(slope=0.6)
    if loops:
        # Set loops in rows, every other row half a loop on.
        n = round(c.size_m[0] / 0.008) // 2 * 2
        y = (np.arange(c.shape[0], dtype=np.float32) + 0.5) / c.shape[0] * n
        x = (np.arange(c.shape[1], dtype=np.float32) + 0.5) / c.shape[1] * n
        shift = np.where(np.floor(y) % 2 == 1, 0.5, 0.0)[:, None]
        loop = np.abs(np.sin(np.pi * (x[None] + shift))) * np.abs(np.sin(np.pi * y))[:, None]
        pile = 1.4 * (loop.astype(np.float32) - 0.4) + 0.6 * pile
    tone = 0.075 * pile + 0.014 * brushed + 0.04 * fleck
    colour = np.array(tint, np.float32) * (1.0 + tone)[..., None]
    return c.maps(colour, 1.0, 0.0009 * pile, 0.0)


def weave_maps(
    c: Canvas, tint: Rgb, *, second: Rgb | None = None, twill: bool = False
) -> SurfaceMaps:
    """Woven cloth: warp and weft over and under each other. second: colour of the weft."""
    n = max(8, round(min(_THREADS_M, c.shape[1] / c.size_m[0] / 3.2) * c.size_m[0]) // 4 * 4)
    y = ((np.arange(c.shape[0], dtype=np.float32) + 0.5) / c.shape[0] * n)[:, None]
    x = ((np.arange(c.shape[1], dtype=np.float32) + 0.5) / c.shape[1] * n)[None]
    # Let the warp lie on top in every other crossing, or in twos along a diagonal.
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    on_top = (i + j) % 4 < 2 if twill else (i + j) % 2 == 0
    thread_x = np.abs(np.sin(np.pi * x)) ** 0.6
    thread_y = np.abs(np.sin(np.pi * y)) ** 0.6
    over = np.where(on_top, thread_x * (0.5 + 0.5 * thread_y), thread_y * (0.5 + 0.5 * thread_x))
    # Vary each thread's thickness and dye.
    slub_x = c.noise(slope=1.0, stretch=(20.0, 1.0), band=(1.0, 1e9))
    slub_y = c.noise(slope=1.0, stretch=(1.0, 20.0), band=(1.0, 1e9))
    slub = np.where(on_top, slub_x, slub_y)
    light = 0.80 + 0.26 * over + 0.045 * slub
    first = np.array(tint, np.float32)
    weft = first * np.float32(0.93) if second is None else np.array(second, np.float32)
    colour = np.where(on_top[..., None], first, weft) * light[..., None]
    height = np.asarray(0.25 * c.size_m[0] / n * (over + 0.15 * slub), np.float32)
    return c.maps(np.asarray(colour, np.float32), 0.95, height, 0.0)


def leather_maps(c: Canvas, tint: Rgb) -> SurfaceMaps:
    """Leather: pebbles parted by fine creases, worn tones."""
    cells, second = _distances_to_points(c.rng, c.shape, int(c.size_m[0] * c.size_m[1] / 0.0045**2))
    crease = smoothstep(0.45, 0.0, second - cells)
    creases = blurred(crease, 0.7)
    clouds = c.noise(slope=2.6, band=(1.0, 40.0))
    colour = np.array(tint, np.float32) * (1.0 + 0.035 * clouds - 0.22 * creases)[..., None]
    height = np.asarray(-0.00035 * creases + 0.0004 * clouds, np.float32)
    return c.maps(colour, 0.46 + 0.05 * clouds + 0.2 * creases, height, 0.4)


def _distances_to_points(rng: np.random.Generator, shape: Shape2, n: int) -> tuple[F32, F32]:
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
