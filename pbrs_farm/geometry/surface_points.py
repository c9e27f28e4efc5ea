"""Points spread evenly over an item's triangles; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import (
    area_vectors,
    finite_triangles,
    lengths,
    triangle_bounds,
    triangle_corners,
)

SPACING_M = 0.03
_MOST_POINTS = 200_000  # of one item: larger ones are spread more thinly
_SPARSE = 32  # cubes for each point: with more, sorting the points is faster


def item_triangles(item: Item) -> F64:
    """(F, 3, 3) float64 corners of an item's triangles in the world, metres; empty for none.

    Triangles with a corner that is not finite are left out.
    """
    parts = [triangle_corners(s.positions, s.faces) for s in item.surfaces if len(s.faces)]
    return finite_triangles(np.concatenate([np.zeros((0, 3, 3)), *parts]))


def surface_points(corners: F64, spacing_m: float = SPACING_M) -> F64:
    """(N, 3) points on triangles (F, 3, 3), at most one in each cube of half the spacing.

    No place of a triangle is farther than about 0.7 spacing_m from a point.
    """
    if not len(corners):
        return np.zeros((0, 3))
    area = float(lengths(area_vectors(corners)).sum()) / 2
    spacing_m = max(spacing_m, float(np.sqrt(area / _MOST_POINTS)))
    # The middle stands for a small triangle.
    low, high = triangle_bounds(corners)
    size = high - low
    is_small = np.maximum(np.maximum(size[:, 0], size[:, 1]), size[:, 2]) < spacing_m / 2
    middles = corners[is_small].sum(1) / 3
    points = np.concatenate([middles, _laid_over(corners[~is_small], spacing_m)])
    # Fine meshes have many points in one place.
    columns = np.ascontiguousarray(points.T)
    least = columns.min(1)
    cube = np.floor((columns - least[:, None]) / (spacing_m / 2)).astype(np.int64)
    cells = cube.max(1) + 1
    keys = (cube[0] * cells[1] + cube[1]) * cells[2] + cube[2]
    return np.asarray(points[_first_of_each(keys, int(cells.prod()))])


def _laid_over(corners: F64, spacing_m: float) -> F64:
    """(N, 3) the middles of cells of about spacing_m of a grid over each of the triangles."""
    # Turn each triangle so that its longest edge is the base, the apex opposite.
    sides = lengths(corners[:, [1, 2, 0]] - corners)
    first = sides.argmax(1)
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (first + k) % 3] for k in range(3))
    base = sides[rows, first]
    height = lengths(area_vectors(corners)) / np.maximum(base, 1e-12)
    # Lay a grid over it: steps along the base, rows towards the apex; take the cells' middles.
    n_u = np.maximum(np.ceil(base / spacing_m), 1).astype(np.int64)
    n_v = np.maximum(np.ceil(height / spacing_m), 1).astype(np.int64)
    counts = n_u * n_v
    k = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    across = np.repeat(n_u, counts)
    row = k // across
    u = (k - row * across + 0.5) / across
    v = (row + 0.5) / np.repeat(n_v, counts)
    points = np.empty((len(k), 3))
    for axis in range(3):
        p, q, r = (np.repeat(corner[:, axis], counts) for corner in (a, b, c))
        points[:, axis] = (p * (1 - u) + q * u) * (1 - v) + r * v
    return points


def _first_of_each(keys: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """The first place of each key (0 to n), in the order of keys."""
    if n > _SPARSE * len(keys):
        return np.asarray(np.unique(keys, return_index=True)[1])
    # Of places that are written twice the last one stays: write them from the last to the first.
    first = np.full(n, -1, np.int32)
    first[keys[::-1]] = np.arange(len(keys) - 1, -1, -1, dtype=np.int32)
    return np.asarray(first[first >= 0], np.int64)
