"""What stands on a piece of furniture, and how far it goes down to another one; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.core.mesh import triangle_bounds
from pbrs_farm.dress.swap.surroundings import Surroundings

_CONTACT_M: Final = 0.015  # how far a thing may hang above or sink into what it stands on
_LOW_PART_M: Final = 0.05  # of a thing, at its bottom: what can touch
_FLAT_M: Final = 0.06  # rugs and mats lie under everything
_PAIRS: Final = 1_000_000  # points times triangles at a time
_LEFT_ALONE: Final = frozenset(
    {ItemKind.DOOR, ItemKind.WINDOW, ItemKind.STAIRS}
)  # fmt: skip


def heights_below(points: F64, corners: F64) -> F64:
    """(N,) y of the highest triangle (F, 3, 3) at or below each point (N, 3); -inf = none.

    A triangle counts as below up to 1 mm above the point.
    """
    found = np.full(len(points), -np.inf)
    plan_low, plan_high = triangle_bounds(corners[:, :, [0, 2]])
    meets = (plan_high >= points[:, [0, 2]].min(0)).all(1)
    meets &= (plan_low <= points[:, [0, 2]].max(0)).all(1)
    corners = corners[meets]
    a = corners[:, 0]
    e, f = corners[:, 1] - a, corners[:, 2] - a
    det = e[:, 0] * f[:, 2] - e[:, 2] * f[:, 0]
    level = np.abs(det) > 1e-12
    a, e, f, det = a[level], e[level], f[level], det[level]
    if not len(a):
        return found
    step = max(1, _PAIRS // len(a))
    for k in range(0, len(points), step):
        p = points[k : k + step, None]
        # Solve for the place in each triangle's plan.
        dx, dz = p[..., 0] - a[:, 0], p[..., 2] - a[:, 2]
        u = (dx * f[:, 2] - dz * f[:, 0]) / det
        v = (e[:, 0] * dz - e[:, 2] * dx) / det
        y = a[:, 1] + u * e[:, 1] + v * f[:, 1]
        covers = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (y <= p[..., 1] + 1e-3)
        found[k : k + step] = np.where(covers, y, -np.inf).max(1)
    return found


def things_on(around: Surroundings, index: int) -> tuple[list[int], list[int]]:
    """(what stands on an item, what stands in it or under it), by place; index: the item's.

    Structure, doors and windows, and what lies flat below it, are neither.
    """
    bounds = around.bounds()
    (low, high), corners = bounds[index], around.triangles(around.items[index])
    on: list[int] = []
    inside: list[int] = []
    for k in around.near(low - _CONTACT_M, high + _CONTACT_M):
        item, (own_low, own_high) = around.items[k], bounds[k]
        middle = (own_low + own_high) / 2
        is_over = (low[[0, 2]] < middle[[0, 2]]).all() and (middle[[0, 2]] < high[[0, 2]]).all()
        if k == index or item.kind in _LEFT_ALONE or not is_over or not item.n_faces:
            continue
        if own_high[1] < low[1] + _FLAT_M:
            continue
        (on if _stands_on(item, corners, float(high[1])) else inside).append(k)
    return on, inside


def _stands_on(item: Item, corners: F64, top_y: float) -> bool:
    # Its foot is where the furniture seen from above is.
    points = lowest_points(item)
    from_above = points.copy()
    from_above[:, 1] = top_y
    height = heights_below(from_above, corners)
    gap = points[:, 1] - height
    return bool(np.isfinite(height).any() and abs(float(gap.min())) <= _CONTACT_M)


def lowest_points(item: Item) -> F64:
    """(N, 3) vertices within 5 cm of the item's bottom; every few of them where they are many."""
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    points = points[points[:, 1] <= points[:, 1].min() + _LOW_PART_M]
    return np.asarray(points[:: max(1, len(points) // 600)])


def drop_onto(item: Item, corners: F64) -> float | None:
    """How far (m, upwards) an item goes to stand on triangles (F, 3, 3) seen from above.

    None where less than most of its foot would find something to stand on.
    """
    points = lowest_points(item)
    top = max(float(corners[:, :, 1].max()), float(points[:, 1].max()))
    above = points.copy()
    above[:, 1] = top
    height = heights_below(above, corners)
    gap = points[:, 1] - height
    if not np.isfinite(height).any():
        return None
    drop = float(gap[np.isfinite(gap)].min())
    # Its foot must be held on both sides of its middle, each way.
    foot = points[points[:, 1] < points[:, 1].min() + 0.01]
    reach = foot.copy()
    reach[:, 1] = top
    held = foot[foot[:, 1] - drop - heights_below(reach, corners) < _CONTACT_M]
    middle = (foot.min(0) + foot.max(0))[[0, 2]] / 2
    plan = held[:, [0, 2]]
    if len(plan) == 0 or not ((plan.min(0) <= middle).all() and (plan.max(0) >= middle).all()):
        return None
    return -drop
