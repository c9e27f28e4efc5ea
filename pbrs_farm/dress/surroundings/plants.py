"""Trees, bushes and hedges of loose leaves about a dark core; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.dress.surroundings.scenery import Rgb, Scenery, SceneryMaterial, mottled
from pbrs_farm.geometry.solids import box_quads

_LEAF_TILE_M: Final = 0.9
_GREENS: Final[tuple[tuple[Rgb, Rgb], ...]] = (
    ((0.012, 0.03, 0.007), (0.10, 0.19, 0.035)),  # lime
    ((0.008, 0.022, 0.008), (0.05, 0.11, 0.03)),  # oak
    ((0.016, 0.026, 0.006), (0.15, 0.19, 0.05)),  # birch
    ((0.006, 0.016, 0.010), (0.028, 0.065, 0.035)),  # fir
)
FIR: Final = 3


def leaf_looks(rng: np.random.Generator) -> list[SceneryMaterial]:
    """A look of leaves for each kind of tree."""
    return [
        SceneryMaterial(f"leaves {k}", picture=mottled(rng, dark, light, slope=0.8), size_m=(_LEAF_TILE_M,) * 2)
        for k, (dark, light) in enumerate(_GREENS)
    ]  # fmt: skip


def bark(rng: np.random.Generator) -> SceneryMaterial:
    """The look of trunks."""
    return SceneryMaterial("bark", picture=mottled(rng, (0.03, 0.022, 0.015), (0.12, 0.09, 0.065)))


def tree(
    scenery: Scenery, thing: str, rng: np.random.Generator, foot: F64, height: float,
    leaves: SceneryMaterial, trunk: SceneryMaterial, *, is_fir: bool = False, n: int = 340,
) -> None:  # fmt: skip
    """A tree on foot (3,): a trunk, clumps of leaves about it, of a fir in a cone."""
    crown_low = (0.12 if is_fir else 0.3) * height
    radius = (0.2 if is_fir else rng.uniform(0.28, 0.38)) * height
    _trunk(scenery, thing, trunk, foot, 0.022 * height, 0.8 * height)
    if is_fir:
        share = rng.random(n) ** 0.6
        away = radius * (1 - share) * np.sqrt(rng.uniform(0.55, 1, n))
        turn = rng.uniform(0, 2 * np.pi, n)
        y = crown_low + share * (height - crown_low)
        places = np.stack([away * np.cos(turn), y, away * np.sin(turn)], 1)
        outward = np.stack([np.cos(turn), np.full(n, 0.35), np.sin(turn)], 1)
    else:
        # Some round clumps make a crown; leaves sit near their surfaces.
        n_clumps = int(rng.integers(6, 10))
        middle = np.array([0, (crown_low + height) / 2, 0])
        spread = np.array([0.62 * radius, 0.30 * (height - crown_low), 0.62 * radius])
        clumps = middle + spread * _directions(rng, n_clumps)
        size = rng.uniform(0.42, 0.62, n_clumps) * radius
        which = rng.integers(0, n_clumps, n)
        outward = _directions(rng, n)
        places = clumps[which] + outward * (size[which] * rng.uniform(0.75, 1.02, n))[:, None]
        low = 0.6 * crown_low
        places[:, 1] = np.clip(places[:, 1], low, height)
    side = (1.15 if is_fir else 1.3) * height / np.sqrt(n)
    scenery.add(thing, leaves, _leaves(rng, foot + places, outward, side))


def bush(
    scenery: Scenery,
    thing: str,
    rng: np.random.Generator,
    foot: F64,
    size: float,
    leaves: SceneryMaterial,
) -> None:
    """A bush as wide as it is high."""
    n = 110
    outward = _directions(rng, n)
    outward[:, 1] = np.abs(outward[:, 1])
    places = outward * size * np.array([0.55, 0.85, 0.55]) * rng.uniform(0.8, 1, (n, 1))
    scenery.add(thing, leaves, _leaves(rng, foot + places, outward, 0.22 * size))


def hedge(
    scenery: Scenery,
    thing: str,
    rng: np.random.Generator,
    ends: F64,
    height: float,
    leaves: SceneryMaterial,
) -> None:
    """A clipped hedge along the line ends (2, 3) on the ground."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    if length < 1.0:
        return
    along = along / length
    across = np.array([along[2], 0, -along[0]])
    half = 0.35
    axes = np.stack([along, [0, 1, 0], across], 1)
    low, high = np.array([0, 0, -half + 0.08]), np.array([length, height - 0.1, half - 0.08])
    scenery.add(thing, leaves, box_quads((low + high) / 2, (high - low) / 2) @ axes.T + ends[0])
    # Leaves on both sides and on top blur its edges.
    n = int(44 * length)
    s, v = rng.uniform(0, length, n), rng.uniform(-half, height + half, n)
    over = v > height
    y = np.where(over, height, np.maximum(v, 0))
    off = np.where(over, rng.uniform(-half, half, n), half * rng.choice([-1, 1], n))
    places = ends[0] + s[:, None] * along + off[:, None] * across
    places[:, 1] += y
    outward = np.where(over[:, None], [0.0, 1.0, 0.0], np.sign(off)[:, None] * across)
    scenery.add(thing, leaves, _leaves(rng, places, outward, 0.15))


def _trunk(
    scenery: Scenery, thing: str, look: SceneryMaterial, foot: F64, radius: float, top: float
) -> None:
    turn = np.linspace(0, 2 * np.pi, 7)
    ring = np.stack([np.cos(turn), np.zeros(7), np.sin(turn)], 1)
    low, high = foot + radius * ring, foot + 0.55 * radius * ring + [0, top, 0]
    scenery.add(thing, look, np.stack([low[:-1], low[1:], high[1:], high[:-1]], 1))


def _directions(rng: np.random.Generator, n: int) -> F64:
    d = rng.standard_normal((n, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def _leaves(rng: np.random.Generator, places: F64, outward: F64, side: float) -> F64:
    """Quads of about that side at places, each looking outward and somewhere else."""
    n = len(places)
    normal = outward + 0.8 * _directions(rng, n)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u = np.cross(normal, _directions(rng, n))
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
    v = np.cross(normal, u)
    size = side * rng.uniform(0.6, 1.3, (n, 1))
    # Kites rather than squares: their outline is no wall of tiles.
    a, b = u * size * 0.5, v * size * 0.5
    long_ = rng.uniform(1.0, 1.5, (n, 1))
    return np.stack([places - a * long_, places - b, places + a * long_, places + b], 1)
