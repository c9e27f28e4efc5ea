"""Gate: no added item blocks doors and drawers of furniture, measured on meshes; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.classes import CHAIR
from pbrs_farm.core.joints import Joint
from pbrs_farm.dress.gates.bodies import Body, boxes_of
from pbrs_farm.dress.gates.ways import Blocked
from pbrs_farm.dress.space import HouseSpace
from pbrs_farm.geometry.opened import stops
from pbrs_farm.geometry.scene_triangles import SceneTriangles

LEAST_OPEN: Final = 0.9  # share of its way that a front must have free


def blocked_fronts(_space: HouseSpace, bodies: Sequence[Body]) -> tuple[int, list[Blocked]]:
    """Number of furniture fronts near added items, and the added bodies that block them.

    A front is a door or drawer of furniture; doorways and windows have separate gates. Nine tenths of
    its way must be free of added items; chairs can be pushed aside. If a new item's own door hits
    existing furniture, the new item is removed.
    """
    n, blocked = 0, []
    scene = SceneTriangles([b.item for b in bodies])
    lows, highs = boxes_of(bodies)
    solid = np.array([b.item.nyu40 != CHAIR for b in bodies], bool)
    solid_new = solid & np.array([b.is_new for b in bodies], bool)
    for k, body in enumerate(bodies):
        others = solid if body.is_new and body.was is None else solid_new
        joints = {joint.part: joint for joint in body.item.joints}
        for swept in body.swept:
            x0, z0, x1, z1 = swept.area.bounds
            low, high = (x0, swept.low_y, z0), (x1, swept.high_y, z1)
            meets = others & ((lows < high) & (highs > low)).all(1)
            meets[k] = False
            near = np.flatnonzero(meets).tolist()
            if not near:
                continue
            n += 1
            stopped_by = _stopped_by(scene, bodies, k, near, joints[swept.part])
            if stopped_by is not None:
                blocked.append(Blocked(body.item.id, bodies[_goes(bodies, k, stopped_by)].index))
    return n, blocked


def _goes(bodies: Sequence[Body], own: int, other: int) -> int:
    """The one of two bodies to remove: the later of the added ones."""
    if not bodies[other].is_new:
        return own
    return max(own, other) if bodies[own].is_new and bodies[own].was is None else other


def _stopped_by(
    scene: SceneTriangles, bodies: Sequence[Body], own: int, near: Sequence[int], joint: Joint
) -> int | None:
    """Which of some items stops a part before nine tenths of its way; None: it opens."""
    target = joint.lower + LEAST_OPEN * (joint.upper - joint.lower)
    stops_by = bodies[own].stops.setdefault(joint.part, {})
    # Other open parts of the item itself stop the part, too.
    keys = {k: id(bodies[k].item) for k in (own, *near)}
    missing = [k for k, key in keys.items() if key not in stops_by]
    if missing:
        values = stops(scene, own, joint.part, target, missing)
        stops_by |= {keys[k]: values.get(k, np.inf) for k in missing}
    first = min(keys, key=lambda k: stops_by[keys[k]])
    is_free = max(stops_by[keys[first]], joint.value) >= target - 1e-9
    return None if is_free or first == own else first
