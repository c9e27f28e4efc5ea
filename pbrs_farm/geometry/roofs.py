"""Ceilings over a polygon with a height at each corner, level or sloping, as triangles; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import ConvexHull, QhullError

from pbrs_farm.core.arrays import F64, I32, I64, Points2
from pbrs_farm.core.house import Surface
from pbrs_farm.geometry.plan_surfaces import horizontal, triangulated

FIT_M = 0.02  # how far a roof may lie above a given height
ROOF_SLIVER_M2 = 1e-6  # pieces of less area are left out
_LEVEL_M = 1e-4  # heights that differ by less are one


class Roof(NamedTuple):
    """Plan points (N, 2), their heights (N,), triangles (F, 3) counter-clockwise in plan."""

    points: Points2
    heights: F64
    faces: I32


def roof_over(rings: Sequence[Points2], heights: F64) -> Roof:
    """The ceiling over an outline and its holes; heights: of all their points in order.

    A roof that bends only downwards (gable, hip, shed) is spanned over the corners and ridge ends
    like a cloth, to within FIT_M of every given height; any other is cut by its plan alone.
    """
    points = np.concatenate([np.asarray(r, np.float64) for r in rings])
    cloth = _cloth(points, heights)
    if cloth is not None:
        spanned = _spanned(rings, points, heights, cloth)
        if spanned is not None:
            return spanned
    return Roof(points, heights, triangulated(rings)[1])


def _cloth(points: Points2, heights: F64) -> I64 | None:
    # Triangles of the upper side of the convex hull of the points in space.
    # Add a point far below: the faces without it are the upper side.
    n = len(points)
    below = [*points.mean(0), heights.min() - 10.0 * float(np.ptp(points) + np.ptp(heights))]
    try:
        hull = ConvexHull(np.vstack([np.column_stack([points, heights]), below]))
    except (QhullError, ValueError):
        return None
    faces = hull.simplices[(hull.simplices < n).all(1)].astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces = np.where(turn[:, None] < 0, faces[:, [0, 2, 1]], faces)[
        np.abs(turn) > 2 * ROOF_SLIVER_M2
    ]
    return faces[np.lexsort(faces.T[::-1])] if len(faces) else None


def _spanned(rings: Sequence[Points2], points: Points2, heights: F64, cloth: I64) -> Roof | None:
    # Delaunay surface cut along the outline; None if a given height is too far below it.
    outline = shapely.Polygon(rings[0], list(rings[1:]))
    all_points, all_heights, all_faces, n = [], [], [], 0
    worst = 0.0
    for face in cloth:
        corners = points[face]
        # Fit the plane height = a x + b z + c through the triangle's corners.
        plane = np.linalg.solve(np.column_stack([corners, np.ones(3)]), heights[face])
        triangle = shapely.Polygon(corners)
        # Measure its height above the given heights.
        on_it = shapely.intersects_xy(triangle.buffer(1e-9), points)
        over = points[on_it] @ plane[:2] + plane[2] - heights[on_it]
        worst = max(worst, float(over.max(initial=0.0)))
        # Keep the part of it inside the outline.
        for part in shapely.get_parts(shapely.intersection(triangle, outline)):
            if part.geom_type != "Polygon" or part.area < ROOF_SLIVER_M2:
                continue
            inner = [shapely.get_coordinates(r)[:-1] for r in (part.exterior, *part.interiors)]
            plan, faces = triangulated(inner)
            all_points.append(plan)
            all_heights.append(plan @ plane[:2] + plane[2])
            all_faces.append(faces + n)
            n += len(plan)
    if worst > FIT_M or not all_points:
        return None
    return Roof(
        np.concatenate(all_points),
        np.concatenate(all_heights),
        np.concatenate(all_faces).astype(np.int32),
    )


def level_or_sloped(
    name: str, parts: Sequence[Sequence[Points2]], heights: Sequence[F64], material: int
) -> Surface:
    """A ceiling over polygons with holes, facing down, through each polygon's heights (y)."""
    all_heights = np.concatenate(list(heights))
    if np.ptp(all_heights) < _LEVEL_M:
        return horizontal(name, parts, float(all_heights[0]), material, up=False)
    # Span a roof over each polygon, and number its corners after those before it.
    positions, faces, n = [], [], 0
    for rings, tops in zip(parts, heights, strict=True):
        plan, y, triangles = roof_over(rings, tops)
        positions.append(np.stack([plan[:, 0], y, plan[:, 1]], -1))
        faces.append(triangles + n)
        n += len(plan)
    world = np.concatenate(positions).astype(np.float32)
    return Surface(name, world, np.concatenate(faces).astype(np.int32), material, world[:, [0, 2]])
