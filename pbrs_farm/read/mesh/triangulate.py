"""Polygons of mixed size in space -> triangles; no effects."""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.mesh import area_vectors

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
