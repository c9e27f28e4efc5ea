"""A user's plan: room polygons become closed walls, doors and windows find their walls."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Enclosure, geometry_from_house
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    Plan,
    PlanRoom,
    PlanWall,
    RoomType,
    turned_upright,
)
from pbrs_farm.generate.generated_home import furnish_storeys
from pbrs_farm.generate.plans.plan_files import plan_from_file
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import repair


def square(x: float, z: float, w: float, d: float) -> list[list[float]]:
    return [[x, z], [x + w, z], [x + w, z + d], [x, z + d]]


TOUCHING: dict[str, Any] = {
    "rooms": [
        {"type": "living", "name": "Salon", "polygon": square(0, 0, 5, 4)},
        {"type": "bedroom", "polygon": square(5, 0, 3, 4)},
        {"type": "hall", "polygon": square(0, 4, 8, 1.5)},
    ],
    "doors": [{"at": [0, 4.7], "entrance": True}, {"at": [2, 4]}, {"at": [6, 4]}],
    "windows": [{"at": [2.5, 0], "width": 1.6}, {"at": [6.5, 0]}],
}
APART = TOUCHING | {
    "rooms": [
        {"type": "living", "polygon": square(0, 0, 4.9, 3.9)},
        {"type": "bedroom", "polygon": square(5, 0, 3, 3.9)},
        {"type": "hall", "polygon": square(0, 4, 8, 1.5)},
    ]
}
SKEWED = TOUCHING | {
    "rooms": [
        *TOUCHING["rooms"][:1],
        {"type": "bedroom", "polygon": [[5, 0], [8, 0], [9, 4], [5, 4]]},
        {"type": "hall", "polygon": square(0, 4, 9, 1.5)},
    ]
}


GEOJSON: dict[str, Any] = {"type": "FeatureCollection"}
HATCH = {"properties": {"kind": "hatch"}, "geometry": {"type": "Point", "coordinates": [2, 4]}}


def plan(folder: Path, value: object) -> Plan:
    path = folder / "plan.json"
    path.write_text(value if isinstance(value, str) else json.dumps(value))
    return plan_from_file(path).plan


@pytest.mark.quick(1)
@pytest.mark.parametrize("value", [TOUCHING, APART, SKEWED], ids=["touching", "apart", "skewed"])
def test_the_home_of_a_plan_is_closed(tmp_path: Path, value: object) -> None:
    upright = turned_upright(plan(tmp_path, value))
    home = furnish_storeys([upright], ((),), EMPTY, "plan", seed=1)
    house = read_home(home.data, "home.sh3d")
    assert len(house.openings) == 5
    repaired, report = repair(
        house, Recipe().repair, occluder_from=lambda some: Caster(geometry_from_house(some))
    )
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert all(room.enclosure is Enclosure.CLOSED for room in repaired.rooms)


def test_doors_join_rooms_and_windows_look_out(tmp_path: Path) -> None:
    drawn = plan(tmp_path, TOUCHING)
    entrance, first, _second, window, _other = drawn.openings
    assert (entrance.kind, entrance.other) == (OpeningKind.ENTRANCE, None)
    assert {drawn.rooms[r or 0].type for r in (first.room, first.other)} == {
        RoomType.LIVING, RoomType.HALL,
    }  # fmt: skip
    assert (window.other, drawn.walls[window.wall].is_outer) == (None, True)


def test_walls_take_the_room_between_rooms(tmp_path: Path) -> None:
    inner = [w for w in plan(tmp_path, APART).walls if not w.is_outer]
    assert {round(w.thickness, 3) for w in inner} == {0.1}
    rooms = plan(tmp_path, APART).rooms
    assert rooms[0].area == pytest.approx(4.9 * 3.9, abs=0.01)


def test_geojson_gives_the_same_plan(tmp_path: Path) -> None:
    rooms = [
        {"properties": {"type": r["type"], "name": r.get("name")},
         "geometry": {"type": "Polygon", "coordinates": [[*r["polygon"], r["polygon"][0]]]}}
        for r in TOUCHING["rooms"]
    ]  # fmt: skip
    points = [
        {"properties": {"kind": kind}, "geometry": {"type": "Point", "coordinates": coordinates}}
        for kind, coordinates in (("entrance", [0, 4.7]), ("door", [2, 4]), ("window", [6.5, 0]))
    ]
    drawn = plan(tmp_path, {"type": "FeatureCollection", "features": rooms + points})
    assert drawn.walls == plan(tmp_path, TOUCHING).walls
    assert [o.kind.value for o in drawn.openings] == ["entrance", "door", "window"]


def test_a_turned_plan_is_turned_back(tmp_path: Path) -> None:
    upright = plan(tmp_path, TOUCHING)
    cos, sin = math.cos(0.5), math.sin(0.5)

    def at(p: Any) -> Any:
        return p[0] * cos - p[1] * sin, p[0] * sin + p[1] * cos

    walls = tuple(PlanWall(at(w.start), at(w.end), w.thickness) for w in upright.walls)
    rooms = tuple(PlanRoom(r.type, r.name, tuple(map(at, r.polygon))) for r in upright.rooms)
    back = turned_upright(Plan(rooms, walls, upright.openings, 2.5))
    for turned_wall, upright_wall in zip(back.walls, upright.walls, strict=True):
        np.testing.assert_allclose(turned_wall.start, upright_wall.start, atol=0.02)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("[", "plan.json: line 1 column 2: not valid JSON"),
        ({}, "rooms: is missing.*doors"),
        ({"rooms": []}, "rooms: expected 1 values or more, got 0"),
        (
            {"rooms": [{"type": "pool", "polygon": square(0, 0, 2, 2)}]},
            "room 1, type: expected 'living'.*got \"pool\"",
        ),
        (
            {"rooms": [{"type": "hall", "polygon": [[0, 0], [1, "x"]]}]},
            r"room 1, polygon\[1\]\[1\]: expected a number",
        ),
        ({"rooms": [{"type": "hall", "polygon": [[0, 0], [2, 2], [2, 0], [0, 2]]}]}, "crosses"),
        ({"rooms": [{"type": "hall", "polygon": square(0, 0, 900, 2)}]}, "over 200 m wide"),
        ({"rooms": [TOUCHING["rooms"][0]] * 2}, "overlaps 'Salon' by 20.00 m2"),
        (TOUCHING | {"doors": [{"at": [2, 2]}]}, "door 1: is [0-9.]+ m from the nearest wall"),
        (TOUCHING | {"doors": [{}]}, "door 1, at: is missing"),
        (TOUCHING | {"windows": [{"at": [2, 0], "width": 9}]}, "window 1: is wider than its wall"),
        (TOUCHING | {"windows": [{"at": [2, 0], "height": 3}]}, "higher than the room"),
        (TOUCHING | {"height": 1}, "height: expected 2 or more, got 1"),
        (TOUCHING | {"windows": [{"at": [2, 0], "sill": None}]}, "window 1, sill: expected a num"),
        ({"rooms": [{"type": "hall", "polygon": [[0, 0], [1, 1]]}]}, "room 1, polygon: expected 3"),
        ({"rooms": [{"type": "hall", "polygon": square(2, 2, 0, 0)}]}, "room 1: has 0.00 m2|cross"),
        ({"rooms": [{"type": "hall", "polygon": square(1e6, 0, 2, 2)}]}, "room 1, polygon.*100000"),
        (GEOJSON | {"features": [1]}, "feature 1: expected an object"),
        (GEOJSON | {"features": [{"geometry": {"type": "Line"}}]}, "feature 1, properties: is mis"),
        (GEOJSON | {"features": [HATCH]}, "feature 1, kind: expected 'door'"),
    ],
)
def test_a_plan_that_cannot_be_built_is_refused(
    tmp_path: Path, value: object, message: str
) -> None:
    with pytest.raises(BadInput, match=message) as caught:
        plan(tmp_path, value)
    assert "\n" not in str(caught.value)
