"""Floor area swept by doors and drawers when they open, seen from above; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.core.joints import Joint

_STEPS: Final = 9  # of a way, shut and wide open among them
_OVERHEAD_M: Final = 1.4  # height above the floor up to which a sweep blocks the way, metres


@dataclass(frozen=True, slots=True, eq=False)
class Swept:
    """The space that a part sweeps from shut to wide open."""

    part: str
    area: BaseGeometry  # plan (x, z), metres
    low_y: float
    high_y: float


def swept_by(
    surfaces: Sequence[Surface], joints: Sequence[Joint], axes: F64 | None = None
) -> list[Swept]:
    """Volume that each part with faces sweeps, in the frame of surfaces; axes: (3, 3) of the box."""
    axes = np.eye(3) if axes is None else axes
    volumes = []
    for joint in joints:
        positions = [s.positions for s in surfaces if s.part == joint.part and len(s.positions)]
        if not positions:
            continue
        local = np.concatenate(positions).astype(np.float64) @ axes
        ends = np.stack([local.min(0), local.max(0)], -1)
        corners = np.array(list(product(*ends))) @ axes.T
        values = (joint.lower, *np.linspace(joint.value, joint.upper, _STEPS))
        poses = np.array([transform_points(joint.motion(float(v)), corners) for v in values])
        # A hull around each pose and the next; a line of points is made faster than a set.
        pairs = np.concatenate([poses[:-1], poses[1:]], 1)
        hulls = shapely.convex_hull(shapely.linestrings(pairs[..., [0, 2]]))
        y = poses[..., 1]
        volumes.append(Swept(joint.part, shapely.union_all(hulls), float(y.min()), float(y.max())))
    return volumes


def swept_by_item(item: Item) -> list[Swept]:
    """Volumes swept by the doors and drawers of furniture; empty for doorways and windows."""
    if item.kind is not ItemKind.OBJECT or not item.joints:
        return []
    return swept_by(item.surfaces, item.joints, item.box.axes if item.box is not None else None)


def floor_swept(items: Sequence[Item], floor_y: float) -> BaseGeometry:
    """Floor area to keep free of furniture: below all sweeps lower than a man's chest."""
    swept = (s for item in items for s in swept_by_item(item))
    return shapely.union_all([s.area for s in swept if s.low_y < floor_y + _OVERHEAD_M])
