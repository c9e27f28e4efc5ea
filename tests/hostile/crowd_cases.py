"""Hundreds of parts where a home has a few: leaves, floors, rooms, corners. No effects until written."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from tests.hostile.case import Case, Place, Words, home, run
from tests.hostile.shape_cases import BOX, room_xml, walls
from tests.hostile.sound_inputs import CHAIRS, archive, chair, glb, scene, suncg
from tests.read.suncg.suncg_root import room, write_room


def cases() -> Iterator[Case]:
    """glTF, then SUNCG, then Sweet Home 3D."""
    yield home("crowd/leaves_60_000", "bounds", "plant.glb", _leaves)
    yield home("crowd/floors_300", "bounds", "floors.glb", _floors)
    yield Case("crowd/rooms_json_400", "bounds", _rooms_json)
    yield home("crowd/extension_unread", "silence", "bad.glb", _extension, lossy=True)
    for n in (60, 300):
        yield Case(f"crowd/suncg_rooms_{n}", "bounds", partial(_suncg, n))
    yield home("crowd/cogs_8", "bounds", "cogs.sh3d", _cogs)
    yield home("crowd/pieces_10_001", "bounds", "books.sh3d", _pieces)
    yield home("crowd/all_levels_hidden", "format", "hidden.sh3d", _hidden)


def _leaves() -> bytes:
    """A plant of 60,000 triangles, 30,000 loose leaves, under a meaningless name."""
    s = scene()
    rng = np.random.default_rng(0)
    places = rng.uniform((1, 0, 1), (2, 1.9, 2), (30_000, 1, 3))
    s.node("Object_7", mesh=s.mesh((places + rng.uniform(0, 0.02, (30_000, 4, 3))).tolist()))
    return s.glb()


def _floors() -> bytes:
    s = scene()
    for k in range(300):
        x = 0.01 * k
        s.node("floor", mesh=s.mesh([[[x, 0, 0], [x, 0, 3], [x + 3, 0, 3], [x + 3, 0, 0]]]))
    return s.glb()


def _rooms_json(place: Place) -> list[Words]:
    rows = [{"polygon": [[0.01 * k, 0], [5, 0], [5, 3], [0.01 * k, 3]]} for k in range(400)]
    path = place.folder / "bad.glb"
    path.write_bytes(glb())
    (place.folder / "bad.rooms.json").write_text(json.dumps({"rooms": rows}))
    return [run(place, path)]


def _extension() -> bytes:
    return glb(lambda d: d.update(extensionsUsed=["KHR_materials_sheen"]))


def _suncg(n: int, place: Place) -> list[Words]:
    def edit(plain: dict[str, Any]) -> None:
        nodes = plain["levels"][0]["nodes"]
        nodes += [room(f"0_{k}", f"fr_0rm_{k}", [], []) for k in range(100, 100 + n)]

    house = suncg(place.folder, edit)
    for k in range(100, 100 + n):
        x = 0.01 * (k - 100)
        write_room(house.parent.parent, f"fr_0rm_{k}", f"0_{k}", x, x + 3, {})
    return [run(place, house)]


def _cogs() -> bytes:
    """Eight round rooms of 990 corners each."""
    angles = [2 * math.pi * k / 990 for k in range(990)]
    radii = [300 + 20 * (k % 2) for k in range(990)]
    rooms = "".join(
        room_xml([(x + r * math.cos(a), 500 + r * math.sin(a)) for r, a in zip(radii, angles)])
        for x in range(500, 8500, 1000)
    )
    return archive(chair(1, 500, 500), room=rooms)


def _pieces() -> bytes:
    body = "".join(chair(k, 50 + k % 300, 50 + k % 200) for k in range(10_001))
    return archive(walls(BOX) + body)


def _hidden() -> bytes:
    level = "<level id='L' elevation='0' height='250' viewable='false'/>"
    return archive(level + CHAIRS, room=room_xml(BOX, "Hall", "level='L'"))
