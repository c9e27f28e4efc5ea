"""Pictures of rugs and mats by a seed: bordered, striped, lattice, kilim, coir and others; no effects.

Every pattern is a function (rng, size, inks) -> (H, W, 3) float32, sRGB-encoded, 0..1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F32, Srgb8Image
from pbrs_farm.dress.style import Rgb, Style, mix, shade

Size = tuple[int, int]  # width and height in pixels
Inks = tuple[Rgb, ...]  # ground first
Pattern = Callable[[np.random.Generator, Size, Inks], F32]

_PX_PER_M = 190.0
_PILED = ("shag", "bobbles", "waffle", "coir", "ribs", "sisal")  # no weft shows


def rug_pixels(
    rng: np.random.Generator, width_m: float, length_m: float, style: Style, pattern: str
) -> Srgb8Image:
    """(H, W, 3) uint8 of a rug so large, its length across the picture; pattern: of PATTERNS."""
    size = max(int(length_m * _PX_PER_M), 48), max(int(width_m * _PX_PER_M), 48)
    picture = PATTERNS[pattern](rng, size, inks_of(rng, style))
    # Yarn is never dyed evenly, and knots show.
    pile = rng.standard_normal(picture.shape[:2], np.float32)
    tone = 1 + 0.05 * pile + 0.12 * ndimage.gaussian_filter(pile, 5.0, mode="wrap")
    if pattern not in _PILED:
        tone *= 1 + 0.03 * np.sin(np.arange(size[1]) * np.pi / 1.5)[:, None]
    return np.asarray(np.clip(picture * tone[..., None], 0.02, 0.95) * 255 + 0.5, np.uint8)


def inks_of(rng: np.random.Generator, style: Style) -> Inks:
    """A ground and four inks of the style, or wool as the sheep wear it."""
    if rng.random() < 0.25:
        wool: Rgb = (0.84, 0.8, 0.72)
        return (wool, (0.25, 0.22, 0.2), (0.55, 0.48, 0.4), (0.7, 0.65, 0.57), (0.4, 0.34, 0.28))
    colours = [*style.textiles, style.accent]
    colours = [colours[int(k)] for k in rng.permutation(len(colours))]
    ground = mix(colours[0], (0.85, 0.81, 0.74), float(rng.uniform(0, 0.6)))
    return (ground, *colours[1:4], shade(colours[4 % len(colours)], 0.7))


def _coordinates(size: Size) -> tuple[F32, F32]:
    # Metres from the middle.
    x = (np.arange(size[0]) + 0.5 - size[0] / 2) / _PX_PER_M
    y = (np.arange(size[1]) + 0.5 - size[1] / 2) / _PX_PER_M
    u, v = np.meshgrid(x, y)
    return u.astype(np.float32), v.astype(np.float32)


def _one_colour(size: Size, colour: Rgb) -> F32:
    return np.broadcast_to(np.array(colour, np.float32), (size[1], size[0], 3)).copy()


def _to_edge(u: F32, v: F32) -> F32:
    # Metres to the nearest edge.
    half_u, half_v = float(u.max()), float(v.max())
    return np.asarray(np.minimum(half_u - np.abs(u), half_v - np.abs(v)), np.float32)


def _bordered(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Borders within borders round a field of small figures and a medallion."""
    u, v = _coordinates(size)
    edge, picture = _to_edge(u, v), _one_colour(size, inks[1])
    step = float(rng.uniform(0.07, 0.1))
    figures = np.sin(2 * np.pi * u / step) * np.sin(2 * np.pi * v / step)
    picture[figures > 0.55] = inks[2]
    picture[figures < -0.75] = inks[0]
    # Lay a medallion in the middle.
    radius = 0.42 * float(v.max()) * 2
    star = np.hypot(u * 0.72, v) * (1 + 0.12 * np.cos(8 * np.arctan2(v, u * 0.72)))
    for k, part in enumerate((0.62, 0.54, 0.36, 0.3, 0.12)):
        picture[star < part * radius] = inks[(k * 2 + 4) % 5]
    for k, (low, high) in enumerate(
        ((0.0, 0.03), (0.03, 0.06), (0.06, 0.2), (0.2, 0.225), (0.225, 0.26))
    ):
        band = (edge >= low) & (edge < high)
        picture[band] = inks[(4, 0, 2, 0, 4)[k]]
        if k == 2:
            run = np.where(np.abs(u) > np.abs(v) * float(u.max() / v.max()), v, u)
            leaf = np.abs(np.sin(2 * np.pi * run / 0.14)) * 0.06 > np.abs(edge - 0.13)
            picture[band & leaf] = inks[3]
    return picture


def _striped(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Stripes of uneven width across the rug."""
    u, _v = _coordinates(size)
    cuts = np.sort(rng.uniform(float(u.min()), float(u.max()), int(rng.integers(6, 16))))
    colours = np.array(inks, np.float32)[rng.integers(0, 5, len(cuts) + 1)]
    return np.asarray(colours[np.searchsorted(cuts, u)], np.float32)


def _lattice(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Dark lines crossing as lozenges on a light ground."""
    u, v = _coordinates(size)
    wide, high = float(rng.uniform(0.28, 0.45)), float(rng.uniform(0.28, 0.6))
    picture = _one_colour(size, mix(inks[0], (0.86, 0.83, 0.76), 0.6))
    wobble = 0.012 * np.sin(11 * v + 7 * u)
    a, b = (u + wobble) / wide + v / high, (u + wobble) / wide - v / high
    line = np.minimum(np.abs(a - np.round(a)), np.abs(b - np.round(b)))
    picture[line < 0.04] = shade(inks[1], 0.55)
    return picture


def _diamonds(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Rows of diamonds in several colours, woven in steps."""
    u, v = _coordinates(size)
    pitch = float(rng.uniform(0.22, 0.4))
    snap = 0.018
    # Snap coordinates to 18 mm, so that oblique lines climb in steps.
    u, v = np.floor(u / snap) * snap, np.floor(v / snap) * snap
    column, row = np.round(u / pitch), np.round(v / (1.3 * pitch))
    # The L1 distance to the nearest diamond's middle; bands of it take turns in three colours.
    ring = np.abs(u / pitch - column) + np.abs(v / (1.3 * pitch) - row)
    picture = _one_colour(size, inks[0])
    pick = (column + 2 * row).astype(int) % 3 + 1
    for k, (low, high) in enumerate(((0.0, 0.13), (0.2, 0.34), (0.34, 0.42))):
        band = (ring >= low) & (ring < high)
        picture[band] = np.array(inks, np.float32)[(pick[band] + k) % 5]
    edge = _to_edge(u.astype(np.float32), v.astype(np.float32))
    picture[edge < 0.07] = inks[4]
    picture[(edge > 0.03) & (edge < 0.045)] = inks[0]
    return picture


def _shag(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Long pile in one colour: tufts with dark between."""
    tuft = ndimage.gaussian_filter(rng.standard_normal((size[1], size[0])), 1.2, mode="wrap")
    lie = ndimage.gaussian_filter(rng.standard_normal((size[1], size[0])), 14.0, mode="wrap")
    tone = 0.9 + 0.07 * tuft / tuft.std() + 0.05 * lie / lie.std()
    return np.asarray(_one_colour(size, inks[0]) * tone[..., None], np.float32)


def _plain_rug(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """One colour with a bound edge, or a wide border."""
    u, v = _coordinates(size)
    picture, edge = _one_colour(size, inks[0]), _to_edge(u, v)
    picture[edge < (0.03 if rng.random() < 0.6 else 0.16)] = inks[1]
    return picture


def _blocks(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Large areas of colour with round corners: a modern rug."""
    u, v = _coordinates(size)
    picture = _one_colour(size, inks[0])
    for k in range(4):
        x, y = float(rng.uniform(u.min(), u.max())), float(rng.uniform(v.min(), v.max()))
        a, b = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.25, 0.6))
        inside = (np.abs(u - x) / a) ** 3 + (np.abs(v - y) / b) ** 3 < 1
        picture[inside] = inks[1 + k % 4]
    return picture


def _kilim(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Bands across the rug: plain ones, and ones of stepped triangles that meet."""
    u, v = _coordinates(size)
    snap = 0.02
    u, v = np.floor(u / snap) * snap, np.floor(v / snap) * snap
    picture, edge = _one_colour(size, inks[0]), float(u.min())
    colours = np.array(inks, np.float32)
    while edge < u.max():
        wide = float(rng.choice([0.04, 0.06, 0.16, 0.2]))
        band = (u >= edge) & (u < edge + wide)
        ground, figure = rng.permutation(5)[:2]
        picture[band] = colours[ground]
        if wide > 0.1:
            pitch = float(rng.choice([0.16, 0.24]))
            height = np.abs((v / pitch) % 1 - 0.5) * 2
            across = np.abs((u - edge) / wide - 0.5) * 2
            picture[band & (height + across < 0.9)] = colours[figure]
        edge += wide
    return picture


def _checks(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Squares of two colours in turn."""
    u, v = _coordinates(size)
    side = float(rng.uniform(0.12, 0.3))
    picture = _one_colour(size, mix(inks[0], (0.9, 0.87, 0.8), 0.5))
    picture[(np.floor(u / side) + np.floor(v / side)) % 2 == 0] = inks[1]
    return picture


def _line_grid_rug(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Thin lines that cross at right angles, drawn by hand, on light wool."""
    u, v = _coordinates(size)
    side, picture = (
        float(rng.uniform(0.22, 0.4)),
        _one_colour(size, mix(inks[0], (0.88, 0.85, 0.78), 0.7)),
    )
    a, b = (u + 0.01 * np.sin(9 * v)) / side, (v + 0.01 * np.sin(8 * u + 1)) / side
    line = np.minimum(np.abs(a - np.round(a)), np.abs(b - np.round(b))) * side
    picture[line < float(rng.uniform(0.008, 0.016))] = shade(inks[2], 0.6)
    return picture


def _faded(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """A bordered rug, dyed over in one colour and worn in patches."""
    old = _bordered(rng, size, inks)
    grey = old.mean(-1, keepdims=True)
    dyed = np.array(inks[3], np.float32) * (0.55 + 0.8 * grey)
    wear = ndimage.gaussian_filter(rng.standard_normal((size[1], size[0])), 5.0, mode="nearest")
    bare = np.clip(0.35 + 0.3 * wear / wear.std(), 0, 0.8)[..., None]
    return np.asarray(dyed * (1 - bare) + np.array((0.7, 0.66, 0.6)) * bare, np.float32)


def _sisal(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Coarse natural weave with a bound edge of cloth."""
    u, v = _coordinates(size)
    straw = mix((0.68, 0.58, 0.42), inks[0], float(rng.uniform(0, 0.3)))
    step = 0.016
    over = (np.floor(u / step) + np.floor(v / step)) % 2
    cross = np.where(over == 0, np.sin(np.pi * u / step) ** 2, np.sin(np.pi * v / step) ** 2)
    picture = _one_colour(size, straw) * (0.72 + 0.34 * cross)[..., None].astype(np.float32)
    picture[_to_edge(u, v) < 0.04] = shade(inks[1], 0.7)
    return np.asarray(picture, np.float32)


def _arches(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Rows of arches within arches, as fish scales."""
    u, v = _coordinates(size)
    pitch = float(rng.uniform(0.28, 0.5))
    picture, colours = _one_colour(size, inks[0]), np.array(inks, np.float32)
    n_rows = int(np.ceil(float(v.max() - v.min()) / (0.5 * pitch))) + 2
    for row in range(n_rows):
        foot = float(v.min()) + row * 0.5 * pitch - pitch * 0.5
        across = (u / pitch + 0.5 * (row % 2) + 0.5) % 1 - 0.5
        r = np.hypot(across, (v - foot) / pitch)
        inside = (r < 0.5) & (v >= foot)
        picture[inside] = colours[(np.floor(r[inside] * 10).astype(int)) % 5]
    return picture


def _curves(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Few lines that wander over one ground."""
    u, v = _coordinates(size)
    picture = _one_colour(size, mix(inks[0], (0.86, 0.83, 0.77), 0.4))
    for k in range(int(rng.integers(3, 7))):
        a, b, c = rng.uniform(1.5, 4.5), rng.uniform(0.1, 0.35), rng.uniform(0, 6.3)
        turn = rng.uniform(0, np.pi)
        along, across = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
        away = np.abs(across - b * np.sin(a * along + c) - rng.uniform(-0.8, 0.8))
        picture[away < float(rng.uniform(0.008, 0.03))] = inks[1 + k % 4]
    return picture


def _ring_rug(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Rings round the middle, braided."""
    u, v = _coordinates(size)
    out = np.maximum(np.hypot(u / u.max(), v / v.max()), 1e-3)
    cuts = np.sort(rng.uniform(0.15, 1.0, int(rng.integers(3, 8))))
    colours = np.array(inks, np.float32)[rng.integers(0, 5, len(cuts) + 1)]
    braid = 1 + 0.06 * np.sin(out * u.max() * 2 * np.pi / 0.02)
    return np.asarray(colours[np.searchsorted(cuts, out)] * braid[..., None], np.float32)


def _stars(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Small stars or dots scattered on a grid: a child's rug."""
    u, v = _coordinates(size)
    pitch, picture = float(rng.uniform(0.16, 0.28)), _one_colour(size, mix(inks[1], (1, 1, 1), 0.4))
    row = np.round(v / pitch)
    shifted = u + 0.5 * pitch * (row % 2)
    x, y = shifted - np.round(shifted / pitch) * pitch, v - row * pitch
    points = int(rng.choice([0, 5]))
    reach = 0.25 * pitch * (1 + (0.35 * np.cos(points * np.arctan2(x, y)) if points else 0))
    picture[np.hypot(x, y) < reach] = inks[0]
    return picture


def _bobbles(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Rows of knobs of pile, for a bath."""
    u, v = _coordinates(size)
    step = float(rng.uniform(0.018, 0.03))
    row = np.floor(v / step)
    x, y = (u / step + 0.5 * (row % 2)) % 1 - 0.5, (v / step) % 1 - 0.5
    tone = 1.05 - 0.9 * np.minimum(x * x + y * y, 0.5)
    return np.asarray(_one_colour(size, inks[0]) * tone[..., None], np.float32)


def _waffle(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Small hollows in a grid of ribs, within a flat hem."""
    u, v = _coordinates(size)
    step = float(rng.uniform(0.012, 0.02))
    rib = np.maximum(np.abs((u / step) % 1 - 0.5), np.abs((v / step) % 1 - 0.5)) * 2
    picture = _one_colour(size, inks[0]) * (0.82 + 0.2 * rib)[..., None]
    picture[_to_edge(u, v) < 0.035] = inks[0]
    return np.asarray(picture, np.float32)


def _towelling(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """A mat of terry with stripes near its ends."""
    u, _v = _coordinates(size)
    picture, end = _one_colour(size, inks[0]), float(u.max()) - np.abs(u)
    for k in range(int(rng.integers(1, 4))):
        picture[(end > 0.05 + 0.04 * k) & (end < 0.07 + 0.04 * k)] = inks[1]
    return picture


_COIR: Rgb = (0.5, 0.38, 0.24)


def _coir(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Bristles of coconut with a dark border, stripes or a big figure."""
    u, v = _coordinates(size)
    bristle = rng.standard_normal((size[1], size[0]), np.float32)
    picture = _one_colour(size, _COIR) * (1 + 0.12 * bristle)[..., None]
    dark, edge = (0.1, 0.09, 0.08), _to_edge(u, v)
    form = int(rng.integers(3))
    if form == 0:
        picture[(edge > 0.03) & (edge < 0.055)] = dark
    elif form == 1:
        picture[np.floor(u / 0.09) % 2 == 0] = dark
    else:
        r = np.hypot(u, v * 1.2)
        picture[(r < 0.16) & (r > 0.11)] = dark
    return np.asarray(picture, np.float32)


def _ribs(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Grey ribs in a rubber rim."""
    u, v = _coordinates(size)
    grey = float(rng.uniform(0.15, 0.4))
    rib = 0.75 + 0.35 * np.sin(2 * np.pi * u / 0.012)
    picture = _one_colour(size, (grey, grey, grey * 1.02)) * rib[..., None].astype(np.float32)
    picture[_to_edge(u, v) < 0.025] = (0.06, 0.06, 0.06)
    return np.asarray(picture, np.float32)


# fmt: off
RUGS: dict[str, Pattern] = {
    "bordered": _bordered, "striped": _striped, "lattice": _lattice, "diamonds": _diamonds,
    "shag": _shag, "plain": _plain_rug, "blocks": _blocks, "kilim": _kilim, "checks": _checks,
    "grid": _line_grid_rug, "faded": _faded, "sisal": _sisal, "arches": _arches, "curves": _curves,
    "rings": _ring_rug, "stars": _stars,
}
# fmt: on
BATH_MATS: dict[str, Pattern] = {
    "shag": _shag,
    "bobbles": _bobbles,
    "waffle": _waffle,
    "towelling": _towelling,
    "striped": _striped,
}
DOOR_MATS: dict[str, Pattern] = {"coir": _coir, "ribs": _ribs, "plain": _plain_rug, "sisal": _sisal}
PATTERNS: dict[str, Pattern] = RUGS | BATH_MATS | DOOR_MATS
"""Every pattern by its name; docs/dress.md shows the rugs."""
