"""Collision geometry for cloth: heights in cells and the vertical sides between them; no effects.

Everything below a height is solid. A point inside leaves by the shorter way, up or sideways, so
that cloth beside a bed is not lifted onto it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.geometry.plan_grid import PlanGrid, cells_over

CELL_M: Final = 0.0125  # cell size of the height map that cloth falls on
TOUCH_M: Final = 0.0004  # gap between the cloth's underside and its support, metres
_FAR_M: Final = 0.5  # deeper points always move up, metres

Cells = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A height map in its own frame (x, y up, z), metres, obstacles widened by grown_m; made by `of`."""

    grid: PlanGrid  # its axes are the frame's
    heights: F64  # (rows, columns)
    bare: F64  # the same without widening
    corners: F64  # (F, 3, 3) of the world: what cloth falls on
    sides: F64  # (S, 3) points on the upright sides of steps, a cell apart
    outward: F64  # (S, 3) the way out of each
    tree: cKDTree  # of the sides
    grown_m: float

    @staticmethod
    def of(grid: PlanGrid, corners: F64, floor_y: float, below_y: float, edge_m: float) -> Ground:
        """The heights of triangles (F, 3, 3) of the world in the grid's cells, the floor's elsewhere.

        below_y: what begins higher hangs over the cloth and holds nothing. edge_m: how long a net's
        edges are: they cut corners that its vertices go round, by half their length at most.
        """
        hits = cells_over(grid, corners, touched=True)
        heights = np.full(grid.shape, floor_y)
        is_low = hits.low < below_y
        cell = hits.row[is_low] * grid.shape[1] + hits.column[is_low]
        np.maximum.at(heights.reshape(-1), cell, hits.high[is_low])
        n = int(np.ceil(edge_m / 2 / CELL_M))
        grown = np.asarray(ndimage.maximum_filter(heights, size=2 * n + 1))
        sides, outward = _sides_of_steps(grown)
        return Ground(grid, grown, heights, corners, sides, outward, cKDTree(sides), n * CELL_M)

    def at(self, x: F64, z: F64) -> F64:
        """(...) heights under places (x, z) of the frame, metres; beyond the grid its border's."""
        return np.asarray(self.heights[self._cells(x, z)])

    def _cells(self, x: F64, z: F64) -> tuple[Cells, Cells]:
        rows, columns = self.heights.shape
        row = np.clip((z / CELL_M).astype(np.int64), 0, rows - 1)
        return row, np.clip((x / CELL_M).astype(np.int64), 0, columns - 1)

    def depths(self, points: F64) -> F64:
        """(...) metres by which points (3, ...) are inside obstacles, the shorter way out; 0: outside."""
        x, y, z = points
        short: F64 = np.maximum(self.bare[self._cells(x, z)] - y, 0.0)
        inside = short > 0
        if inside.any() and len(self.sides):
            within = points[:, inside].T
            distance, nearest = self.tree.query(within)
            aside = ((self.sides[nearest] - within) * self.outward[nearest]).sum(1) - self.grown_m
            aside = np.where(distance < _FAR_M, np.maximum(aside, 0.0), np.inf)
            short[inside] = np.minimum(short[inside], aside)
        return short

    def ways_out(self, points: F64, apart_m: float) -> F64:
        """(3, ...) shortest moves, maybe 0, that bring points (3, ...) apart_m >= 0 from the solid."""
        x, y, z = points
        move = np.zeros_like(points)
        short = self.at(x, z) + apart_m - y
        # Points less than a cell deep move to the top.
        is_up = (short > 0) & (short <= apart_m + CELL_M)
        move[1] = np.where(is_up, short, 0.0)
        ask = ~is_up & ((short > 0) | self._is_beside(points, apart_m))
        if ask.any():
            move[:, ask] = self._ways_out_of_sides(points[:, ask].T, short[ask], apart_m).T
        return move

    def _is_beside(self, points: F64, apart_m: float) -> Bools:
        """Whether a step's side may be nearer than that to points in the open."""
        reach = apart_m * np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]])
        near = points[:, None] + reach.T.reshape(3, 4, *([1] * (points.ndim - 1)))
        return np.asarray((self.at(near[0], near[2]) > points[1]).any(0))

    def _ways_out_of_sides(self, points: F64, short: F64, apart_m: float) -> F64:
        """(N, 3) moves of points (N, 3) that lack `short` (N,) to be above: sideways or up."""
        if not len(self.sides):
            return np.maximum(short, 0.0)[:, None] * [0.0, 1.0, 0.0]
        distance, nearest = self.tree.query(points, distance_upper_bound=_FAR_M)
        is_far = ~np.isfinite(distance)
        nearest = np.where(is_far, 0, nearest)
        out = self.outward[nearest]
        aside = apart_m - ((points - self.sides[nearest]) * out).sum(1)
        # In the open, only a side next to the point counts, not one round a corner.
        is_round = (short <= 0) & (distance > 2 * apart_m + CELL_M)
        aside = np.where(is_far | is_round, 0.0, np.maximum(aside, 0.0))
        is_up = (short > 0) & (is_far | (short < aside))
        return np.where(is_up[:, None], short[:, None] * [0.0, 1.0, 0.0], aside[:, None] * out)

    def world(self, points: F64) -> F64:
        """(..., 3) points of the frame in the world."""
        plan = self.grid.plan_of(
            points[..., 0] / self.grid.cell_m, points[..., 2] / self.grid.cell_m
        )
        return np.stack([plan[..., 0], points[..., 1], plan[..., 1]], -1)


def _sides_of_steps(heights: F64) -> tuple[F64, F64]:
    """Points (S, 3) on the sides of steps of more than a cell, a cell apart, and the ways out."""
    points, ways = [], []
    for swap in (False, True):
        h = heights.T if swap else heights
        fall = h[:-1] - h[1:]
        first, along = np.nonzero(np.abs(fall) > CELL_M)
        n = np.ceil(np.abs(fall[first, along]) / CELL_M).astype(np.int64)
        number = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
        first, along = np.repeat(first, n), np.repeat(along, n)
        y = np.maximum(h[first, along], h[first + 1, along]) - number * CELL_M
        sign = np.sign(fall[first, along])
        across, beside, zero = (first + 1) * CELL_M, (along + 0.5) * CELL_M, np.zeros(len(y))
        x, z = (across, beside) if swap else (beside, across)
        points.append(np.stack([x, y, z], -1))
        ways.append(np.stack([sign, zero, zero] if swap else [zero, zero, sign], -1))
    return np.concatenate(points), np.concatenate(ways)
