"""How deep points lie inside meshes that need not be closed, by rays along the axes; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.mesh import triangle_bounds

_NUDGE: Final = np.array([1.7e-6, 2.9e-6])  # metres: rays pass beside edges that triangles share
_CHUNK: Final = 2_000_000  # pairs of point and triangle at once


def depths_inside(points: F64, corners: F64) -> F64:
    """(P,) metres from points (P, 3) to the nearest face along the axes, 0 for a point outside.

    corners: (F, 3, 3) one connected mesh. Inside is what is covered from above and on all four
    sides by an odd number of faces: a body without a bottom counts as full, a bowl as empty.
    """
    inside = np.ones(len(points), bool)
    depth = np.full(len(points), np.inf)
    for axis in (1, 0, 2):
        left = np.flatnonzero(inside)
        if not len(left):
            break
        n_ahead, ahead, n_behind, behind = _along(points[left], corners, axis)
        odd_ahead, odd_behind = n_ahead % 2 == 1, n_behind % 2 == 1
        inside[left] &= odd_ahead if axis == 1 else odd_ahead & odd_behind
        nearest = np.minimum(ahead, np.where(odd_behind, behind, np.inf))
        depth[left] = np.minimum(depth[left], nearest)
    return np.where(inside & np.isfinite(depth), depth, 0.0)


def _along(
    points: F64, corners: F64, axis: int
) -> tuple[NDArray[np.int64], F64, NDArray[np.int64], F64]:
    """Faces ahead of and behind each point along an axis: how many, and how far the nearest."""
    u, v = (k for k in range(3) if k != axis)
    plan = points[:, [u, v]] + _NUDGE
    # Keep triangles that some ray can meet.
    low, high = triangle_bounds(corners[:, :, [u, v]])
    meets = ((low <= plan.max(0)) & (high >= plan.min(0))).all(1)
    corners, low, high = corners[meets], low[meets], high[meets]
    n, far = len(points), np.full(len(points), np.inf)
    n_ahead, n_behind = np.zeros(n, np.int64), np.zeros(n, np.int64)
    ahead, behind = far.copy(), far.copy()
    step = max(1, _CHUNK // max(n, 1))
    for first in range(0, len(corners), step):
        part = slice(first, first + step)
        i, j = np.nonzero(
            (plan[:, None] >= low[None, part]).all(-1) & (plan[:, None] <= high[None, part]).all(-1)
        )
        t = _met(plan[i], corners[part][j], u, v, axis) - points[i, axis]
        for rows, count, nearest in ((t > 0, n_ahead, ahead), (t <= 0, n_behind, behind)):
            np.add.at(count, i[rows], 1)
            np.minimum.at(nearest, i[rows], np.abs(t[rows]))
    return n_ahead, ahead, n_behind, behind


def _met(plan: F64, corners: F64, u: int, v: int, axis: int) -> F64:
    """(N,) where the line through a plan point (N, 2) meets its triangle (N, 3, 3); NaN = it does not."""
    a, b, c = (corners[:, k][:, [u, v]] for k in range(3))
    ab, ac, ap = b - a, c - a, plan - a
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / det
        t = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / det
        inside = (s >= 0) & (t >= 0) & (s + t <= 1)
        height = corners[:, 0, axis] + s * (corners[:, 1, axis] - corners[:, 0, axis])
        height = height + t * (corners[:, 2, axis] - corners[:, 0, axis])
    return np.where(inside, height, np.nan)
