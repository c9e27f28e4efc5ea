"""Walkable floor of a room, on a bitmap with 5 cm cells. No effects."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np
import shapely
from scipy import ndimage

from pbrs_farm.core.arrays import Bools
from pbrs_farm.core.walkable import CELL_M, WALK_M
from pbrs_farm.generate.floor_plan import Rect
from pbrs_farm.generate.furnish.room_space import FurnishSpace

_RADIUS: Final = WALK_M / 2 / CELL_M  # cells
# From a cell's middle to walls and bodies, exactly: whole cells would let ways of 0.5 m pass.
_REACH_M: Final = WALK_M / 2 - 0.005


class WalkMap:
    """Where the middle of a man can be in a room; furniture is marked on copies."""

    def __init__(self, space: FurnishSpace, standing: Iterable[Rect] = ()) -> None:
        x0, z0, x1, z1 = space.walk_polygon.bounds
        self._origin = x0 - 2 * CELL_M, z0 - 2 * CELL_M
        shape = math.ceil((z1 - z0) / CELL_M) + 4, math.ceil((x1 - x0) / CELL_M) + 4
        xx, zz = np.meshgrid(
            self._origin[0] + (np.arange(shape[1]) + 0.5) * CELL_M,
            self._origin[1] + (np.arange(shape[0]) + 0.5) * CELL_M,
        )
        self._inside: Bools = np.asarray(shapely.contains_xy(space.polygon, xx, zz))
        clear = space.walk_polygon.buffer(-_REACH_M, join_style="mitre")
        self._xs, self._zs = xx[0], zz[:, 0]
        self.free = self.with_bodies(np.asarray(shapely.contains_xy(clear, xx, zz)), standing)
        # A way that an empty room does not have is not asked for.
        self._start = space.ways[0] if space.ways else None
        region = self._region(self.free, self._start)
        self.joined_ways = [w for w in space.ways if region is not None and self._meets(region, w)]

    def with_bodies(self, free: Bools, rects: Iterable[Rect]) -> Bools:
        """A copy of free cell centres (H, W) without those within _REACH_M of furniture on rectangles."""
        remaining = free.copy()
        for x0, z0, x1, z1 in rects:
            # Test the cells in the bounding rectangle; round its corners off.
            columns, rows = (
                slice(*np.searchsorted(centres, (low - _REACH_M, high + _REACH_M)).tolist())
                for centres, low, high in ((self._xs, x0, x1), (self._zs, z0, z1))
            )
            x, z = self._xs[columns], self._zs[rows]
            dx, dz = (
                np.maximum(np.maximum(a - v, v - b), 0) for v, a, b in ((x, x0, x1), (z, z0, z1))
            )
            remaining[rows, columns] &= dx[None] ** 2 + dz[:, None] ** 2 >= _REACH_M**2
        return remaining

    def reached(self, free: Bools, fronts: Iterable[Rect]) -> Bools | None:
        """(H, W) cells reached from the doors; None if a door or front is cut off."""
        region = self._region(free, self._start)
        if region is None:
            return None
        if all(self._meets(region, r) for r in (*self.joined_ways, *fronts)):
            return region
        return None

    def share(self, region: Bools) -> float:
        """Share of the room's floor that ways 0.6 m wide cover."""
        if not region.any():
            return 0.0
        near = ndimage.distance_transform_edt(~region) <= _RADIUS
        return float((near & self._inside).sum() / max(self._inside.sum(), 1))

    def _cells(self, rect: Rect) -> tuple[slice, slice]:
        # A cell counts if its centre is inside.
        def span(low: float, high: float, origin: float) -> slice:
            a = math.ceil((low - origin) / CELL_M - 0.5 - 1e-6)
            b = math.floor((high - origin) / CELL_M - 0.5 + 1e-6) + 1
            return slice(max(a, 0), max(b, 0))

        return span(rect[1], rect[3], self._origin[1]), span(rect[0], rect[2], self._origin[0])

    def _region(self, free: Bools, start: Rect | None) -> Bools | None:
        """The connected free region at a rectangle; the largest region if no rectangle is given."""
        ways, _ = ndimage.label(free)
        area = ways[self._cells(start)] if start else ways
        counts = np.bincount(area.ravel(), minlength=1)
        counts[0] = 0
        if not counts.any():
            return None
        return np.asarray(ways == int(counts.argmax()))

    def _meets(self, region: Bools, rect: Rect) -> bool:
        return bool(region[self._cells(rect)].any())
