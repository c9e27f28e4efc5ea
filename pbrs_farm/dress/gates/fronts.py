"""Gate: no added item blocks doors and drawers of furniture, measured on meshes; no effects.

The bodies are those of the space, in its order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pbrs_farm.core.classes import CHAIR
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.core.joints import Joint
from pbrs_farm.dress.gates.bodies import Body
from pbrs_farm.dress.gates.ways import Blocked
from pbrs_farm.dress.space import HouseSpace
from pbrs_farm.geometry.opened import free_value
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.swept import swept_by_item

LEAST_OPEN: Final = 0.9  # share of its way that a front must have free


def blocked_fronts(_space: HouseSpace, bodies: Sequence[Body]) -> tuple[int, list[Blocked]]:
    """Number of furniture fronts near added items, and the added bodies that block them.

    A front is a door or drawer of furniture; doorways and windows have separate gates. Nine tenths of
    its way must be free of added items; chairs can be pushed aside. If a new item's own door hits
    existing furniture, the new item is removed.
    """
    n, blocked = 0, []
    scene = SceneTriangles([b.item for b in bodies])
    new = [k for k, b in enumerate(bodies) if b.is_new and b.item.nyu40 != CHAIR]
    for k, body in enumerate(bodies):
        if body.item.kind is not ItemKind.OBJECT:
            continue
        is_added = body.is_new and body.was is None
        joints = {joint.part: joint for joint in body.item.joints}
        for swept in swept_by_item(body.item):
            x0, z0, x1, z1 = swept.area.bounds
            near = [
                i
                for i in (range(len(bodies)) if is_added else new)
                if i != k
                and bodies[i].item.nyu40 != CHAIR
                and bodies[i].low[0] < x1
                and bodies[i].high[0] > x0
                and bodies[i].low[1] < swept.high_y
                and bodies[i].high[1] > swept.low_y
                and bodies[i].low[2] < z1
                and bodies[i].high[2] > z0
            ]
            if not near:
                continue
            n += 1
            stopped_by = _stopped_by(scene, k, near, joints[swept.part])
            if stopped_by is not None:
                blocked.append(Blocked(body.item.id, bodies[_goes(bodies, k, stopped_by)].index))
    return n, blocked


def _goes(bodies: Sequence[Body], own: int, other: int) -> int:
    """The one of two bodies to remove: the later of the added ones."""
    if not bodies[other].is_new:
        return own
    return max(own, other) if bodies[own].is_new and bodies[own].was is None else other


def _stopped_by(scene: SceneTriangles, seed: int, near: Sequence[int], joint: Joint) -> int | None:
    """Which of some items stops a part before nine tenths of its way; None: it opens."""
    items: list[Item] = [scene.items[seed], *(scene.items[i] for i in near)]
    some = SceneTriangles(items)
    target = joint.lower + LEAST_OPEN * (joint.upper - joint.lower)
    value, by = free_value(some, 0, joint.part, target)
    if value >= target - 1e-9:
        return None
    return next((i for i in near if scene.items[i].id == by), None)
