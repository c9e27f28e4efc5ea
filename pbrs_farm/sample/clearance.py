"""Test points for triangles within a distance, to keep cameras clear of obstacles; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Geometry
from pbrs_farm.core.mesh import distances_to_triangles

_PAIRS: Final = 1 << 19  # distances per batch, to bound memory
_POINTS: Final = 1 << 12  # points per query of the tree


def near_any_triangle(points: F64, geometry: Geometry, distance_m: float) -> Bools:
    """(N,) bool: a triangle is within distance_m of the point (paper section 3.1: 10 cm).

    points: (N, 3) metres. geometry: the whole house's. Exact point-triangle distances in float64; distant
    triangles are excluded by a tree over their plan boxes, and pairs are processed in batches. False
    everywhere for a distance of 0 or less.
    """
    near = np.zeros(len(points), np.bool_)
    if distance_m <= 0 or not len(points) or not len(geometry.faces):
        return near
    corners = _corners_around(points, geometry, distance_m)
    if not len(corners):
        return near
    # Find pairs whose boxes meet in plan by a tree, in height by comparison.
    low, high = corners.min(1) - distance_m, corners.max(1) + distance_m
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 2], high[:, 0], high[:, 2]))
    for start in range(0, len(points), _POINTS):
        part = points[start : start + _POINTS]
        point, triangle = tree.query(shapely.points(part[:, [0, 2]]))
        y = part[point, 1]
        at_height = (y >= low[triangle, 1]) & (y <= high[triangle, 1])
        point, triangle = point[at_height], triangle[at_height]
        # Compute the exact distances of the remaining pairs.
        for first in range(0, len(point), _PAIRS):
            i, t = point[first : first + _PAIRS], triangle[first : first + _PAIRS]
            near[start + i[distances_to_triangles(part[i], corners[t]) <= distance_m]] = True
    return near


def _corners_around(points: F64, geometry: Geometry, margin: float) -> F64:
    """(T, 3, 3) float64 corners of the triangles whose box meets the points' box grown by margin."""
    low, high = points.min(0) - margin, points.max(0) + margin
    # Compare corner by corner: numpy is slow where the axis it reduces has three entries.
    a, b, c = (geometry.positions[geometry.faces[:, k]] for k in range(3))
    with np.errstate(invalid="ignore"):
        top, bottom = np.maximum(np.maximum(a, b), c), np.minimum(np.minimum(a, b), c)
        meets = np.ones(len(a), np.bool_)
        for k in range(3):
            meets &= (top[:, k] >= low[k]) & (bottom[:, k] <= high[k])
    chosen = np.stack([a[meets], b[meets], c[meets]], 1).astype(np.float64)
    return np.asarray(chosen[np.isfinite(chosen).all((1, 2))])
