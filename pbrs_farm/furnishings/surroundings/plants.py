"""Trees, bushes and hedges: sprays of leaves with holes. Effect: reads species.csv."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F32, F64, Bools
from pbrs_farm.core.record import Record, Spaced, read_csv
from pbrs_farm.dress.noise import noise
from pbrs_farm.furnishings.surroundings.scenery import Rgb, SceneryMaterial, Site, mottled
from pbrs_farm.geometry.solids import box_quads

_PX: Final = 128  # of the picture of a spray of leaves
_SHADE: Final = 0.66  # of the light that leaves inside a crown have, encoded


class Species(Record):
    """A kind of tree or bush: a row of species.csv."""

    name: str
    dark: Spaced[Rgb]  # leaves, linear
    light: Spaced[Rgb]
    leaf_px: Spaced[tuple[float, float]]  # length and width in the picture of a spray
    n_leaves: int  # in that picture
    radius: float  # of the crown over the tree's height
    crown_from: float  # its lower end over the tree's height
    bark_dark: Spaced[Rgb]
    bark_light: Spaced[Rgb]


SPECIES: Final = read_csv(Path(__file__).with_name("species.csv"), Species)
FIR: Final = 3
TREES: Final = 6  # of SPECIES: the others are shrubs
_N_TINTS: Final = 5
_HAZE: Final = np.array([0.34, 0.39, 0.45])  # colour of air, linear


class Leaves(NamedTuple):
    """The looks of a species, and of one plant of it."""

    species: Species
    spray: F32
    tints: tuple[Rgb, ...]  # of single plants, sRGB-encoded
    solid: SceneryMaterial  # without holes, for the dark behind leaves
    bark: SceneryMaterial
    tint: int = 0

    def of_plant(self, rng: np.random.Generator) -> Leaves:
        """The leaves of one plant: no two of a kind have quite the same green."""
        return self._replace(tint=int(rng.integers(len(self.tints))))

    @property
    def outer(self) -> SceneryMaterial:
        """Leaves in the light."""
        name = f"{self.species.name} leaves {self.tint}"
        return SceneryMaterial(name, self.tints[self.tint], self.spray)

    @property
    def inner(self) -> SceneryMaterial:
        """Leaves in the shade of others."""
        r, g, b = self.tints[self.tint]
        rgb = (_SHADE * r, _SHADE * g, _SHADE * b)
        return SceneryMaterial(f"{self.species.name} leaves in shade {self.tint}", rgb, self.spray)


def leaves_of(rng: np.random.Generator, number: int) -> Leaves:
    """The looks of one of SPECIES."""
    tree = SPECIES[number]
    spray, carpet = _spray(rng, tree), _spray(rng, tree, is_carpet=True)
    # From bluish to yellowish, from dark to light.
    warm, value = rng.normal(0, 0.06, _N_TINTS), rng.uniform(0.84, 0.99, _N_TINTS)
    tints = tuple(
        (min(float(v * (1 + w)), 1.0), float(v), min(float(v * (1 - w)), 1.0))
        for w, v in zip(np.clip(warm, -0.06, 0.06), value, strict=True)
    )
    solid = SceneryMaterial(f"{tree.name} dark", (0.86,) * 3, carpet, (0.6, 0.6))
    bark = mottled(rng, tree.bark_dark, tree.bark_light, size=64)
    return Leaves(
        tree,
        spray,
        tints,
        solid,
        SceneryMaterial(f"{tree.name} bark", (1.0,) * 3, bark, (0.5, 0.5)),
    )


def _spray(rng: np.random.Generator, species: Species, *, is_carpet: bool = False) -> F32:
    """(_PX, _PX, 4) linear and alpha: leaves about twigs, the later ones over the earlier.

    is_carpet: (_PX, _PX, 3), periodic and without holes, of twice as many leaves.
    """
    picture = np.zeros((_PX, _PX, 4), np.float32)
    picture[..., :3] = np.array(species.dark) * (0.35 if is_carpet else 1.0)
    long_, wide = species.leaf_px
    for _ in range(species.n_leaves * (2 if is_carpet else 1)):
        # Leaves fill a round spray and hang outwards from its middle.
        turn, away = rng.uniform(0, 2 * np.pi), 0.42 * _PX * np.sqrt(rng.random())
        tip = _PX / 2 + away * np.array([np.cos(turn), np.sin(turn)])
        tip = rng.uniform(0, _PX, 2) if is_carpet else tip
        angle = turn + rng.normal(0, 0.6)
        size = rng.uniform(0.75, 1.2)
        low = (tip - 0.6 * long_ * size).astype(int)
        high = (tip + 0.6 * long_ * size).astype(int) + 2
        if not is_carpet:
            low, high = np.maximum(low, 0), np.minimum(high, _PX)
        x, y = np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1])[:, None] + 0.5
        x, y, cos, sin = x - tip[0], y - tip[1], np.cos(angle), np.sin(angle)
        u = (x * cos + y * sin) / (0.5 * long_ * size)
        v = (-x * sin + y * cos) / (0.5 * wide * size)
        # Pointed at both ends, a light vein along the middle, one half in shade.
        inside = np.abs(v) < 1 - u * u
        share = rng.uniform(0.1, 1.0)
        rgb = np.array(species.dark) * (1 - share) + np.array(species.light) * share
        rgb = rgb * (1 + rng.normal(0, 0.09) * np.array([1.0, 0.0, -0.8]))
        u, v = u[inside], v[inside]
        shade = np.where(v > 0, 1.0, 0.78) * np.where(np.abs(v) < 0.13, 1.2, 1.0) * (1 - 0.15 * u)
        row, column = np.nonzero(inside)
        row, column = (row + low[1]) % _PX, (column + low[0]) % _PX
        picture[row, column, :3] = shade[:, None] * rgb
        picture[row, column, 3] = 1.0
    return picture[..., :3] if is_carpet else picture


def hazy(picture: F32, share: float) -> F32:
    """A linear picture with a share of its colour lost to the air before it."""
    veiled = picture.copy()
    veiled[..., :3] = (1 - share) * picture[..., :3] + share * _HAZE
    return veiled


def tree_line(rng: np.random.Generator) -> F32:
    """(96, 512, 4) linear and alpha: a row of trees far off, without an end; the lowest row is their foot."""
    high, wide = 96, 512
    picture = np.zeros((high, wide, 4), np.float32)
    grain = 1 + 0.35 * noise(rng, (high, wide), slope=0.7)
    edge = 0.12 * noise(rng, (1, wide), slope=1.0)[0]
    # Far ones first; lower ones cover them.
    for top in np.sort(rng.uniform(2, 55, 110)):
        species = SPECIES[int(rng.choice(TREES - 2))]
        half, column = int(rng.uniform(14, 34)), int(rng.integers(0, wide))
        columns = np.arange(column - half, column + half + 1)
        u = (columns - column) / half
        columns = columns % wide
        v = (np.arange(int(top), high)[:, None] + 0.5 - top) / (high - top)
        inside = np.abs(u) < np.sqrt(np.clip(2.2 * v, 0, 1)) * (1 + edge[columns])
        light = np.clip(1.0 - 0.9 * v - 0.3 * u, 0.15, 1.2) * grain[int(top) :, columns]
        tone = np.clip(0.25 + 0.5 * light, 0, 1)[..., None]
        rgb = np.array(species.dark) * (1 - tone) + np.array(species.light) * tone
        rgb = rgb * rng.uniform(0.75, 1.15) * (1 + rng.normal(0, 0.07) * np.array([1.0, 0.0, -1.0]))
        patch = picture[int(top) :, columns]
        patch[inside, :3], patch[inside, 3] = rgb[inside], 1.0
        picture[int(top) :, columns] = patch
    picture[-12:, :, 3] = 1.0
    picture[..., :3] = np.where(picture[..., 3:] > 0, picture[..., :3], 0.03)
    return picture


def tree(site: Site, foot: F64, height: float, leaves: Leaves, *, n: int = 340) -> None:
    """A tree on foot (3,): a trunk, branches, and n sprays of leaves about them, of a fir in a cone."""
    rng = site.rng
    leaves, species = leaves.of_plant(rng), leaves.species
    crown_low = species.crown_from * height * rng.uniform(0.9, 1.1)
    radius = species.radius * rng.uniform(0.88, 1.12) * height
    if species.name == "fir":
        _limb(site, leaves.bark, foot, foot + _up(0.92 * height), 0.02 * height)
        share = rng.random(n) ** 1.7
        away = radius * (1 - share) * np.sqrt(rng.uniform(0.4, 1, n))
        turn = rng.uniform(0, 2 * np.pi, n)
        y = crown_low + share * (height - crown_low) - 0.12 * away
        places = np.stack([away * np.cos(turn), y, away * np.sin(turn)], 1)
        outward = np.stack([np.cos(turn), np.full(n, 0.7), np.sin(turn)], 1)
        depth = away / np.maximum(radius * (1 - share), 1e-6)
        _add_sprays(site, leaves, foot + places, outward, 1.75 * height / np.sqrt(n), depth > 0.72)
        return
    # Limbs leave a bent trunk and fork; clumps of leaves sit at the ends of their twigs.
    middle = np.array([0, crown_low + 0.52 * (height - crown_low), 0])
    lean = rng.normal(0, 0.02 * height, (3, 3)) * [1, 0, 1]
    trunk = np.cumsum([[0, 0, 0], *lean], 0) + np.outer(
        [0, crown_low, 0.55 * height, 0.85 * height], [0, 1, 0]
    )
    for k, r in enumerate((0.024, 0.019, 0.012)):
        _limb(site, leaves.bark, foot + trunk[k], foot + trunk[k + 1], r * height, end=0.75)
    n_limbs = int(rng.integers(6, 9))
    ends, starts = [], rng.uniform(0.05, 0.75, n_limbs)
    turns = 2 * np.pi * (np.arange(n_limbs) * 0.382 + rng.normal(0, 0.05, n_limbs))
    for start, turn in zip(starts, turns, strict=True):
        y = crown_low + start * (height - crown_low)
        root = np.array([np.interp(y, trunk[:, 1], trunk[:, k]) for k in range(3)])
        reach = radius * rng.uniform(0.45, 0.62) * (1 - 0.45 * start)
        way = np.array([np.cos(turn), rng.uniform(0.35, 0.8), np.sin(turn)])
        elbow = root + reach * way
        _limb(site, leaves.bark, foot + root, foot + elbow, 0.009 * height, n=5)
        for _ in range(2):
            twig = elbow + 0.75 * reach * (way + 0.75 * _directions(rng, 1)[0]) * [1, 0.8, 1]
            _limb(site, leaves.bark, foot + elbow, foot + twig, 0.0045 * height, n=4)
            ends.append(twig)
        ends.append(elbow + _up(0.15 * reach))
    clumps = np.array([*ends, trunk[3]])
    n_clumps = len(clumps)
    size = rng.uniform(0.3, 0.48, n_clumps) * radius
    which = rng.choice(n_clumps, n, p=size**2 / (size**2).sum())
    outward = _directions(rng, n)
    places = clumps[which] + outward * (size[which] * rng.uniform(0.3, 1.1, n))[:, None] * [
        1,
        0.7,
        1,
    ]
    places[:, 1] = np.maximum(places[:, 1], 0.85 * crown_low)
    # Leaves deep in the crown or below others are in shade.
    from_middle = (places - middle) / np.array([radius, 0.55 * (height - crown_low), radius])
    is_outer = np.linalg.norm(from_middle, axis=1) + 0.35 * from_middle[:, 1] > 0.62
    looks = outward + 0.6 * from_middle
    _add_sprays(site, leaves, foot + places, looks, 1.9 * height / np.sqrt(n), is_outer)


def bush(site: Site, foot: F64, size: float, leaves: Leaves) -> None:
    """A bush with equal width and height."""
    n, leaves = 130, leaves.of_plant(site.rng)
    outward = _directions(site.rng, n)
    outward[:, 1] = np.abs(outward[:, 1])
    deep = site.rng.uniform(0.45, 1, n)
    places = outward * size * np.array([0.55, 0.85, 0.55]) * deep[:, None]
    _add_sprays(site, leaves, foot + places, outward, 0.3 * size, deep > 0.72)


def hedge(site: Site, ends: F64, height: float, leaves: Leaves) -> None:
    """A clipped hedge along the line ends (2, 3) on the ground."""
    rng = site.rng
    along = ends[1] - ends[0]
    length, leaves = float(np.linalg.norm(along)), leaves.of_plant(rng)
    if length < 1.0:
        return
    along = along / length
    across = np.array([along[2], 0, -along[0]])
    half = 0.35 * rng.uniform(0.8, 1.3)
    axes = np.stack([along, [0, 1, 0], across], 1)
    low, high = np.array([0, 0, -half + 0.1]), np.array([length, height - 0.12, half - 0.1])
    site.add(leaves.solid, box_quads((low + high) / 2, (high - low) / 2) @ axes.T + ends[0])
    # Sprays on both sides and on top hide it.
    n = int(60 * length)
    s, v = rng.uniform(0, length, n), rng.uniform(-half, height + half, n)
    over = v > height
    y = np.where(over, height, np.maximum(v, 0))
    off = np.where(over, rng.uniform(-half, half, n), half * rng.choice([-1, 1], n))
    places = ends[0] + s[:, None] * along + off[:, None] * across
    places[:, 1] += y
    outward = np.where(over[:, None], [0.0, 1.0, 0.0], np.sign(off)[:, None] * across)
    _add_sprays(site, leaves, places, outward, 0.22, rng.random(n) < 0.75)


def _limb(
    site: Site,
    look: SceneryMaterial,
    start: F64,
    tip: F64,
    radius: float,
    *,
    n: int = 7,
    end: float = 0.45,
) -> None:
    """A trunk or branch that tapers to a share of its radius."""
    axis = tip - start
    length = float(np.linalg.norm(axis))
    if length < 1e-3:
        return
    axis = axis / length
    u = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.7 else [0, 0, 1.0])
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    turn = np.linspace(0, 2 * np.pi, n + 1)[:, None]
    ring = np.cos(turn) * u + np.sin(turn) * v
    low, high = start + radius * ring, tip + end * radius * ring
    site.add(look, np.stack([low[:-1], low[1:], high[1:], high[:-1]], 1))


def _up(y: float) -> F64:
    return np.array([0.0, y, 0.0])


def _directions(rng: np.random.Generator, n: int) -> F64:
    d = rng.standard_normal((n, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def _add_sprays(
    site: Site, leaves: Leaves, places: F64, outward: F64, side: float, is_outer: Bools
) -> None:
    """Squares of about that side at places (N, 3), each looking outward and somewhere else."""
    n = len(places)
    normal = outward / np.linalg.norm(outward, axis=1, keepdims=True) + 0.55 * _directions(
        site.rng, n
    )
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u = np.cross(normal, _directions(site.rng, n))
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
    v = np.cross(normal, u)
    half = 0.5 * side * site.rng.uniform(0.75, 1.25, (n, 1))
    a, b = u * half, v * half
    quads = np.stack([places - a - b, places + a - b, places + a + b, places - a + b], 1)
    uvs = np.broadcast_to(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), (n, 4, 2))
    for look, chosen in ((leaves.outer, is_outer), (leaves.inner, ~is_outer)):
        site.add(look, quads[chosen], uvs[chosen])
