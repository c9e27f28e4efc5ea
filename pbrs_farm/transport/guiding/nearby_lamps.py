"""Which lamps lie near a point: what shadow rays and guided rays choose by; kernels, no effects.

A home has a dozen lamps; the pilot's weights (pilot.py) tell which matter to a view, and nothing of
where in the view. Here the strongest few are weighted once more at every vertex, by distance and
by whether they stand before the surface: inside a shade the lamp's own bulb is nearly always taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.transport.guiding.guiding_targets import GlowTables, no_glow
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables, bounding_spheres

MAX_NEAR: Final = 8
"""Lamps that are weighted by where they are."""

_LEAST_M: Final = 0.03
_WIDEST_SIN2: Final = 0.98
_EDGE: Final = 5e-4


@dataclass
class ReferencePoint:
    """A vertex that lamps are chosen from. n: its normal, 0 where light may come from both sides.

    total, aim_total: sums of the levels and aims of Near.
    """

    p: mi.Point3f
    n: mi.Vector3f
    total: mi.Float
    aim_total: mi.Float


class Cones(NamedTuple):
    """The cones in which the lamps' insides lie, as a vertex sees them.

    levels: how often each is chosen, 0 from within; total: their sum; ways: axes; heights: 1 -
    cosine of half the opening.
    """

    levels: list[Any]
    total: Any
    ways: list[Any]
    heights: list[Any]


class Near(NamedTuple):
    """The strongest lamps as a vertex sees them.

    lamps: their numbers; levels: weight times closeness; aims: the same, counting only what guided
    rays may aim at (aims.py).
    """

    at: ReferencePoint
    lamps: list[Any]
    levels: list[Any]
    aims: list[Any]
    cones: Cones


class Nearby:
    """Balls around the lamps of a scene on the device, with the weights of one view."""

    def __init__(self, tables: SceneTables) -> None:
        balls = bounding_spheres(tables)
        balls[:, 3] = np.maximum(balls[:, 3], _LEAST_M)
        self._n = len(balls)
        self._balls = _rows(balls)
        self._weights = np.zeros(self._n)
        self.with_glow(no_glow(self._n))

    def with_weights(self, weights: NDArray[np.float64]) -> None:
        """Set the weights of another view, (L,)."""
        self._weights = weights
        self._set()

    def with_glow(self, glow: GlowTables) -> None:
        """Set what of each lamp guided rays can find."""
        self._shares = glow.shares
        self._insides = _rows(glow.balls)
        self._set()

    def _set(self) -> None:
        order = np.argsort(-self._weights, kind="stable")[:MAX_NEAR]
        chosen, counts = np.zeros(MAX_NEAR, np.uint32), np.zeros(MAX_NEAR, np.float32)
        chosen[: len(order)], counts[: len(order)] = order, 1
        rows = np.zeros((self._n, 4))
        rows[order, 0] = self._weights[order]
        rows[:, 1] = self._shares
        self._chosen, self._counts = device_array(mi.UInt32, chosen), device_array(mi.Float, counts)
        self._strengths = _rows(rows)

    def seen(self, p: Any, n: Any, only: Any, active: Any) -> Near:
        """The lamps from p on a surface of normal n. only: a lamp's number, alone then, or -1."""
        lamps, levels, aims = [], [], []
        total, aim_total = mi.Float(0), mi.Float(0)
        for k in range(MAX_NEAR):
            lamp = dr.gather(mi.UInt32, self._chosen, mi.UInt32(k))
            counts = dr.gather(mi.Float, self._counts, mi.UInt32(k))
            lamp = dr.select(only >= 0, mi.UInt32(only), lamp)
            counts = dr.select(only >= 0, 1.0 if k == 0 else 0.0, counts)
            level, aim = self.level(lamp, p, n, only, active)
            lamps.append(lamp)
            levels.append(counts * level)
            aims.append(counts * aim)
            total += levels[-1]
            aim_total += aims[-1]
        at = ReferencePoint(mi.Point3f(p), n, total, aim_total)
        return Near(at, lamps, levels, aims, self._cones(p, lamps, aims, active))

    def level(self, lamp: Any, p: Any, n: Any, only: Any, active: Any) -> tuple[Any, Any]:
        """(level, aim) of one lamp as `seen` gives them; 0 when it is none of those."""
        ball = dr.gather(mi.Vector4f, self._balls, lamp, active)
        row = dr.gather(mi.Vector4f, self._strengths, lamp, active)
        alone = dr.select(mi.UInt32(only) == lamp, mi.Float(1), 0)
        weight = dr.select(only >= 0, alone, row[0])
        to = mi.Point3f(ball[0], ball[1], ball[2]) - p
        d = dr.sqrt(dr.maximum(dr.squared_norm(to), dr.square(ball[3])))
        is_sheet = dr.squared_norm(n) < 0.5
        lean = dr.select(is_sheet, 1, dr.maximum(dr.dot(n, to) + ball[3], 0) / d)
        level = dr.select(active, weight * lean / dr.square(d), 0)
        return level, level * row[1]

    def _cones(self, p: Any, lamps: list[Any], aims: list[Any], active: Any) -> Cones:
        levels, ways, heights = [], [], []
        total = mi.Float(0)
        for lamp, aim in zip(lamps, aims, strict=True):
            ball = dr.gather(mi.Vector4f, self._insides, lamp, active)
            to = mi.Point3f(ball[0], ball[1], ball[2]) - p
            d2 = dr.maximum(dr.squared_norm(to), 1e-8)
            sin2 = dr.square(ball[3]) / d2
            levels.append(dr.select((sin2 > 0) & (sin2 < _WIDEST_SIN2), aim, 0))
            total += levels[-1]
            ways.append(to * dr.rsqrt(d2))
            # 1 - cosine without the digits that float32 loses near 1.
            heights.append(sin2 / (1 + dr.safe_sqrt(1 - sin2)))
        return Cones(levels, total, ways, heights)


def no_reference(p: Any) -> ReferencePoint:
    """Where no lamp is chosen: the camera."""
    return ReferencePoint(mi.Point3f(p), mi.Vector3f(0), mi.Float(0), mi.Float(0))


def drawn(values: list[Any], levels: list[Any], total: Any, u: Any) -> tuple[Any, Any]:
    """(one of values in proportion to levels, u made uniform again)."""
    at = u * total
    value, again, below = values[0], mi.Float(0), mi.Float(0)
    for candidate, level in zip(values, levels, strict=True):
        mine = (at >= below) & (at < below + level)
        value = dr.select(mine, candidate, value)
        again = dr.select(mine, (at - below) / dr.maximum(level, 1e-30), again)
        below += level
    return value, dr.clip(again, 0, 1 - 1e-7)


def in_cones(cones: Cones, u: Any, uv: Any) -> Any:
    """A direction uniform in one of the cones."""
    height, _u = drawn(cones.heights, cones.levels, cones.total, u)
    way, _u = drawn(cones.ways, cones.levels, cones.total, u)
    h = uv.x * height
    s = dr.safe_sqrt(h * (2 - h))
    sin_phi, cos_phi = dr.sincos(2 * math.pi * uv.y)
    return mi.Frame3f(way).to_world(mi.Vector3f(s * cos_phi, s * sin_phi, 1 - h))


def cone_pdf(cones: Cones, d: Any) -> Any:
    """Pdf of in_cones() per solid angle; 0 where there are none."""
    pdf = mi.Float(0)
    for level, way, height in zip(cones.levels, cones.ways, cones.heights, strict=True):
        # |d - way|^2 is twice the height; what was drawn at the edge must count as inside.
        inside = dr.squared_norm(d - way) <= (2 + _EDGE) * height
        solid = 2 * math.pi * dr.maximum(height, 1e-9)
        pdf += dr.select(inside & (level > 0), level / solid, 0)
    return pdf / dr.maximum(cones.total, 1e-30)


def _rows(rows: NDArray[np.float64]) -> Any:
    """(L, 4) rows on the device, one more, so that none are some."""
    return device_array(mi.Float, np.append(rows, np.zeros((1, 4)), 0).astype(np.float32).ravel())
