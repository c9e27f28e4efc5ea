"""Doors and drawers of a finished home opened, as far as nothing stands in their way; no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.house import House, Item, MaterialKind, Note
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.geometry.opened import free_value, item_at, joint_of
from pbrs_farm.geometry.scene_triangles import SceneTriangles

STOPPED: Final = "joint-stopped"
"""Kind of the note about a joint that something keeps from opening as far as it should."""

_LEAST_OPEN: Final = 0.15  # share of its way by which a joint that was left open stands open
_NEAR: Final = 1e-3  # radians or metres: what is stopped by less is not


def opened(house: House, index: int, part: str, share: float) -> House:
    """The house with a part of items[index] open by a share of its joint's way, 0..1.

    Where a wall or a thing stands in its way it stops before that, and a note says so. A joint that
    stands further open is shut to there.
    """
    item = house.items[index]
    joint = joint_of(item, part)
    wanted = joint.lower + share * (joint.upper - joint.lower)
    value, stopped_by = free_value(SceneTriangles(house.items), index, part, wanted)
    items = list(house.items)
    items[index] = item_at(item, part, value)
    notes = house.notes
    if wanted - value > _NEAR:
        text = f"stands open by {_amount(joint, value)} of {_amount(joint, wanted)}"
        note = Note(STOPPED, f"{item.id}/{part}", f"{text}: {stopped_by} is in its way")
        notes = (*notes, note)
    return replace(house, items=tuple(items), notes=notes)


def left_open(house: House, share: float, seed: int) -> House:
    """The house in which a share of its doors and drawers stands open, drawn by a seed.

    Windows stay shut, and so does what leads outdoors. How far each stands open is drawn as well.
    """
    for index, item in enumerate(house.items):
        if item.is_outside or item.is_removed:
            continue
        for joint in item.joints:
            rng = np.random.default_rng(keys.seed(house.id, "open", seed, item.id, joint.part))
            is_open, far = rng.random() < share, rng.uniform(_LEAST_OPEN, 1.0)
            if is_open and joint.value == 0 and not _has_pane(house, item, joint):
                house = opened(house, index, joint.part, float(far))
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
