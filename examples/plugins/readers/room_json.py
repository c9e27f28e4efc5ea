"""A reader of a custom format: a .room file, JSON with the size of a box-shaped room.

{"width": 4, "depth": 3, "height": 2.5}
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from pbrs_farm.plugin import (
    NYU40_NAMES,
    BadHouse,
    Format,
    GivenFile,
    House,
    Item,
    ItemKind,
    Level,
    Material,
    ReadFields,
    Room,
    Source,
    boxes_surface,
    sha256,
)


def read_room(given: GivenFile, _fields: ReadFields) -> House:
    """The house; raises BadHouse with file and place if the file is invalid."""
    path = given.path
    try:
        size = json.loads(path.read_text())
        w, d, h = (float(size[name]) for name in ("width", "depth", "height"))
    except (ValueError, KeyError, TypeError) as error:
        raise BadHouse(path, "", f"is not a room: {error}") from None
    t = 0.1
    walls = [
        ((-t, 0, -t), (w + t, h, 0)), ((-t, 0, d), (w + t, h, d + t)),
        ((-t, 0, 0), (0, h, d)), ((w, 0, 0), (w + t, h, d)),
    ]  # fmt: skip
    items = [_item(f"wall_{k}", ItemKind.WALL, "wall", box) for k, box in enumerate(walls)]
    items.append(_item("floor", ItemKind.FLOOR, "floor", ((-t, -t, -t), (w + t, 0, d + t))))
    items.append(
        _item("ceiling", ItemKind.CEILING, "ceiling", ((-t, h, -t), (w + t, h + t, d + t)))
    )
    items.append(_item("table", ItemKind.OBJECT, "table", ((w / 3, 0, d / 3), (w / 2, 0.7, d / 2))))
    plan = np.array([[0, 0], [0, d], [w, d], [w, 0]], np.float64)
    data = path.read_bytes()
    return House(
        id=path.stem, name=path.stem, source=Source("room", path.name, sha256(data)),
        levels=(Level("0", "", 0.0, h),), rooms=(Room("0_0", "Room", "0", plan, 0.0, h),),
        items=tuple(items), materials=(Material("paint", diffuse=(0.8, 0.8, 0.75)),), textures={},
    )  # fmt: skip


def _item(name: str, kind: ItemKind, label: str, box: Any) -> Item:
    surface = boxes_surface(name, [box], 0)
    room = "0_0" if kind is ItemKind.OBJECT else None
    return Item(name, name, kind, "0", (surface,), nyu40=NYU40_NAMES.index(label), room_id=room)


# Target of the entry point, of the same type as the entry at the end of each format of pbrs_farm.
FORMAT = Format(
    kind="room", title="Room", files=".room", brings="a box-shaped room and a table",
    where="written by hand", licence="yours", suffixes=(".room",), read=read_room,
)  # fmt: skip
