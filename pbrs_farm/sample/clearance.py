"""Distance from points to triangles in three dimensions; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.house import Geometry

_PAIRS: Final = 1 << 19
_POINTS: Final = 1 << 12


def near_any_triangle(
    points: NDArray[np.float64], geometry: Geometry, distance_m: float
) -> NDArray[np.bool_]:
    """(N,) bool: a triangle comes within distance_m of the point (paper section 3.1: 10 cm).

    points: (N, 3) metres. The exact point-to-triangle distance in float64; triangles whose box
    lies farther away are left out by a tree over their plan boxes. Memory is bounded.
    """
    near = np.zeros(len(points), np.bool_)
    if distance_m <= 0 or not len(points) or not len(geometry.faces):
        return near
    corners = _corners_around(points, geometry, distance_m)
    if not len(corners):
        return near
    low, high = corners.min(1) - distance_m, corners.max(1) + distance_m
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 2], high[:, 0], high[:, 2]))
    for start in range(0, len(points), _POINTS):
        part = points[start : start + _POINTS]
        point, triangle = tree.query(shapely.points(part[:, [0, 2]]))
        y = part[point, 1]
        kept = (y >= low[triangle, 1]) & (y <= high[triangle, 1])
        point, triangle = point[kept], triangle[kept]
        for first in range(0, len(point), _PAIRS):
            i, t = point[first : first + _PAIRS], triangle[first : first + _PAIRS]
            squared = squared_distance(part[i], corners[t])
            near[start + i[squared <= distance_m**2]] = True
    return near


def _corners_around(
    points: NDArray[np.float64], geometry: Geometry, margin: float
) -> NDArray[np.float64]:
    """(T, 3, 3) float64 corners of the triangles whose box meets the points' box grown by margin."""
    low, high = points.min(0) - margin, points.max(0) + margin
    corners = geometry.positions[geometry.faces]
    with np.errstate(invalid="ignore"):
        meets = (corners.max(1) >= low).all(1) & (corners.min(1) <= high).all(1)
    chosen = corners[meets].astype(np.float64)
    return np.asarray(chosen[np.isfinite(chosen).all((1, 2))])


def squared_distance(p: NDArray[np.float64], triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) squared distance of p (N, 3) to triangle (N, 3, 3); degenerate ones are segments.

    The nearest point is inside, when p projects into the triangle, else on one of its edges.
    """
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    on_edges = np.minimum(
        _squared_to_segment(p, a, b),
        np.minimum(_squared_to_segment(p, b, c), _squared_to_segment(p, c, a)),
    )
    normal = np.cross(b - a, c - a)
    area = _dot(normal, normal)
    inside = (
        (_dot(np.cross(b - a, p - a), normal) >= 0)
        & (_dot(np.cross(c - b, p - b), normal) >= 0)
        & (_dot(np.cross(a - c, p - c), normal) >= 0)
        & (area > 0)
    )
    to_plane = _dot(p - a, normal) ** 2 / np.where(area > 0, area, 1.0)
    return np.where(inside, to_plane, on_edges)


def _squared_to_segment(
    p: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    edge = b - a
    length = _dot(edge, edge)
    t = np.clip(_dot(p - a, edge) / np.where(length > 0, length, 1.0), 0, 1)
    offset = p - (a + t[:, None] * edge)
    return _dot(offset, offset)


def _dot(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.einsum("ij,ij->i", x, y))
