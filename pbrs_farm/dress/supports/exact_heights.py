"""Exact heights of raw triangles under points: what a thing comes to rest on; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64

_CHUNK = 2_000_000  # pairs of points and triangles at once


def heights_under(points: F64, corners: F64, below: float | F64 = np.inf) -> F64:
    """(N,) greatest height y of the triangles (T, 3, 3) over or under plan points (N, 2); -inf = none.

    below: heights above it, (N,) or one for all, do not count.
    """
    found = np.full(len(points), -np.inf)
    most = np.broadcast_to(np.asarray(below, np.float64), (len(points),))
    if not len(points) or not len(corners):
        return found
    # Leave out triangles beside all points and upright ones.
    plan = corners[..., [0, 2]]
    near = ((plan.max(1) >= points.min(0)) & (plan.min(1) <= points.max(0))).all(1)
    u, v = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
    doubled = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    near &= np.abs(doubled) > 1e-12
    corners, plan, u, v, doubled = (a[near] for a in (corners, plan, u, v, doubled))
    if not len(corners):
        return found
    rise = corners[:, 1:, 1] - corners[:, :1, 1]
    step = max(1, _CHUNK // len(corners))
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        # Barycentric coordinates of every point in every triangle.
        dx = points[part, None, 0] - plan[None, :, 0, 0]
        dz = points[part, None, 1] - plan[None, :, 0, 1]
        a = (dx * v[:, 1] - dz * v[:, 0]) / doubled
        b = (dz * u[:, 0] - dx * u[:, 1]) / doubled
        y = corners[:, 0, 1] + a * rise[:, 0] + b * rise[:, 1]
        inside = (a >= -1e-9) & (b >= -1e-9) & (a + b <= 1 + 1e-9) & (y <= most[part, None])
        found[part] = np.where(inside, y, -np.inf).max(1)
    return found
