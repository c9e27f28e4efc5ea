"""Wallpaper: woven plain papers, stripes, damask, leaves and geometric prints; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.dress.noise import Shape2, noise, smoothstep
from pbrs_farm.dress.style import Rgb, mix, shade
from pbrs_farm.dress.surface_maps import SurfaceMaps
from pbrs_farm.furnishings.textures.canvas import Canvas

WIDTH_M = 0.53  # width of a roll

PATTERNS = ("stripes", "damask", "geometric", "leaves")
PLAIN = ("linen", "grasscloth")  # of one colour


def wallpaper_maps(c: Canvas, pattern: str, tints: Sequence[Rgb]) -> SurfaceMaps:
    """Paper printed with one repeat of WIDTH_M square; tints: ground, print, accent."""
    masks = _DRAWN[pattern](c.rng, c.shape)
    colour = _inked(c, masks, tints)
    # Show the paper's own fibres.
    paper = c.noise(slope=0.5)
    clouds = c.noise(slope=3.0, band=(1.0, 8.0))
    colour *= (1.0 + 0.010 * paper + 0.004 * clouds)[..., None]
    height = np.asarray(0.00006 * paper + 0.00012 * masks[0], np.float32)
    return c.maps(colour, 0.8, height, 0.0)


def printed_carpet_maps(c: Canvas, pattern: str, tints: Sequence[Rgb]) -> SurfaceMaps:
    """Cut pile in the colours of a wallpaper's pattern, tints: ground, print, accent."""
    masks = _DRAWN[pattern](c.rng, c.shape)
    pile = c.noise(slope=0.3, band=(c.size_m[0] * 40, 1e9))
    fleck = c.noise(slope=0.6)
    colour = _inked(c, masks, tints)
    colour *= (1.0 + 0.075 * pile + 0.04 * fleck)[..., None]
    return c.maps(colour, 1.0, np.asarray(0.0009 * pile, np.float32), 0.0)


def _inked(c: Canvas, masks: Iterable[F32], tints: Sequence[Rgb]) -> F32:
    """(H, W, 3) ground, print and accent, and a third ink between the first two."""
    ground, print_colour, accent = tints[:3]
    colour = np.broadcast_to(np.array(ground, np.float32), (*c.shape, 3)).copy()
    for mask, ink in zip(
        masks, (print_colour, accent, mix(ground, print_colour, 0.5)), strict=False
    ):
        colour += mask[..., None] * (np.array(ink, np.float32) - colour)
    return colour


def inks(rng: np.random.Generator, ground: Rgb, accent: Rgb) -> tuple[Rgb, Rgb]:
    """Print colours that go with a ground: mostly tone in tone, sometimes with the accent."""
    strength = rng.uniform(0.86, 0.95)
    tone = shade(ground, strength) if sum(ground) > 0.9 else shade(ground, 1.35)
    if rng.random() < 0.3:
        return mix(tone, accent, 0.35), mix(ground, accent, 0.55)
    return tone, mix(tone, accent, 0.25)


def _pixels(shape: Shape2) -> tuple[F32, F32]:
    # x to the right, y up, 0..1 over the repeat.
    y = 1.0 - (np.arange(shape[0], dtype=np.float32) + 0.5) / shape[0]
    x = (np.arange(shape[1], dtype=np.float32) + 0.5) / shape[1]
    return np.broadcast_to(x[None], shape), np.broadcast_to(y[:, None], shape)


def _fill_inside(distance: F32 | F64, shape: Shape2) -> F32:
    # 1 inside (distance < 0), one pixel soft.
    pixel = 1.0 / shape[1]
    return smoothstep(0.8 * pixel, -0.8 * pixel, distance.astype(np.float32))


def _stripes(rng: np.random.Generator, shape: Shape2) -> list[F32]:
    x, _y = _pixels(shape)
    n = int(rng.choice([3, 4, 5, 8, 11]))
    f = np.abs((x * n) % 1.0 - 0.5)
    wide = _fill_inside((f - rng.uniform(0.15, 0.27)) / n, shape)
    # Add a thin line beside the broad stripe, or in the gap.
    line = _fill_inside((np.abs(f - rng.choice([0.34, 0.42])) - 0.018) / n, shape)
    return [wide, line if rng.random() < 0.6 else np.zeros(shape, np.float32)]


def _geometric(rng: np.random.Generator, shape: Shape2) -> list[F32]:
    x, y = _pixels(shape)
    kind = int(rng.integers(5))
    n = int(rng.choice([3, 4, 5]))
    width = rng.uniform(0.05, 0.09)
    if kind == 0:
        # A trellis of lozenges.
        a, b = (x * n + y * n) % 1.0, (x * n - y * n) % 1.0
        lines = np.minimum(np.minimum(a, 1 - a), np.minimum(b, 1 - b))
        centre = np.maximum(np.abs(a - 0.5), np.abs(b - 0.5))
        return [_fill_inside((lines - width) / n, shape), _fill_inside((centre - 0.14) / n, shape)]
    if kind == 1:
        # Scales of concentric arcs: rows of circles, each over those above it.
        return _scales(x, y, n, shape)
    if kind == 2:
        # Zigzags.
        rise = np.abs((x * 2 * n) % 2.0 - 1.0)
        f = np.abs(((y * 2 * n) - rise) % 1.0 - 0.5)
        return [_fill_inside((f - 0.21) / (3 * n), shape), np.zeros(shape, np.float32)]
    if kind == 3:
        # Dots on a diagonal grid.
        a, b = (x * 2 * n) % 2.0 - 1.0, (y * 2 * n) % 2.0 - 1.0
        d = np.minimum(np.hypot(a, b), np.hypot(1 - np.abs(a), 1 - np.abs(b)))
        return [
            _fill_inside((d - rng.uniform(0.18, 0.34)) / (2 * n), shape),
            np.zeros(shape, np.float32),
        ]
    # Hexagons.
    return [_hexagons(x, y, n, width, shape), np.zeros(shape, np.float32)]


def _scales(x: F32, y: F32, n: int, shape: Shape2) -> list[F32]:
    lines = np.zeros(shape, np.float32)
    done = np.zeros(shape, bool)
    # Look at the rows from the lowest that can cover a pixel; the first circle that holds it counts.
    row0 = np.floor(y * 2 * n)
    for k in (-1, 0, 1, 2):
        row = row0 + 1 - k
        cy = row / (2 * n)
        shift = np.where(row % 2 == 0, 0.0, 0.5)
        cx = (x * n + shift) % 1.0 - 0.5
        d = np.hypot(cx, (y - cy) * n)
        inside = (d < 0.5) & ~done & (y <= cy + 0.5 / n)
        rings = np.abs(((d / 0.5) * 3.0) % 1.0 - 0.93)
        lines = np.where(inside, _fill_inside((rings - 0.13) / (6 * n), shape), lines)
        done |= inside
    return [np.asarray(lines, np.float32), np.zeros(shape, np.float32)]


def _hexagons(x: F32, y: F32, n: int, width: float, shape: Shape2) -> F32:
    # Distance to the second nearest centre less that to the nearest, two lattices of centres.
    sx, sy = x * n, y * (n * 4 // 7 or 1) * np.sqrt(3.0)
    h = np.float32(np.sqrt(3.0))
    near = np.full(shape, 9.0, np.float32)
    second = near.copy()
    for dx in (-1.0, 0.0, 1.0):
        for dy in (-1.0, 0.0, 1.0):
            for half in (0.0, 0.5):
                cx = np.floor(sx) + dx + half
                cy = (np.floor(sy / h) + dy + half) * h
                d = np.hypot(sx - cx, sy - cy).astype(np.float32)
                second = np.minimum(second, np.maximum(near, d))
                near = np.minimum(near, d)
    return _fill_inside(((second - near) - width) / n, shape)


def _leaf_distance(x: F32, y: F32, length: float, width: float) -> F32:
    # Distance-like value of a pointed leaf from (0, 0) to (length, 0); < 0 inside.
    t = np.clip(x / length, 0.0, 1.0)
    half = width * np.sin(np.pi * t**0.8) * (1.0 - 0.25 * t)
    outside = np.maximum(np.maximum(-x, x - length), 0.0)
    return np.asarray(np.maximum(np.abs(y) - half, outside), np.float32)


def _axes_about(x: F32, y: F32, at: tuple[float, float], angle: float) -> tuple[F32, F32]:
    # Coordinates from a point on the torus, along and across a direction.
    dx = (x - np.float32(at[0]) + 0.5) % 1.0 - 0.5
    dy = (y - np.float32(at[1]) + 0.5) % 1.0 - 0.5
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    return np.asarray(dx * c + dy * s, np.float32), np.asarray(dy * c - dx * s, np.float32)


def _stamp_motif(
    mask: F32,
    at: tuple[float, float],
    angle: float,
    reach: float,
    distance: Callable[[F32, F32], F32],
) -> None:
    # Draw a shape around a point into the mask, through its edges; only near pixels are touched.
    edge = mask.shape[0]
    middle = np.floor(np.array([at[0], 1.0 - at[1]]) * edge).astype(np.int64)
    span = np.arange(-int(reach * edge) - 2, int(reach * edge) + 3)
    columns, rows = middle[0] + span, middle[1] + span
    dx = ((columns + 0.5) / edge - at[0]).astype(np.float32)[None]
    dy = (1.0 - (rows + 0.5) / edge - at[1]).astype(np.float32)[:, None]
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    ink = _fill_inside(distance(dx * c + dy * s, dy * c - dx * s), (edge, edge))
    place = np.ix_(rows % edge, columns % edge)
    mask[place] = np.maximum(mask[place], ink)


def _leaves(rng: np.random.Generator, shape: Shape2) -> list[F32]:
    fills, veins = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    length = float(rng.uniform(0.10, 0.135))
    # Set sprigs on a staggered grid, each a bent stem with leaves to both sides.
    for k, spot in enumerate(
        ((0.18, 0.03), (0.52, 0.22), (0.84, 0.42), (0.20, 0.53), (0.52, 0.72), (0.84, 0.92))
    ):
        angle = np.pi / 2 + float(rng.uniform(-0.45, 0.45)) + (0.25 if k % 2 else -0.25)
        curve, point = float(rng.uniform(-0.7, 0.7)) / 8, np.array(spot)
        for step in range(8):
            _stamp_motif(veins, (point[0], point[1]), angle, 0.065, _stem(0.062, 0.0022))
            size = length * (1.0 - 0.09 * step)
            for side in (1, -1) if step < 7 else (0,):
                turn = angle + side * 0.85
                _stamp_motif(
                    fills,
                    (point[0], point[1]),
                    turn,
                    size,
                    partial(_leaf_distance, length=size, width=size * 0.17),
                )
                _stamp_motif(veins, (point[0], point[1]), turn, size, _stem(0.8 * size, 0.0013))
            point = point + 0.06 * np.array([np.cos(angle), np.sin(angle)])
            angle += curve
    return [fills, veins]


def _stem(length: float, half: float) -> Callable[[F32, F32], F32]:
    return lambda x, y: np.maximum(np.abs(y) - half, np.maximum(-x, x - length))


def _damask(rng: np.random.Generator, shape: Shape2) -> list[F32]:
    x, y = _pixels(shape)
    ink, second = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    petals = int(rng.choice([5, 7]))
    lift = float(rng.uniform(0.8, 1.1))
    # Repeat a palmette, mirrored about its axis, at the nodes and centres of the repeat.
    for spot in ((0.25, 0.02), (0.75, 0.52)):
        mx, my = _axes_about(x, y, spot, 0.0)
        mx = np.abs(mx)
        for k in range(petals):
            angle = np.pi / 2 - k * lift * 1.5 / petals
            c, s = np.cos(angle), np.sin(angle)
            px, py = mx * c + (my - 0.10) * s, (my - 0.10) * c - mx * s
            size = 0.21 - 0.018 * k
            petal = _leaf_distance(px - 0.03, py, size, 0.026)
            ink = np.maximum(ink, _fill_inside(petal, shape))
            second = np.maximum(
                second, _fill_inside(_leaf_distance(px - 0.05, py, size * 0.7, 0.008), shape)
            )
        # Let a smaller palmette hang below, and close the ogee around both.
        for k in range(4):
            angle = -np.pi / 2 + k * 0.42
            c, s = np.cos(angle), np.sin(angle)
            px, py = mx * c + (my - 0.09) * s, (my - 0.09) * c - mx * s
            size = 0.15 - 0.014 * k
            ink = np.maximum(ink, _fill_inside(_leaf_distance(px - 0.02, py, size, 0.018), shape))
        arm = np.abs(np.hypot(mx - 0.115, my - 0.085) - 0.052)
        arm = np.maximum(arm, 0.085 - my - 0.02)
        ink = np.maximum(ink, _fill_inside(arm - 0.006, shape))
        ogee = np.abs(mx - 0.25 * np.cos(np.pi * np.clip(my, -0.5, 0.5)) ** 2)
        ink = np.maximum(ink, _fill_inside(ogee - 0.0065, shape))
    return [ink, second]


def _woven(rng: np.random.Generator, shape: Shape2, *, is_linen: bool) -> list[F32]:
    """Threads across the roll and, of linen, along it."""
    threads = noise(rng, shape, slope=0.4, stretch=(1.0, 30.0), band=(20.0, 1e9))
    if is_linen:
        threads = 0.6 * threads + 0.6 * noise(
            rng, shape, slope=0.4, stretch=(30.0, 1.0), band=(20.0, 1e9)
        )
    ink = np.clip(0.35 + 0.3 * threads, 0, 1)
    return [np.asarray(ink, np.float32), np.zeros(shape, np.float32)]


_DRAWN: dict[str, Callable[[np.random.Generator, Shape2], list[F32]]] = {
    "stripes": _stripes,
    "geometric": _geometric,
    "leaves": _leaves,
    "damask": _damask,
    "linen": partial(_woven, is_linen=True),
    "grasscloth": partial(_woven, is_linen=False),
}
