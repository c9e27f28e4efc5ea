"""Which lamps are convex and symmetric about a point, as bulbs are; pure numpy, no effects.

From outside the sphere around it just one of two opposite points of such a lamp faces a vertex,
or neither: shadow rays to the other one could never arrive.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.mesh import face_areas, unit_normals

_TOLERANCE_M: Final = 1e-5  # what float32 leaves of equal places far from the origin
_MAX_FACES: Final = (
    4096  # maximum faces of a lamp to test: every face is compared with every corner
)


def symmetry_row(corners: F64) -> F32:
    """(4,) centre and radius, m, of a lamp of triangles (T, 3, 3): < 0 faces inwards, 0 not symmetric or convex."""
    centre = 0.5 * (corners.min((0, 1)) + corners.max((0, 1)))
    row = np.zeros(4, np.float32)
    row[:3] = centre
    if len(corners) > _MAX_FACES:
        return row
    # Test that every corner has its opposite, and no corner is outside a face's plane.
    places = np.unique((corners - centre).reshape(-1, 3), axis=0)
    if np.asarray(cKDTree(places).query(-places)[0]).max() > _TOLERANCE_M:
        return row
    normals = unit_normals(corners)
    heights = ((corners[:, 0] - centre) * normals).sum(1)
    side = np.sign(heights[0])
    if (side * heights).min() <= 0:
        return row
    if (side * (places @ normals.T - heights)).max() > _TOLERANCE_M:
        return row
    # Ask whether the faces are the whole hull, each once.
    middles = np.unique(np.rint(corners.mean(1) / _TOLERANCE_M), axis=0)
    if len(middles) < len(corners):
        return row
    try:
        hull_area = ConvexHull(places).area
    except QhullError:
        return row
    areas = face_areas(corners)
    radius = np.sqrt((places**2).sum(1).max()) + _TOLERANCE_M
    row[3] = side * radius if abs(areas.sum() - hull_area) < 0.5 * areas.min() else 0
    return row
