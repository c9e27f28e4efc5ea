"""Triangles cut by planes, so that a mesh stays closed: equal edges are cut at equal points; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64

_ON_PLANE_M = 1e-4  # corners nearer than this lie on the plane

Ints = NDArray[np.int64]


def cut_triangles(rows: F64, normal: F64, offset: float) -> tuple[F64, Ints]:
    """Triangles (F, 3, K) cut at the plane x . normal = offset, in order, and each one's parent."""
    d = rows[..., :3] @ normal - offset
    side = np.where(np.abs(d) < _ON_PLANE_M, 0, np.sign(d)).astype(int)
    crosses = (side.min(1) < 0) & (side.max(1) > 0)
    parts: list[F64] = []
    parents: list[int] = []
    for f in range(len(rows)):
        pieces = _cut(rows[f], side[f], d[f]) if crosses[f] else [rows[f]]
        parts += pieces
        parents += [f] * len(pieces)
    if not parts:
        return rows, np.zeros(0, np.int64)
    return np.stack(parts), np.array(parents, np.int64)


def _cut(triangle: F64, side: NDArray[np.int_], d: F64) -> list[F64]:
    # Walk round the triangle, add the points where it crosses, and keep either side as a fan.
    ring: list[tuple[F64, int]] = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        ring.append((triangle[a], int(side[a])))
        if side[a] * side[b] < 0:
            ring.append((_cut_point(triangle[a], triangle[b], float(d[a]), float(d[b])), 0))
    pieces = []
    for keep in (1, -1):
        corners = [p for p, s in ring if s in (keep, 0)]
        pieces += [
            np.stack([corners[0], corners[k], corners[k + 1]]) for k in range(1, len(corners) - 1)
        ]
    return pieces


def _cut_point(a: F64, b: F64, da: float, db: float) -> F64:
    # Begin at the same end whichever triangle asks.
    if tuple(a[:3]) > tuple(b[:3]):
        a, b, da, db = b, a, db, da
    point = a + (b - a) * (da / (da - db))
    return np.concatenate([point[:3].astype(np.float32).astype(np.float64), point[3:]])
