"""Open doors and drawers of a finished home until an obstacle stops them; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.house import House, Item, MaterialKind, Note
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.motions import Motion
from pbrs_farm.geometry.opened import free_value, item_at, joint_of
from pbrs_farm.geometry.scene_triangles import SceneTriangles

STOPPED: Final = "joint-stopped"
"""Kind of the note about a joint that an obstacle stops early."""

_LEAST_OPEN: Final = 0.15  # minimum opening of a joint left open, share of its range
_NEAR: Final = 1e-3  # tolerance of a stopped joint, radians or metres


def opened(house: House, index: int, part: str, share: float) -> House:
    """Open a part of items[index] by a share 0..1 of its range, or, with a note, up to an obstacle."""
    return _opened(house, SceneTriangles(house.items), index, part, share)[0]


def _opened(
    house: House, scene: SceneTriangles, index: int, part: str, share: float
) -> tuple[House, SceneTriangles]:
    """As opened; scene: the triangles of the house's items, returned for the opened house."""
    value, notes = _reach(scene, index, part, share)
    scene = scene.with_item(index, item_at(house.items[index], part, value))
    return replace(house, items=scene.items, notes=(*house.notes, *notes)), scene


def keyed(
    house: House, index: int, part: str, keys_of_time: Sequence[tuple[float, float]]
) -> House:
    """Open and close a part of items[index] over time.

    keys_of_time: (seconds, share of the joint's range, 0..1) with ascending times. The house at rest has
    the first key. Obstacles of the home at rest stop the part as in `opened`.
    """
    joint = joint_of(house.items[index], part)
    # Measure from the closed state: an open part may already be beyond an obstacle.
    shut = _shut(house, index, part)
    most_share = max(share for _time, share in keys_of_time)
    most, notes = _reach(SceneTriangles(shut.items), index, part, most_share)
    values = tuple((min(_value(joint, share), most),) for _time, share in keys_of_time)
    motion = Motion(house.items[index].id, part, tuple(t for t, _share in keys_of_time), values)
    item = item_at(house.items[index], part, values[0][0])
    items = tuple(item if k == index else unchanged for k, unchanged in enumerate(house.items))
    house = replace(house, items=items, notes=(*house.notes, *notes))
    return with_motions(house, [motion])


def with_motions(house: House, motions: Sequence[Motion]) -> House:
    """The house with these motions, which replace its motions of the same parts."""
    new = {(motion.item, motion.part): motion for motion in motions}
    unchanged = (m for m in house.motions if (m.item, m.part) not in new)
    return replace(house, motions=(*unchanged, *new.values()))


def _shut(house: House, index: int, part: str) -> House:
    item = item_at(house.items[index], part, joint_of(house.items[index], part).lower)
    return house.with_items(item if k == index else i for k, i in enumerate(house.items))


def _reach(
    scene: SceneTriangles, index: int, part: str, share: float
) -> tuple[float, tuple[Note, ...]]:
    """Reachable opening of a part of items[index] towards a share of its range, with notes."""
    item = scene.items[index]
    joint = joint_of(item, part)
    target = _value(joint, share)
    value, stopped_by = free_value(scene, index, part, target)
    if target - value <= _NEAR:
        return value, ()
    text = f"is open by {_amount(joint, value)} of {_amount(joint, target)}"
    return value, (Note(STOPPED, f"{item.id}/{part}", f"{text}: {stopped_by} blocks it"),)


def _value(joint: Joint, share: float) -> float:
    return joint.lower + share * (joint.upper - joint.lower)


def left_open(house: House, share: float, seed: int) -> House:
    """Leave a random share of the doors and drawers, but windows and outer doors, open by random amounts."""
    scene: SceneTriangles | None = None
    for index, item in enumerate(house.items):
        if item.is_outside or item.is_removed:
            continue
        for joint in item.joints:
            rng = np.random.default_rng(keys.seed(house.id, "open", seed, item.id, joint.part))
            is_open, far = rng.random() < share, rng.uniform(_LEAST_OPEN, 1.0)
            if is_open and joint.value == 0 and not _has_pane(house, item, joint):
                scene = scene or SceneTriangles(house.items)
                house, scene = _opened(house, scene, index, joint.part, float(far))
    return house


def _has_pane(house: House, item: Item, joint: Joint) -> bool:
    return any(
        house.materials[s.material].kind is MaterialKind.PANE
        for s in item.surfaces
        if s.part == joint.part
    )


def _amount(joint: Joint, value: float) -> str:
    if joint.kind is JointKind.PRISMATIC:
        return f"{value:.2f} m"
    return f"{np.degrees(value):.0f} degrees"
