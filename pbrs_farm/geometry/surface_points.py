"""Points spread evenly over an item's triangles; no effects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import (
    area_vectors,
    boxes_meeting,
    finite_triangles,
    lengths,
    triangle_bounds,
    triangle_corners,
)

SPACING_M = 0.03
_MOST_POINTS = 200_000  # of one item: larger ones are spread more thinly
_LEAST_M = 1e-9  # minimum extent along an axis; flatter rows are perpendicular to it
_SPARSE = 32  # cubes for each point: with more, sorting the points is faster


def item_triangles(item: Item) -> F64:
    """(F, 3, 3) float64 finite corners of an item's triangles in the world, metres."""
    parts = [triangle_corners(s.positions, s.faces) for s in item.surfaces if len(s.faces)]
    return finite_triangles(np.concatenate([np.zeros((0, 3, 3)), *parts]))


def surface_points(corners: F64, spacing_m: float = SPACING_M, box: F64 | None = None) -> F64:
    """(N, 3) points, one at most per cube of half the spacing, in box (2, 3) if given."""
    if not len(corners):
        return np.zeros((0, 3))
    area = float(lengths(area_vectors(corners)).sum()) / 2
    spacing_m = max(spacing_m, float(np.sqrt(area / _MOST_POINTS)))
    low, high = triangle_bounds(corners)
    least, size = low.min(0), high - low
    # Keep whole cubes at the border of the box, so that their representative points do not change.
    near = None if box is None else (box[0] - spacing_m, box[1] + spacing_m)
    if near is not None:
        meets = boxes_meeting(low, high, *near)
        corners, size = corners[meets], size[meets]
    # Represent a small triangle by its centroid.
    is_small = np.maximum(np.maximum(size[:, 0], size[:, 1]), size[:, 2]) < spacing_m / 2
    middles, grids = corners[is_small].sum(1) / 3, _grids(corners[~is_small], spacing_m)
    points = np.concatenate([middles, grids.points(near)])
    # Fine meshes have many points in one place.
    columns = np.ascontiguousarray(points.T)
    cube = np.floor((columns - least[:, None]) / (spacing_m / 2)).astype(np.int64)
    cube = np.maximum(cube, 0)  # rounding
    cells = cube.max(1, initial=0) + 1
    keys = (cube[0] * cells[1] + cube[1]) * cells[2] + cube[2]
    points = points[_first_of_each(keys, int(cells.prod()))]
    if box is None:
        return points
    inside = (points > box[0]) & (points < box[1])
    return np.asarray(points[inside[:, 0] & inside[:, 1] & inside[:, 2]])


def spread_points(corners: F64, spacing_m: float) -> tuple[F64, NDArray[np.int64]]:
    """(N, 3) points on triangles (F, 3, 3), about spacing_m apart, and (N,) the triangle of each."""
    grids = _grids(corners, spacing_m)
    return grids.points(None), np.repeat(np.arange(len(corners)), grids.n_u * grids.n_v)


class _Grids(NamedTuple):
    """A grid over each of some triangles: steps along its longest edge, rows towards the apex."""

    base: tuple[F64, F64]  # (T, 3) ends of the longest edge
    apex: F64  # (T, 3)
    n_u: NDArray[np.int64]  # (T,) cells of a row
    n_v: NDArray[np.int64]  # (T,) rows

    def points(self, box: tuple[F64, F64] | None) -> F64:
        """(N, 3) the middles of the cells, in order; all those in the box (low, high) and few others."""
        if box is None:
            counts = self.n_u * self.n_v
            k, which = _numbers(counts)
            row = k // self.n_u[which]
            return self._middles(which, k - row * self.n_u[which], row)
        row, which = _numbers(self.n_v)
        v = ((row + 0.5) / self.n_v[which])[:, None]
        start, end = (p[which] * (1 - v) + self.apex[which] * v for p in self.base)
        # Each row is a segment: keep the cells between the planes of the box.
        least, most = np.zeros(len(row)), np.ones(len(row))
        for axis in range(3):
            along = end[:, axis] - start[:, axis]
            is_across = np.abs(along) < _LEAST_M
            slope = np.where(is_across, 1.0, along)
            t = np.stack([(side[axis] - start[:, axis]) / slope for side in box])
            beside = (start[:, axis] < box[0][axis]) | (start[:, axis] > box[1][axis])
            least = np.maximum(least, np.where(is_across, np.where(beside, 2.0, 0.0), t.min(0)))
            most = np.minimum(most, np.where(is_across, 1.0, t.max(0)))
        n_u = self.n_u[which]
        first = np.maximum(np.floor(least * n_u - 0.5), 0).astype(np.int64)
        last = np.minimum(np.ceil(most * n_u - 0.5), n_u - 1).astype(np.int64)
        k, of_row = _numbers(np.where(most < least, 0, np.maximum(last - first + 1, 0)))
        return self._middles(which[of_row], k + first[of_row], row[of_row])

    def _middles(
        self, which: NDArray[np.int64], column: NDArray[np.int64], row: NDArray[np.int64]
    ) -> F64:
        u, v = (column + 0.5) / self.n_u[which], (row + 0.5) / self.n_v[which]
        # Coordinate by coordinate and in place: in less than half the time of whole points.
        ends = (np.ascontiguousarray(end.T) for end in (*self.base, self.apex))
        p, q, r = (end.take(which, 1) for end in ends)
        p *= 1 - u
        q *= u
        p += q
        p *= 1 - v
        r *= v
        p += r
        return np.ascontiguousarray(p.T)


def _grids(corners: F64, spacing_m: float) -> _Grids:
    """The grids of cells of about spacing_m over triangles (T, 3, 3)."""
    # Turn each triangle so that its longest edge is the base, the apex opposite.
    sides = lengths(corners[:, [1, 2, 0]] - corners)
    first = sides.argmax(1)
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (first + k) % 3] for k in range(3))
    base = sides[rows, first]
    height = lengths(area_vectors(corners)) / np.maximum(base, 1e-12)
    n_u = np.maximum(np.ceil(base / spacing_m), 1).astype(np.int64)
    n_v = np.maximum(np.ceil(height / spacing_m), 1).astype(np.int64)
    return _Grids((a, b), c, n_u, n_v)


def _numbers(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """0 to count - 1 for each count, one after another, and the number of the count."""
    which = np.repeat(np.arange(len(counts)), counts)
    return np.arange(len(which)) - (np.cumsum(counts) - counts)[which], which


def _first_of_each(keys: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """The first place of each key (0 to n), in the order of keys."""
    if n > _SPARSE * len(keys):
        return np.asarray(np.unique(keys, return_index=True)[1])
    # The last write to an index wins: write in reverse order so that the first point remains.
    first = np.full(n, -1, np.int32)
    first[keys[::-1]] = np.arange(len(keys) - 1, -1, -1, dtype=np.int32)
    return np.asarray(first[first >= 0], np.int64)
