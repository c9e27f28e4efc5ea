"""How far edges of one mesh pass through faces of another: thin things that cross; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.mesh import area_vectors, triangle_bounds
from pbrs_farm.dress.gates.bodies import Shell

_STEEP: Final = 0.5  # cosine of edge and normal: an edge that grazes a round thing crosses nothing
_PAIRS: Final = 1_000_000  # of edge and face at once


def crossing_m(a: Shell, b: Shell, least_m: float) -> float:
    """The most of an edge of a that lies on either side of a face of b, metres; 0 for none.

    Edges shorter than twice least_m are left out.
    """
    start, end = _edges_near(a, b, 2 * least_m)
    corners = b.corners
    low, high = triangle_bounds(corners)
    near = ((low <= a.high) & (high >= a.low)).all(1)
    corners, low, high = corners[near], low[near], high[near]
    best = 0.0
    step = max(1, _PAIRS // max(len(corners), 1))
    for first in range(0, len(start), step):
        s, e = start[first : first + step], end[first : first + step]
        least, most = np.minimum(s, e), np.maximum(s, e)
        meets = np.ones((len(s), len(corners)), np.bool_)
        for k in range(3):
            meets &= (least[:, k, None] <= high[:, k]) & (most[:, k, None] >= low[:, k])
        i, j = np.nonzero(meets)
        best = max(best, float(_either_side(s[i], e[i], corners[j]).max(initial=0.0)))
    return best


def _edges_near(a: Shell, b: Shell, least_m: float) -> tuple[F64, F64]:
    """The ends of a's edges whose boxes meet b's, long ones alone."""
    pairs = np.sort(np.concatenate([a.faces[:, [0, 1]], a.faces[:, [1, 2]], a.faces[:, [2, 0]]]))
    # Number the pairs: faster than comparing them column by column, and in the same order.
    n = len(a.vertices)
    first, last = np.divmod(np.unique(pairs[:, 0] * n + pairs[:, 1]), n)
    start, end = a.vertices[first], a.vertices[last]
    meets = ((np.minimum(start, end) <= b.high) & (np.maximum(start, end) >= b.low)).all(1)
    meets &= np.linalg.norm(end - start, axis=1) > least_m
    return start[meets], end[meets]


def _either_side(start: F64, end: F64, corners: F64) -> F64:
    """(N,) the shorter part of each edge beyond its triangle (N, 3, 3); 0 where it does not cross."""
    along = end - start
    length = np.linalg.norm(along, axis=1)
    normal = area_vectors(corners)
    size = np.linalg.norm(normal, axis=1)
    slope = (along * normal).sum(1)
    steep = np.abs(slope) > _STEEP * length * size
    t = ((corners[:, 0] - start) * normal).sum(1) / np.where(steep, slope, 1.0)
    place = start + t[:, None] * along
    inside = steep & (t > 0) & (t < 1)
    # A place inside lies on the same side of all three edges.
    for k in range(3):
        edge = corners[:, (k + 1) % 3] - corners[:, k]
        inside &= (np.cross(edge, place - corners[:, k]) * normal).sum(1) >= 0
    return np.where(inside, np.minimum(t, 1 - t) * length, 0.0)
