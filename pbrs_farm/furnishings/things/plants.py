"""Potted plants of the generated catalogue, for floors and surfaces; described in plants.csv. Effect: reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy import cos, pi, sin

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.frames import rotation_y, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.core.record import Record, Several, read_csv
from pbrs_farm.dress.models import transformed
from pbrs_farm.dress.style import mix, shade
from pbrs_farm.dress.thing_materials import EARTH, WICKER, plain
from pbrs_farm.furnishings.things.cloth import sheet
from pbrs_farm.furnishings.things.maker import Family, Maker, Size
from pbrs_farm.geometry.bodies import stretched
from pbrs_farm.geometry.outlines import Triple, bent, fluted, polar, rect, rings, scaled

# fmt: off
_GREENS: Final = ((0.25, 0.43, 0.17), (0.32, 0.5, 0.22), (0.19, 0.35, 0.16), (0.41, 0.53, 0.26),
    (0.29, 0.42, 0.28))
_BARK: Final = plain("bark", (0.36, 0.27, 0.19), 0.9)
_LEAF_M: Final = 0.0012  # thickness

Grow = Callable[[Maker, float, float, float], None]
"""Adds a plant about the axis: half its width, the height of its earth, that of its top."""


def leaf(long: float, wide: float, *, droop: float = 0.3, fold: float = 0.25, tip: float = 0.75,
    rows: int = 6) -> F64:
    """A grid (rows, 3, 3) of a leaf from the origin along +x, its face upwards.

    droop: how far its tip sinks, and fold: how far its edges rise, by its length and width. tip: where
    along it is widest, 0..1, turned round: near 1 it is widest at its foot.
    """
    t = np.linspace(0.02, 1.0, rows)
    # Narrow at both ends; the power puts the widest place.
    breadth = np.sin(pi * t**tip) ** 0.8 * 0.97 + 0.03
    x = long * t * (1 - 0.15 * droop * t)
    y = long * (0.12 * t - droop * t**2)
    side = np.array([-0.5, 0.0, 0.5])
    grid = np.empty((rows, 3, 3))
    grid[..., 0] = x[:, None]
    grid[..., 2] = wide * breadth[:, None] * side[None]
    grid[..., 1] = y[:, None] + fold * np.abs(grid[..., 2])
    return grid


def _add_leaf(m: Maker, at: Triple, around: float, up: float, grid: F64, of: Material) -> None:
    """Put a leaf so that it leaves a stem at a place, turned about it, lifted by an angle."""
    m.add(sheet(grid, _LEAF_M), turn=rotation_y(around) @ rotation_z(up), at=at, of=of)


def pot(m: Maker, w: float, d: float, tall: float) -> None:
    """A pot w by d and its earth, one of eight forms."""
    r = w / 2
    material = m.pick(m.china(), plain("terracotta", (0.66, 0.38, 0.26), 0.85), m.coloured("pot",
        0.6), plain("stone pot", (0.55, 0.54, 0.51), 0.85), WICKER, m.metal, m.timber)
    rim, n = max(0.008, 0.05 * r), 18

    def turned(profile: Sequence[tuple[float, float]]) -> None:
        inside = [(x - rim, y) for x, y in (profile[-1], (profile[-1][0], 0.93 * tall))]
        outside = scaled(1.0, 1.0, profile)
        m.revolve([(0.0, 0.0), *outside, *inside, (0.0, 0.93 * tall)], n=n, of=material)

    match m.integers(0, 8):
        case 0:  # as flowers are sold in
            turned([(0.68 * r, 0.0), (0.92 * r, 0.78 * tall), (r, 0.79 * tall), (r, tall)])
        case 1:  # straight
            turned([(0.97 * r, 0.0), (r, 0.012), (r, tall)])
        case 2:  # a belly
            turned([(0.5 * r, 0.0), (0.85 * r, 0.15 * tall), (r, 0.5 * tall),
                (0.88 * r, 0.85 * tall), (0.86 * r, tall)])
        case 3:  # a bowl
            turned([(0.4 * r, 0.0), (0.75 * r, 0.3 * tall), (0.95 * r, 0.7 * tall), (r, tall)])
        case 4:  # on a foot
            turned([(0.6 * r, 0.0), (0.6 * r, 0.06 * tall), (0.35 * r, 0.14 * tall),
                (0.8 * r, 0.4 * tall), (r, tall)])
        case 5:  # square
            m.loft(rings(rect, [(1.5 * r, 1.5 * d / 2, 0.01, 0.0), (w, d, 0.012, tall),
                (w - 2 * rim, d - 2 * rim, 0.01, tall), (w - 2.4 * rim, d - 2.4 * rim, 0.01,
                0.93 * tall)], n=2), of=material)
        case 6:  # on three legs
            turned([(0.85 * r, 0.3 * tall), (r, 0.34 * tall), (r, tall)])
            for k in range(3):
                a = 2 * pi * k / 3
                m.tube([polar(0.95 * r, 0.004, a), polar(0.6 * r, 0.36 * tall, a)], 0.012,
                    of=m.timber)
        case 7:  # with grooves
            turned([(0.9 * r, 0.0), *((r * (1.0 if k % 2 else 0.95),
                tall * (0.06 + 0.1 * k)) for k in range(9)), (r, tall)])
    m.cylinder(0.8 * r, 0.935 * tall, 0.97 * tall, n=18, of=EARTH)


def _greens(m: Maker) -> tuple[Material, Material]:
    """Two greens of one plant: of old leaves and of young ones."""
    colour = m.pick(*_GREENS)
    old = plain("leaf", shade(colour, m.uniform(0.85, 1.1)), 0.55)
    return old, plain("young leaf", mix(colour, (0.5, 0.6, 0.28), m.uniform(0.15, 0.4)), 0.55)


def _of_leaves(m: Maker, foot: float, n: int, each: Callable[[int],
    tuple[float, float, F64]]) -> None:
    """Leaves from one point: (turn about the stem, lift, grid) of each."""
    old, young = _greens(m)
    for k in range(n):
        around, up, grid = each(k)
        _add_leaf(m, (0.0, foot, 0.0), around, up, grid, young if k % 4 == 3 else old)


def _turn(k: int) -> float:
    # Leaves of a stem follow each other by the golden angle.
    return 2.39996 * k


def swords(m: Maker, r: float, foot: float, h: float) -> None:
    """Upright blades: mother-in-law's tongue."""
    tall = h - foot
    _of_leaves(m, foot, m.integers(9, 16), lambda k: (_turn(k), m.uniform(1.2, 1.5),
        leaf(tall * (1.0 if k == 0 else m.uniform(0.55, 1.0)), 0.008 + 0.085 * tall, droop=-0.02,
        fold=0.45, tip=0.45, rows=5)))


def fountain(m: Maker, r: float, foot: float, h: float) -> None:
    """Long narrow leaves that bend over: a spider plant, a yucca without a stem."""
    long = 1.25 * max(r, 0.75 * (h - foot))
    _of_leaves(m, foot, m.integers(20, 30), lambda k: (_turn(k), m.uniform(0.7, 1.35),
        leaf(long * m.uniform(0.75, 1.0), 0.045 * long + 0.012, droop=m.uniform(0.35, 0.75),
        fold=0.4, tip=0.6, rows=7)))


def broad(m: Maker, r: float, foot: float, h: float) -> None:
    """Broad leaves on stalks: a peace lily, a monstera's outline."""
    old, young = _greens(m)
    for k in range(m.integers(14, 21)):
        a, out = _turn(k), r * m.uniform(0.15, 0.5)
        y = foot + (h - foot) * m.uniform(0.25, 0.9)
        top = polar((out, -out), y, a)
        m.tube(bent([(0.0, foot - 0.02, 0.0), (0.25 * top[0], 0.6 * y + 0.4 * foot, 0.25 * top[2]),
            top], 0.08, n=2), 0.004, n=4, of=old)
        _add_leaf(m, top, a, m.uniform(-0.2, 0.4), leaf(r * m.uniform(0.55, 0.8),
            r * m.uniform(0.34, 0.48), droop=0.4, rows=5), young if k % 4 == 3 else old)


def palm(m: Maker, r: float, foot: float, h: float) -> None:
    """Feathers on bent stalks: an areca palm."""
    old, young = _greens(m)
    t = np.linspace(0.0, 1.0, 9)[:, None]
    for k in range(m.integers(6, 8)):
        a, out, y = _turn(k), r * m.uniform(0.6, 0.95), foot + (h - foot) * m.uniform(0.6, 1.0)
        # A curve that rises beside the stem and hangs over at its end.
        ends = np.array([(0.0, foot - 0.02, 0.0), (0.2 * out, 1.15 * y, 0.0),
            (out, y - 0.3 * (y - foot), 0.0)])
        curve = (1 - t) ** 2 * ends[0] + 2 * t * (1 - t) * ends[1] + t**2 * ends[2]
        way = [(float(x * cos(a)), float(up), float(-x * sin(a))) for x, up, _z in curve]
        m.tube(way, 0.005, n=4, end=0.002, of=old)
        for j, p in enumerate(way[3:]):
            length = r * (0.55 - 0.05 * j)
            for side in (-1.0, 1.0):
                _add_leaf(m, p, a + side * 0.85, m.uniform(-0.35, 0.1),
                    leaf(length, 0.12 * length + 0.004, droop=0.3, tip=0.7, rows=3),
                    young if j % 3 == 2 else old)


def _trunk(m: Maker, foot: float, top: float, thick: float, lean: float) -> list[Triple]:
    """A stem with a slight bend, and its points."""
    a = m.uniform(0.0, 2 * pi)
    x, z = lean * cos(a), lean * sin(a)
    way = bent([(0.0, foot - 0.03, 0.0), (x, 0.5 * (foot + top), z), (0.4 * x, top, 0.4 * z)],
        0.2 * (top - foot), n=3)
    m.tube(way, thick, end=0.7 * thick, of=_BARK)
    return way


def tree(m: Maker, r: float, foot: float, h: float) -> None:
    """A small tree with a crown of single leaves: a ficus, a rubber plant, an olive."""
    old, young = _greens(m)
    low = foot + (h - foot) * m.uniform(0.35, 0.5)
    way = _trunk(m, foot, h - 0.35 * (h - low), 0.012 + 0.006 * h, 0.05)
    top = np.asarray(way[-1])
    long, n = r * m.pick(0.4, 0.5, 0.6), m.integers(46, 62)
    for k in range(n):
        # Leaves lie on a ball round the top of the stem.
        t = (k + 0.5) / n
        y, ring = low + (h - low) * t, np.sin(pi * min(0.12 + 0.86 * t, 1.0)) ** 0.7
        a, out = _turn(k), (r - 0.7 * long) * ring * m.uniform(0.6, 1.0)
        tip = (float(top[0] * 0.3 + out * cos(a)), float(min(y, h - 0.12 * long)),
            float(top[2] * 0.3 - out * sin(a)))
        if k % 3 == 0:
            m.tube([(0.5 * way[-1][0], max(low - 0.02, foot), 0.5 * way[-1][2]), tip], 0.004, n=4,
                of=_BARK)
        _add_leaf(m, tip, a + m.uniform(-0.5, 0.5), m.uniform(-0.4, 0.3),
            leaf(long, long * m.pick(0.42, 0.58), droop=0.25, rows=3), young if t > 0.8 else old)


def yucca(m: Maker, r: float, foot: float, h: float) -> None:
    """One to three bare stems, each with a tuft of narrow leaves: a yucca, a dracaena."""
    old, young = _greens(m)
    n_stems = m.pick(1, 2, 2, 3)
    for j in range(n_stems):
        top = foot + (h - foot) * ((0.72, 0.5, 0.34)[j])
        a = 2.1 * j
        x, z = (0.0, 0.0) if n_stems == 1 else (0.22 * r * cos(a), 0.22 * r * sin(a))
        m.tube([(x, foot - 0.03, z), (1.3 * x, top, 1.3 * z)], 0.02 + 0.004 * h, n=9, end=0.018,
            of=_BARK)
        long = min(r - 1.3 * abs(x), h - top) * 1.08
        for k in range(m.integers(18, 26)):
            _add_leaf(m, (1.3 * x, top - 0.004 * (k % 6), 1.3 * z), _turn(k), m.uniform(0.1, 1.35),
                leaf(long * m.uniform(0.8, 1.0), 0.07 * long + 0.006, droop=m.uniform(0.2, 0.5),
                fold=0.5, tip=0.5, rows=3), young if k % 5 == 4 else old)


def cactus(m: Maker, r: float, foot: float, h: float) -> None:
    """Ribbed columns, one or a few."""
    green = plain("cactus", m.pick((0.26, 0.4, 0.26), (0.3, 0.44, 0.24), (0.2, 0.35, 0.27)), 0.7)
    ribs, tall = m.integers(8, 13), h - foot + 0.02
    for k in range(m.integers(1, 4)):
        q, a, y = (0.32 if k else 0.42) * r, 2.2 * k + 0.4, tall * (1.0, 0.68, 0.5)[k]
        x, z = (0.0, 0.0) if k == 0 else (0.58 * r * cos(a), 0.58 * r * sin(a))
        column = rings(fluted, [(1.7 * q, ribs, 0.2, 0.0), (2 * q, ribs, 0.2, 0.25 * y),
            (1.96 * q, ribs, 0.2, y - 0.7 * q), (1.5 * q, ribs, 0.2, y - 0.28 * q),
            (0.6 * q, ribs, 0.2, y)])
        m.loft(column, sharp=70.0, at=(x, foot - 0.02, z), of=green)


def rosette(m: Maker, r: float, foot: float, h: float) -> None:
    """Thick leaves in a rosette: an aloe, an agave, an echeveria."""
    old, young = _greens(m)
    tall = h - foot
    long = max(0.95 * r, tall)
    for k in range(m.integers(18, 28)):
        t = k / 28
        grid = leaf(long * (0.75 + 0.25 * t) * m.uniform(0.9, 1.0), 0.16 * long, droop=-0.12,
            fold=0.5, tip=0.4, rows=5)
        m.add(sheet(grid, 0.03 * long), turn=rotation_y(_turn(k)) @ rotation_z(0.15 + 1.2 * t),
            at=(0.0, foot + 0.004, 0.0), of=young if t > 0.6 else old)


def flowers(m: Maker, r: float, foot: float, h: float) -> None:
    """Stems with a blossom each over leaves: an orchid, a tulip, a daisy."""
    old, young = _greens(m)
    petal = plain("petal", m.pick((0.9, 0.88, 0.86), (0.8, 0.3, 0.45), (0.85, 0.65, 0.2),
        (0.6, 0.35, 0.65), (0.8, 0.2, 0.16)), 0.6)
    for k in range(m.integers(6, 10)):
        _add_leaf(m, (0.0, foot, 0.0), _turn(k), m.uniform(0.3, 1.0),
            leaf(0.8 * r, 0.2 * r, droop=0.4, rows=5), old)
    kind, n_petals = m.pick("cup", "star", "star"), m.integers(5, 9)
    for k in range(m.integers(3, 7)):
        a, out = 1.3 + _turn(k), r * m.uniform(0.2, 0.7)
        top = (out * cos(a), foot + (h - foot) * (0.94 if k == 0 else m.uniform(0.6, 0.9)),
            -out * sin(a))
        m.tube(bent([(0.0, foot - 0.01, 0.0), (0.3 * top[0], 0.7 * top[1] + 0.3 * foot,
            0.3 * top[2]), top], 0.06, n=3), 0.0025, n=5, of=young)
        size = min(0.26 * r, 0.2 * (h - foot))
        if kind == "cup":
            m.revolve([(0.0, -0.1 * size), (0.55 * size, 0.2 * size), (0.6 * size, 0.7 * size),
                (0.4 * size, size), (0.0, 0.8 * size)], n=8, at=top, of=petal)
            continue
        m.sphere((0, 0, 0), 0.2 * size, n=8, at=top, of=plain("pollen", (0.8, 0.62, 0.15), 0.8))
        for j in range(n_petals):
            _add_leaf(m, top, 2 * pi * j / n_petals, 0.35, leaf(0.75 * size, 0.4 * size, droop=0.2,
                rows=4), petal)


def _planted(m: Maker, size: Size, pot_share: float, grow: Grow, *, spread: float = 1.0) -> None:
    """A plant in a pot, stretched to be as wide and as high as it says.

    pot_share, spread: the pot's width and the plant's, of that of both.
    """
    w, d, h = size
    width = pot_share * w
    tall = min(width * m.uniform(0.75, 1.1), 0.55 * h)
    pot(m, width, width, tall)
    foot = 0.955 * tall
    maker = Maker(m.rng, m.style)
    grow(maker, w / 2, foot, h)
    parts = maker.finished(__name__, grow.__name__)
    points = np.concatenate([solid.positions for solid, _material in parts])
    low, high = points.min(0), points.max(0)
    scale = (spread * w / (high[0] - low[0]), (h - foot) / (high[1] - foot),
        spread * d / (high[2] - low[2]))
    for solid, material in parts:
        centred = transformed(solid, np.eye(3), (-(low[0] + high[0]) / 2, -foot,
            -(low[2] + high[2]) / 2))
        m.add(stretched(centred, scale), at=(0.0, foot, 0.0), of=material)


_GROW: Final[Mapping[str, Grow]] = {f.__name__: f for f in (swords, fountain, broad, palm, tree, yucca,
    cactus, rosette, flowers)}


class _Plant(Record):
    """A row of plants.csv."""

    name: str
    called: str
    place: Place
    variants: int
    grow: str  # a key of _GROW
    pot_share: float
    spread: float = 1.0
    width_m: Several[float]  # least and greatest; the depth is equal
    height_m: Several[float]

    def size(self, m: Maker) -> Size:
        """Draw a size."""
        width = m.uniform(*self.width_m)
        return width, width, m.uniform(*self.height_m)

    def build(self, m: Maker, size: Size) -> None:
        """Make one."""
        _planted(m, size, self.pot_share, _GROW[self.grow], spread=self.spread)


PLANTS: Final = {
    p.name: Family(p.name, p.called, "plant", OTHERPROP, p.place, p.variants, p.size, p.build)
    for p in read_csv(Path(__file__).with_name("plants.csv"), _Plant)
}
"""Families by name, in the order from which seeds draw."""
