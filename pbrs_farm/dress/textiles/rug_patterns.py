"""Pictures of rugs and mats by a seed: bordered, striped, lattice, diamonds, shag, plain; no effects.

Every family is a function (rng, size, inks) -> (H, W, 3) float32, sRGB-encoded, 0..1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F32, Srgb8Image
from pbrs_farm.dress.style import Rgb, Style, mix, shade

Size = tuple[int, int]  # width and height in pixels
Inks = tuple[Rgb, ...]  # ground first
Family = Callable[[np.random.Generator, Size, Inks], F32]

_PX_PER_M = 190.0


def rug_pixels(
    rng: np.random.Generator, width_m: float, length_m: float, style: Style, family: str = ""
) -> Srgb8Image:
    """(H, W, 3) uint8 of a rug so large, its length across the picture."""
    size = max(int(length_m * _PX_PER_M), 48), max(int(width_m * _PX_PER_M), 48)
    name = family or str(rng.choice(list(FAMILIES)))
    picture = FAMILIES[name](rng, size, inks_of(rng, style))
    # Yarn is never dyed evenly, and knots show.
    pile = rng.standard_normal(picture.shape[:2], np.float32)
    tone = 1 + 0.05 * pile + 0.12 * ndimage.gaussian_filter(pile, 5.0, mode="wrap")
    if name != "shag":
        tone *= 1 + 0.03 * np.sin(np.arange(size[1]) * np.pi / 1.5)[:, None]
    return np.asarray(np.clip(picture * tone[..., None], 0.02, 0.95) * 255 + 0.5, np.uint8)


def inks_of(rng: np.random.Generator, style: Style) -> Inks:
    """A ground and four inks of the style, or wool as the sheep wear it."""
    if rng.random() < 0.25:
        wool: Rgb = (0.84, 0.8, 0.72)
        return (wool, (0.25, 0.22, 0.2), (0.55, 0.48, 0.4), (0.7, 0.65, 0.57), (0.4, 0.34, 0.28))
    own = [*style.textiles, style.accent]
    own = [own[int(k)] for k in rng.permutation(len(own))]
    ground = mix(own[0], (0.85, 0.81, 0.74), float(rng.uniform(0, 0.6)))
    return (ground, *own[1:4], shade(own[4 % len(own)], 0.7))


def _coordinates(size: Size) -> tuple[F32, F32]:
    # Metres from the middle.
    x = (np.arange(size[0]) + 0.5 - size[0] / 2) / _PX_PER_M
    y = (np.arange(size[1]) + 0.5 - size[1] / 2) / _PX_PER_M
    u, v = np.meshgrid(x, y)
    return u.astype(np.float32), v.astype(np.float32)


def _filled(size: Size, colour: Rgb) -> F32:
    return np.broadcast_to(np.array(colour, np.float32), (size[1], size[0], 3)).copy()


def _to_edge(u: F32, v: F32) -> F32:
    # Metres to the nearest edge.
    half_u, half_v = float(u.max()), float(v.max())
    return np.asarray(np.minimum(half_u - np.abs(u), half_v - np.abs(v)), np.float32)


def _bordered(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Borders within borders round a field of small figures and a medallion."""
    u, v = _coordinates(size)
    edge, picture = _to_edge(u, v), _filled(size, inks[1])
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
    picture = _filled(size, mix(inks[0], (0.86, 0.83, 0.76), 0.6))
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
    picture = _filled(size, inks[0])
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
    return np.asarray(_filled(size, inks[0]) * tone[..., None], np.float32)


def _plain(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """One colour with a bound edge, or a wide border."""
    u, v = _coordinates(size)
    picture, edge = _filled(size, inks[0]), _to_edge(u, v)
    picture[edge < (0.03 if rng.random() < 0.6 else 0.16)] = inks[1]
    return picture


def _blocks(rng: np.random.Generator, size: Size, inks: Inks) -> F32:
    """Large areas of colour with round corners: a modern rug."""
    u, v = _coordinates(size)
    picture = _filled(size, inks[0])
    for k in range(4):
        x, y = float(rng.uniform(u.min(), u.max())), float(rng.uniform(v.min(), v.max()))
        a, b = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.25, 0.6))
        inside = (np.abs(u - x) / a) ** 3 + (np.abs(v - y) / b) ** 3 < 1
        picture[inside] = inks[1 + k % 4]
    return picture


FAMILIES: dict[str, Family] = {
    "bordered": _bordered, "striped": _striped, "lattice": _lattice, "diamonds": _diamonds,
    "shag": _shag, "plain": _plain, "blocks": _blocks,
}  # fmt: skip
