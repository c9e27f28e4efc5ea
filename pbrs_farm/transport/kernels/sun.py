"""The sun on the device: a disc of even radiance, and a plane of cells that it shines on squarely; kernels.

Effects: holds numbers on the device.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.transport.kernels.sampler import opaque3
from pbrs_farm.transport.scene_tables.sky import Sky

if TYPE_CHECKING:
    from pbrs_farm.transport.kernels.outside import Outside

REACH_M: Final = 200.0  # from the plane to where the sun's rays begin
_EDGE_M: Final = 0.05  # of a cell, longer where there would be more than _MAX_CELLS
_MAX_CELLS: Final = 1 << 15


class SunDisc:
    """The sun of a sky on the device."""

    def __init__(self, sky: Sky) -> None:
        self.outside: Outside | None = None  # surroundings that may occlude it, if any
        cos_max = math.cos(sky.sun_half_angle_rad)
        # The disc's radiance gives its irradiance: integral of the cosine over the cone.
        projected = math.pi * math.sin(sky.sun_half_angle_rad) ** 2
        self.direction = np.asarray(sky.sun_direction, np.float64)  # (3,) unit
        self.shines = bool(sky.sun_irradiance.max() > 0)
        self._frame = mi.Frame3f(opaque3(mi.Vector3f, sky.sun_direction))
        self._cos = dr.opaque(mi.Float, cos_max)
        self._rgb = opaque3(mi.Color3f, sky.sun_irradiance / projected)
        self.pdf = dr.opaque(mi.Float, 1 / (2 * math.pi * (1 - cos_max)))  # of a direction to it

    @property
    def irradiance(self) -> Any:
        """Color3f that a direction drawn to it brings to a surface that faces it."""
        return self._rgb / self.pdf

    def past_outside(self, o: Any, d: Any, active: Any) -> Any:
        """Color3f let through outdoors from o along unit d to the sun; 1 without surroundings."""
        return mi.Color3f(1) if self.outside is None else self.outside.lets_through(o, d, active)

    def sample(self, uv: Any) -> Any:
        """A unit direction uniform in the disc."""
        warp: Any = mi.warp.square_to_uniform_cone
        return self._frame.to_world(warp(uv, self._cos))

    def radiance(self, d: Any) -> Any:
        """Color3f of the disc in direction d, black beside it."""
        inside = dr.dot(d, self._frame.n) >= self._cos - 1e-7
        return dr.select(inside, self._rgb, 0)


class SunPlane:
    """Square cells that cover a part of a home as the sun sees it; the kernel is the same for all."""

    def __init__(self, direction: F64, places: F64) -> None:
        """direction: (3,) unit, to the sun. places: (N, 3) that lie on some cell, N >= 1."""
        # Span the plane through the middle of the places.
        middle = places.mean(0)
        helper = np.eye(3)[np.argmin(np.abs(direction))]
        a = np.cross(direction, helper)
        a /= np.linalg.norm(a)
        b = np.cross(direction, a)
        plane = (places - middle) @ np.stack([a, b], 1)
        low, size = plane.min(0), np.ptp(plane, axis=0)
        edge = _EDGE_M
        while np.prod(shape := np.floor(size / edge) + 1) > _MAX_CELLS:
            edge *= 1.1
        self.edge_m, self.shape = edge, (int(shape[0]), int(shape[1]))
        self._a, self._b = opaque3(mi.Vector3f, a), opaque3(mi.Vector3f, b)
        self._n, self._middle = opaque3(mi.Vector3f, direction), opaque3(mi.Point3f, middle)
        self._low = [dr.opaque(mi.Float, float(x)) for x in low]
        self._edge = dr.opaque(mi.Float, edge)
        self._counts = [dr.opaque(mi.UInt32, n) for n in self.shape]

    @property
    def n_cells(self) -> int:
        """The number of cells."""
        return self.shape[0] * self.shape[1]

    def point(self, cell: Any, uv: Any) -> Any:
        """The point of a cell at uv in [0, 1)^2."""
        x = self._low[0] + (mi.Float(cell // self._counts[1]) + uv.x) * self._edge
        y = self._low[1] + (mi.Float(cell % self._counts[1]) + uv.y) * self._edge
        return self._middle + x * self._a + y * self._b

    def cell(self, p: Any, d: Any) -> tuple[Any, Any]:
        """(cell crossed by the line through p along unit d, whether a ray through it may meet p: else no meaning)."""
        to = p - self._middle
        ahead = dr.dot(to, self._n) / dr.dot(d, self._n)
        q = to - d * ahead
        x, y = (
            (dr.dot(q, axis) - low) / self._edge
            for axis, low in zip((self._a, self._b), self._low, strict=True)
        )
        column, row = mi.UInt32(dr.fmax(x, 0)), mi.UInt32(dr.fmax(y, 0))  # no index is NaN
        inside = (
            (ahead < REACH_M)
            & (x >= 0)
            & (y >= 0)
            & (column < self._counts[0])
            & (row < self._counts[1])
        )
        return column * self._counts[1] + row, inside
