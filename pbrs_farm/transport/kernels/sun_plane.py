"""Cells of a plane that the sun shines on squarely: each lane's place there, and what a cell holds; kernels.

Effects: holds buffers on the device.
"""

from __future__ import annotations

from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.transport.kernels.sampler import opaque3

_EDGE_M: Final = 0.05  # of a cell, longer where there would be more than _MAX_CELLS
_MAX_CELLS: Final = 1 << 15
REACH_M: Final = 200.0  # from the plane to where the sun's rays begin


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
        at = (places - middle) @ np.stack([a, b], 1)
        low, size = at.min(0), np.ptp(at, axis=0)
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
        """(cell that the line through p in direction d crosses, whether a ray through it may meet p)."""
        to = p - self._middle
        ahead = dr.dot(to, self._n) / dr.dot(d, self._n)
        q = to - d * ahead
        x, y = (
            (dr.dot(q, axis) - low) / self._edge
            for axis, low in zip((self._a, self._b), self._low, strict=True)
        )
        column, row = mi.UInt32(dr.maximum(x, 0)), mi.UInt32(dr.maximum(y, 0))
        inside = (
            (ahead < REACH_M)
            & (x >= 0)
            & (y >= 0)
            & (column < self._counts[0])
            & (row < self._counts[1])
        )
        return column * self._counts[1] + row, inside
