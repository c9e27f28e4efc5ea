"""Plan geometry in metres, (x, z): footprints, closing of narrow gaps, polygons of triangles; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, Points2

T = TypeVar("T")
Shape = BaseGeometry
"""A plan area: a polygon, several, or none."""

GRID_M = 1e-6
"""Plan coordinates are rounded to this, so that shared corners are the same bits."""


def polygon_of_triangles(positions: F64, faces: NDArray[np.integer]) -> Shape:
    """Plan area covered by faces (F, 3) of either orientation, seen from above; may be empty."""
    # Drop vertical triangles, which have no plan area.
    corners = positions[:, [0, 2]][faces]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turned = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) > 1e-9
    return on_grid(shapely.union_all(shapely.polygons(corners[turned]), grid_size=GRID_M))


def polygon_of_room(outline: Points2) -> Shape:
    """The room's outline (N, 2) as a valid plan polygon, several if it crosses itself."""
    return on_grid(shapely.make_valid(shapely.Polygon(outline)))


def on_grid(shape: Shape) -> Shape:
    """shape with coordinates rounded to GRID_M, valid, without degenerate parts; may be empty."""
    return _areal(shapely.set_precision(shape, GRID_M))


def _areal(shape: Shape) -> Shape:
    # Drop the lines and points that overlays leave where areas touch: GEOS rejects them as input.
    if shape.geom_type in ("Polygon", "MultiPolygon"):
        return shape
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.MultiPolygon([p for p in parts.tolist() if p.geom_type == "Polygon"])


def union(shapes: Iterable[Shape]) -> Shape:
    """The plan area any of shapes covers, on the grid; empty for none."""
    return _areal(shapely.union_all(list(shapes), grid_size=GRID_M))


def grown(shape: Shape, by_m: float) -> Shape:
    """shape with its edges moved outward (inward when negative), corners kept sharp, not on the grid."""
    return shapely.buffer(shape, by_m, join_style="mitre", mitre_limit=3.0)


def closed(shape: Shape, gap_m: float) -> Shape:
    """shape with gaps narrower than gap_m filled; its other edges stay where they are."""
    return union([grown(grown(shape, gap_m / 2), -gap_m / 2), shape])


def opened(shape: Shape, width_m: float) -> Shape:
    """shape without parts narrower than width_m; its other edges stay where they are."""
    return common(grown(grown(shape, -width_m / 2), width_m / 2), shape)


def without(shape: Shape, *others: Shape) -> Shape:
    """shape less all others, rounded to the grid."""
    for cutter in others:
        if not shapely.is_empty(cutter):
            shape = _areal(shapely.difference(shape, cutter, grid_size=GRID_M))
    return shape


def near_to(
    shape: Shape, things: Sequence[T], area: Callable[[T], Shape], within_m: float
) -> list[T]:
    """The elements, in order, whose plan area is within within_m of shape."""
    areas = np.array([area(x) for x in things], object)
    if not len(areas):
        return []
    shapely.prepare(shape)
    return [things[k] for k in np.flatnonzero(shapely.dwithin(shape, areas, within_m)).tolist()]


def common(a: Shape, b: Shape) -> Shape:
    """The area both cover, without mere edges and points; may be empty."""
    return _areal(shapely.intersection(a, b, grid_size=GRID_M))
