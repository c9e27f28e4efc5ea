"""Polygons of mixed size in space -> triangles; no effects."""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from pbrs_farm.core.arrays import F64, I32, I64, Bools
from pbrs_farm.core.mesh import area_vectors, numbered_points, unit_normals

# Polygons of more corners become fans: ear cutting may take the square of their number.
MAX_EAR_CUT = 5_000


def triangulated_corners(positions: F64, sizes: I64) -> I64:
    """(T, 3) corner numbers of triangles of polygons (sizes), fans if convex, else ear-cut, in order."""
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    triangles: list[I64] = []
    owners: list[I64] = []
    for n in np.unique(sizes):
        if n < 3:
            continue
        which = np.flatnonzero(sizes == n)
        corners = starts[which][:, None] + np.arange(n)
        # Triangulate all convex polygons of one size together, as fans round their first corner.
        first = np.broadcast_to(corners[:, :1], (len(which), n - 2))
        fans = np.stack([first, corners[:, 1:-1], corners[:, 2:]], -1)
        if n == 3:
            triangles.append(fans.reshape(-1, 3))
            owners.append(which)
            continue
        is_convex = _convex(positions[corners]) | (n > MAX_EAR_CUT)
        triangles.append(fans[is_convex].reshape(-1, 3))
        owners.append(np.repeat(which[is_convex], n - 2))
        # Cut the ears off the others, one by one.
        for polygon in np.flatnonzero(~is_convex):
            cut = _ear_cut(positions[corners[polygon]])
            triangles.append(corners[polygon][cut])
            owners.append(np.full(len(cut), which[polygon]))
    if not triangles:
        return np.zeros((0, 3), np.int64)
    # Put the triangles into the order of their polygons.
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(triangles)[order]


def _newell(polygons: F64) -> F64:
    # Newell's normal, valid for non-convex and slightly non-planar polygons.
    following = np.roll(polygons, -1, axis=1)
    return np.asarray(np.cross(polygons, following).sum(1))


def _convex(polygons: F64) -> Bools:
    # polygons: (P, n, 3); no corner turns against the polygon's own normal.
    local = polygons - polygons[:, :1]
    edges = np.roll(local, -1, axis=1) - local
    turns = np.cross(edges, np.roll(edges, -1, axis=1))
    along = (turns * _newell(local)[:, None]).sum(-1)
    return np.asarray((along >= -1e-12 * np.abs(along).max(1, keepdims=True)).all(1))


def _ear_cut(polygon: F64) -> I64:
    # (T, 3) corners of one polygon; a fan where ear cutting finds nothing.
    n = len(polygon)
    # Flatten along the axis that the polygon faces most.
    normal = _newell(polygon[None] - polygon[0])[0]
    drop = int(np.abs(normal).argmax())
    flat = np.ascontiguousarray(np.delete(polygon, drop, axis=1), np.float64)
    cut = np.asarray(
        mapbox_earcut.triangulate_float64(flat, np.array([n], np.uint32)), np.int64
    ).reshape(-1, 3)
    if not len(cut):
        return np.stack([np.zeros(n - 2, np.int64), np.arange(1, n - 1), np.arange(2, n)], -1)
    # Turn over what dropping that axis has mirrored.
    against = area_vectors(polygon[cut]) @ normal < 0
    cut[against] = cut[against][:, [0, 2, 1]]
    return cut


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
