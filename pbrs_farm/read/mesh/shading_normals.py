"""Shading normals with a crease angle. No effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64, I32, I64
from pbrs_farm.core.mesh import numbered_points, unit_normals


def crease_normals(points: F64, faces: I64, crease_rad: float) -> tuple[F64, I64]:
    """Unit normals (N, 3) and, for each face corner (F, 3), which of them it has.

    Two faces share a normal at a vertex if they meet in an edge there whose faces turn by less
    than crease_rad (or through a chain of such edges around the vertex). Faces are weighted by
    their angle at the vertex. Vertices at equal positions count as one.
    """
    unit = unit_normals(points[faces])
    if crease_rad <= 0:
        return unit, np.repeat(np.arange(len(faces)), 3).reshape(-1, 3)
    n_normals, label = _normal_of_corner(points, faces, unit, np.cos(crease_rad))
    # Sum the faces' normals at each corner by their angle there, then make them unit vectors.
    angles = _corner_angles(points, faces)
    normals = np.zeros((n_normals, 3))
    for k in range(3):
        normals[:, k] = np.bincount(label, (unit[:, k : k + 1] * angles).ravel(), n_normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0, length, 1)
    return normals, label.reshape(-1, 3).astype(np.int64)


def _normal_of_corner(points: F64, faces: I64, unit: F64, min_cos: float) -> tuple[int, I32]:
    # Number of normals, and the index for each of the 3 F corners.
    _, welded = numbered_points(points[faces.ravel()])
    first, second = _smooth_links(welded.reshape(-1, 3), unit, min_cos)
    # Imported here: every process of a run imports this module, few call this function.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Corners that smooth edges join, directly or through others, share one normal.
    shape = (faces.size, faces.size)
    links = coo_array((np.ones(len(first), np.int8), (first, second)), shape=shape)
    n_normals, label = connected_components(links, directed=False)
    return n_normals, label


def _corner_angles(points: F64, faces: I64) -> F64:
    # (F, 3) radians.
    corners = points[faces]
    forward = np.roll(corners, -1, axis=1) - corners
    backward = np.roll(corners, 1, axis=1) - corners
    # The arctangent keeps its precision for very sharp and very blunt corners.
    cross = np.linalg.norm(np.cross(forward, backward), axis=-1)
    return np.asarray(np.arctan2(cross, (forward * backward).sum(-1)))


def _smooth_links(welded: I64, unit: F64, min_cos: float) -> tuple[I64, I64]:
    # Pairs of corner numbers (3 face + k) at the ends of edges that two faces share smoothly.
    corner = np.arange(welded.size).reshape(-1, 3)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    # Turn every edge from its lower vertex to its higher one: both faces then name it alike.
    a, b = welded.ravel(), np.roll(welded, -1, axis=1).ravel()
    low, high = np.where(a > b, end, start), np.where(a > b, start, end)
    key = np.minimum(a, b) * (int(welded.max(initial=0)) + 1) + np.maximum(a, b)
    # Sort the edges, so that those of one pair of vertices are neighbours.
    order = np.argsort(key, kind="stable")
    same = key[order[:-1]] == key[order[1:]]
    first, second = order[:-1][same], order[1:][same]
    # Keep the pairs whose faces turn by less than the crease; edge k is of face k // 3.
    is_smooth = (unit[first // 3] * unit[second // 3]).sum(1) >= min_cos
    first, second = first[is_smooth], second[is_smooth]
    return np.concatenate([low[first], high[first]]), np.concatenate([low[second], high[second]])
