"""Distances from points to triangles; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.repair.structure.booleans import F64


def distance_to_triangles(point: F64, corners: F64) -> NDArray[np.float64]:
    """(F,) distance in metres from point (3,) to each triangle (F, 3, 3)."""
    a = corners[:, 0] - point
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], 1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    squared = np.maximum((normal**2).sum(1), 1e-300)

    # Straight to the plane where the foot lies inside the triangle.
    foot = normal * ((a * normal).sum(1) / squared)[:, None]
    to_foot = foot - a
    u = (np.cross(to_foot, edges[:, 1]) * normal).sum(1) / squared
    v = (np.cross(edges[:, 0], to_foot) * normal).sum(1) / squared
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    to_plane = np.linalg.norm(foot, axis=1)

    # Else to the nearest edge.
    starts = corners - point
    ends = np.roll(starts, -1, axis=1)
    along = ends - starts
    t = -(starts * along).sum(2) / np.maximum((along**2).sum(2), 1e-300)
    nearest = starts + np.clip(t, 0.0, 1.0)[..., None] * along
    to_edge = np.linalg.norm(nearest, axis=2).min(1)
    return np.asarray(np.where(inside, to_plane, to_edge), np.float64)
