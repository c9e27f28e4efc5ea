"""Trees, bushes and hedges: sprays of leaves with holes between them on branches; no effects."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F32, F64, Bools
from pbrs_farm.dress.noise import noise
from pbrs_farm.furnishings.surroundings.scenery import Rgb, Scenery, SceneryMaterial, mottled
from pbrs_farm.geometry.solids import box_quads

_PX: Final = 128  # of the picture of a spray of leaves
_SHADE: Final = 0.5  # of the light that leaves inside a crown have, encoded


class Species(NamedTuple):
    """A kind of tree or bush."""

    name: str
    dark: Rgb  # leaves, linear
    light: Rgb
    leaf_px: tuple[float, float]  # length and width in the picture of a spray
    n_leaves: int  # in that picture
    radius: float  # of the crown over the tree's height
    crown_from: float  # its lower end over the tree's height
    bark: tuple[Rgb, Rgb]


_BROWN_BARK: Final = ((0.03, 0.022, 0.015), (0.12, 0.09, 0.065))
# fmt: off
SPECIES: Final[tuple[Species, ...]] = (
    Species("lime", (0.022, 0.05, 0.010), (0.11, 0.19, 0.035), (21, 15), 62, 0.32, 0.30, _BROWN_BARK),
    Species("oak", (0.016, 0.036, 0.010), (0.065, 0.12, 0.030), (20, 10), 78, 0.38, 0.26, _BROWN_BARK),
    Species("birch", (0.03, 0.05, 0.010), (0.15, 0.20, 0.05), (14, 9), 95, 0.22, 0.24, ((0.10, 0.09, 0.08), (0.55, 0.53, 0.49))),
    Species("fir", (0.008, 0.022, 0.012), (0.035, 0.075, 0.038), (30, 2.6), 150, 0.2, 0.10, _BROWN_BARK),
    Species("copper beech", (0.03, 0.010, 0.008), (0.12, 0.045, 0.03), (18, 11), 74, 0.34, 0.24, _BROWN_BARK),
    Species("plane", (0.03, 0.055, 0.018), (0.13, 0.19, 0.06), (24, 20), 42, 0.36, 0.34, ((0.10, 0.09, 0.06), (0.30, 0.28, 0.21))),
)
# fmt: on
FIR: Final = 3


class Leaves(NamedTuple):
    """The looks of a species."""

    species: Species
    outer: SceneryMaterial
    inner: SceneryMaterial  # the same in the shade of the others
    solid: SceneryMaterial  # without holes, for the dark behind leaves
    bark: SceneryMaterial


def leaves_of(rng: np.random.Generator, number: int) -> Leaves:
    """The looks of one of SPECIES."""
    tree = SPECIES[number]
    spray = _spray(rng, tree)
    r, g, b = tree.dark
    dark = (0.3 * r, 0.3 * g, 0.3 * b)
    return Leaves(
        tree,
        SceneryMaterial(f"{tree.name} leaves", picture=spray),
        SceneryMaterial(f"{tree.name} leaves in shade", rgb=(_SHADE,) * 3, picture=spray),
        SceneryMaterial(
            f"{tree.name} dark", picture=mottled(rng, dark, tree.dark, size=64), size_m=(0.7, 0.7)
        ),
        SceneryMaterial(
            f"{tree.name} bark", picture=mottled(rng, *tree.bark, size=64), size_m=(0.5, 0.5)
        ),
    )


def _spray(rng: np.random.Generator, species: Species) -> F32:
    """(_PX, _PX, 4) linear and alpha: leaves about twigs, the later ones over the earlier."""
    picture = np.zeros((_PX, _PX, 4), np.float32)
    picture[..., :3] = species.dark
    long_, wide = species.leaf_px
    for _ in range(species.n_leaves):
        # Leaves fill a round spray and hang outwards from its middle.
        turn, away = rng.uniform(0, 2 * np.pi), 0.42 * _PX * np.sqrt(rng.random())
        tip = _PX / 2 + away * np.array([np.cos(turn), np.sin(turn)])
        angle = turn + rng.normal(0, 0.6)
        size = rng.uniform(0.75, 1.2)
        low = np.maximum((tip - 0.6 * long_ * size).astype(int), 0)
        high = np.minimum((tip + 0.6 * long_ * size).astype(int) + 2, _PX)
        x, y = np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1])[:, None] + 0.5
        u = ((x - tip[0]) * np.cos(angle) + (y - tip[1]) * np.sin(angle)) / (0.5 * long_ * size)
        v = (-(x - tip[0]) * np.sin(angle) + (y - tip[1]) * np.cos(angle)) / (0.5 * wide * size)
        # Pointed at both ends, a light vein along the middle, one half in shade.
        inside = np.abs(v) < 1 - u * u
        share = rng.uniform(0.15, 1.0)
        rgb = np.array(species.dark) * (1 - share) + np.array(species.light) * share
        shade = np.where(v > 0, 1.0, 0.78) * np.where(np.abs(v) < 0.13, 1.25, 1.0) * (1 - 0.15 * u)
        patch = picture[low[1] : high[1], low[0] : high[0]]
        patch[inside, :3] = shade[inside][:, None] * rgb
        patch[inside, 3] = 1.0
    return picture


def tree_line(rng: np.random.Generator) -> F32:
    """(96, 512, 4) linear and alpha: a row of trees far off, without an end; the lowest row is their foot."""
    high, wide = 96, 512
    picture = np.zeros((high, wide, 4), np.float32)
    grain = 1 + 0.35 * noise(rng, (high, wide), slope=0.7)
    edge = 0.12 * noise(rng, (1, wide), slope=1.0)[0]
    # Far ones first; lower ones cover them.
    for top in np.sort(rng.uniform(2, 55, 110)):
        species = SPECIES[int(rng.choice(len(SPECIES) - 2))]
        half, column = int(rng.uniform(14, 34)), int(rng.integers(0, wide))
        columns = np.arange(column - half, column + half + 1)
        u = (columns - column) / half
        columns = columns % wide
        v = (np.arange(int(top), high)[:, None] + 0.5 - top) / (high - top)
        inside = np.abs(u) < np.sqrt(np.clip(2.2 * v, 0, 1)) * (1 + edge[columns])
        light = np.clip(1.0 - 0.9 * v - 0.3 * u, 0.15, 1.2) * grain[int(top) :, columns]
        tone = np.clip(0.25 + 0.5 * light, 0, 1)[..., None]
        rgb = np.array(species.dark) * (1 - tone) + np.array(species.light) * tone
        patch = picture[int(top) :, columns]
        patch[inside, :3], patch[inside, 3] = rgb[inside], 1.0
        picture[int(top) :, columns] = patch
    picture[-12:, :, 3] = 1.0
    picture[..., :3] = np.where(picture[..., 3:] > 0, picture[..., :3], 0.03)
    return picture


def tree(
    scenery: Scenery,
    thing: str,
    rng: np.random.Generator,
    foot: F64,
    height: float,
    leaves: Leaves,
    *,
    n: int = 340,
) -> None:
    """A tree on foot (3,): a trunk, branches, and n sprays of leaves about them, of a fir in a cone."""
    species = leaves.species
    crown_low = species.crown_from * height * rng.uniform(0.9, 1.1)
    radius = species.radius * rng.uniform(0.88, 1.12) * height
    if species.name == "fir":
        _limb(scenery, thing, leaves.bark, foot, foot + _up(0.92 * height), 0.02 * height)
        share = rng.random(n) ** 1.7
        away = radius * (1 - share) * np.sqrt(rng.uniform(0.4, 1, n))
        turn = rng.uniform(0, 2 * np.pi, n)
        y = crown_low + share * (height - crown_low) - 0.12 * away
        places = np.stack([away * np.cos(turn), y, away * np.sin(turn)], 1)
        outward = np.stack([np.cos(turn), np.full(n, 0.7), np.sin(turn)], 1)
        depth = away / np.maximum(radius * (1 - share), 1e-6)
        _add_sprays(
            scenery,
            thing,
            rng,
            leaves,
            foot + places,
            outward,
            1.75 * height / np.sqrt(n),
            depth > 0.72,
        )
        return
    # Round clumps make a crown, each at the end of a branch; leaves sit near their surfaces.
    n_clumps = int(rng.integers(9, 14))
    middle = np.array([0, crown_low + 0.52 * (height - crown_low), 0])
    spread = np.array([0.66 * radius, 0.36 * (height - crown_low), 0.66 * radius])
    clumps = middle + spread * _directions(rng, n_clumps) * rng.uniform(0.75, 1.05, (n_clumps, 1))
    size = rng.uniform(0.38, 0.56, n_clumps) * radius
    fork = foot + _up(crown_low + 0.12 * (height - crown_low))
    _limb(scenery, thing, leaves.bark, foot, fork, 0.021 * height)
    _limb(scenery, thing, leaves.bark, fork, foot + _up(0.82 * height), 0.013 * height)
    for end in clumps:
        start = fork + _up(rng.uniform(0, 0.35) * (height - crown_low))
        _limb(scenery, thing, leaves.bark, start, foot + end, 0.007 * height, n=4)
    which = rng.choice(n_clumps, n, p=size**2 / (size**2).sum())
    outward = _directions(rng, n)
    places = clumps[which] + outward * (size[which] * rng.uniform(0.55, 1.05, n))[:, None]
    places[:, 1] = np.maximum(places[:, 1], 0.85 * crown_low)
    # Leaves deep in the crown or below others are in shade.
    from_middle = (places - middle) / np.array([radius, 0.55 * (height - crown_low), radius])
    is_outer = np.linalg.norm(from_middle, axis=1) + 0.35 * from_middle[:, 1] > 0.62
    looks = outward + 0.6 * from_middle
    _add_sprays(
        scenery, thing, rng, leaves, foot + places, looks, 1.85 * height / np.sqrt(n), is_outer
    )


def bush(
    scenery: Scenery, thing: str, rng: np.random.Generator, foot: F64, size: float, leaves: Leaves
) -> None:
    """A bush with equal width and height."""
    n = 90
    outward = _directions(rng, n)
    outward[:, 1] = np.abs(outward[:, 1])
    deep = rng.uniform(0.45, 1, n)
    places = outward * size * np.array([0.55, 0.85, 0.55]) * deep[:, None]
    _add_sprays(scenery, thing, rng, leaves, foot + places, outward, 0.36 * size, deep > 0.72)


def hedge(
    scenery: Scenery, thing: str, rng: np.random.Generator, ends: F64, height: float, leaves: Leaves
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
    low, high = np.array([0, 0, -half + 0.1]), np.array([length, height - 0.12, half - 0.1])
    scenery.add(
        thing, leaves.solid, box_quads((low + high) / 2, (high - low) / 2) @ axes.T + ends[0]
    )
    # Sprays on both sides and on top hide it.
    n = int(40 * length)
    s, v = rng.uniform(0, length, n), rng.uniform(-half, height + half, n)
    over = v > height
    y = np.where(over, height, np.maximum(v, 0))
    off = np.where(over, rng.uniform(-half, half, n), half * rng.choice([-1, 1], n))
    places = ends[0] + s[:, None] * along + off[:, None] * across
    places[:, 1] += y
    outward = np.where(over[:, None], [0.0, 1.0, 0.0], np.sign(off)[:, None] * across)
    _add_sprays(scenery, thing, rng, leaves, places, outward, 0.3, rng.random(n) < 0.75)


def _limb(
    scenery: Scenery,
    thing: str,
    look: SceneryMaterial,
    start: F64,
    end: F64,
    radius: float,
    *,
    n: int = 7,
) -> None:
    """A trunk or branch that tapers to its end."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    if length < 1e-3:
        return
    axis = axis / length
    u = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.7 else [0, 0, 1.0])
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    turn = np.linspace(0, 2 * np.pi, n + 1)[:, None]
    ring = np.cos(turn) * u + np.sin(turn) * v
    low, high = start + radius * ring, end + 0.45 * radius * ring
    scenery.add(thing, look, np.stack([low[:-1], low[1:], high[1:], high[:-1]], 1))


def _up(y: float) -> F64:
    return np.array([0.0, y, 0.0])


def _directions(rng: np.random.Generator, n: int) -> F64:
    d = rng.standard_normal((n, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def _add_sprays(
    scenery: Scenery,
    thing: str,
    rng: np.random.Generator,
    leaves: Leaves,
    places: F64,
    outward: F64,
    side: float,
    is_outer: Bools,
) -> None:
    """Squares of about that side at places (N, 3), each looking outward and somewhere else."""
    n = len(places)
    normal = outward / np.linalg.norm(outward, axis=1, keepdims=True) + 0.55 * _directions(rng, n)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u = np.cross(normal, _directions(rng, n))
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
    v = np.cross(normal, u)
    half = 0.5 * side * rng.uniform(0.75, 1.25, (n, 1))
    a, b = u * half, v * half
    quads = np.stack([places - a - b, places + a - b, places + a + b, places - a + b], 1)
    uvs = np.broadcast_to(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), (n, 4, 2))
    for look, chosen in ((leaves.outer, is_outer), (leaves.inner, ~is_outer)):
        scenery.add(thing, look, quads[chosen], uvs[chosen])
