"""Clips of boxes in a room, about which questions are asked."""

import random
from typing import Any

import numpy as np

from pbrs_farm.core.house import House, Item
from pbrs_farm.export.questions.clips import Clip, Thing
from pbrs_farm.export.questions.kinds import KINDS
from tests.inputs.made_views import made_view
from tests.sample.sampled_rooms import box, room_house

KIND = {kind.name: kind for kind in KINDS}
ROOM_M = 8.0


def visible_item(
    number: int, noun: str, x: float, z: float, size: Any = (0.5, 0.5, 0.5), y=0.0, **seen
):
    """A box whose middle is at (x, z) in plan, its bottom at height y."""
    w, h, d = size
    item = box((x - w / 2, y, z - d / 2), (x + w / 2, y + h, z + d / 2), name=f"{noun} {number}")
    facts = {"first_glimpsed": 0, "first_seen": 0, "most_visible": 1.0} | seen
    return Thing(number, noun, item, **facts)


def house_of(*items: Item) -> House:
    """A square room with the items."""
    return room_house(list(items), ROOM_M, ROOM_M)


def clip_of(*things: Thing, frames: int = 1, eye=(1.0, 1.5, 1.0), facts: Any = None) -> Clip:
    """A clip of equal frames from an eye that looks along +z."""
    pose = np.eye(4)
    pose[:3, 3] = eye
    table = {"world_from_camera_opencv": pose.tolist(), "instances": [], "width_px": 100} | (
        facts or {}
    )
    view = made_view(table)
    house = house_of(*(t.item for t in things))
    return Clip("clip", [view] * frames, house, things)


def drafts(kind: str, clip: Clip):
    """Questions of one kind before any is chosen."""
    return list(KIND[kind].drafts(clip, random.Random(0)))
