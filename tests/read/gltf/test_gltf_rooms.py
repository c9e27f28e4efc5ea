from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.repair_house import repair
from tests.read.gltf.gltf_scenes import Scene, area, read, two_rooms


def test_rooms_are_the_pieces_of_floor_that_walls_part() -> None:
    house = read(two_rooms())
    assert [r.id for r in house.rooms] == ["0_0", "0_1"]
    assert [area(r.polygon) for r in house.rooms] == pytest.approx([12.0, 6.0], abs=0.05)
    assert house.rooms[0].floor_y == 0
    assert house.rooms[0].ceiling_y == pytest.approx(2.6)
    assert house.rooms[0].has_ceiling


@pytest.mark.parametrize(("thickness", "gap", "n"), [(0.0, 1.0, 2), (0.15, 0.9, 2), (0.15, 1.8, 1)])
def test_rooms_end_at_a_doorway_as_high_as_the_walls(thickness: float, gap: float, n: int) -> None:
    s = two_rooms()
    s.nodes.pop()
    for k, (low, high) in enumerate([(0.0, 1.0), (1.0 + gap, 3.0)]):
        side = [[4, 0, high], [4, 0, low], [4, 2.6, low], [4, 2.6, high]]
        corners = [4 - thickness / 2, 0, low], [4 + thickness / 2, 2.6, high]
        s.node(f"Wall.{k}", mesh=s.box(*corners) if thickness else s.mesh([side]))
    house = read(s)
    assert len(house.rooms) == n
    if n == 2:
        areas = [area(r.polygon) for r in house.rooms]
        assert areas == pytest.approx([12.0, 6.0], abs=0.25)


def test_an_open_door_in_a_wide_gap_parts_two_rooms() -> None:
    s = two_rooms()
    s.nodes.pop()
    for k, (low, high) in enumerate([(0.0, 0.6), (2.2, 3.0)]):
        s.node(f"Wall.{k}", mesh=s.box([3.92, 0, low], [4.08, 2.6, high]))
    # Two leaves, each swung into the large room.
    for k, z in enumerate((0.62, 2.14)):
        s.node(f"Door.{k}", mesh=s.box([3.2, 0, z], [4.0, 2, z + 0.04]))
    assert len(read(s).rooms) == 2


def test_a_room_beside_a_ceiling_has_none_and_takes_its_height_from_the_walls() -> None:
    s = two_rooms()
    s.nodes[1]["mesh"] = s.mesh([[[0, 2.4, 0], [4.05, 2.4, 0], [4.05, 2.4, 3], [0, 2.4, 3]]])
    large, small = read(s).rooms
    assert (large.has_ceiling, small.has_ceiling) == (True, False)
    assert (large.ceiling_y, small.ceiling_y) == pytest.approx((2.4, 2.6))


def test_a_shell_of_planar_walls_becomes_walls_that_repair_can_thicken() -> None:
    s = two_rooms()
    s.node("Window", mesh=s.box([1, 1, -0.05], [2, 2, 0.05]))
    s.node("Door", mesh=s.box([3.97, 0, 1], [4.03, 2, 2]))
    house = read(s)
    outer = [i for i in house.items if i.name == "Walls outer"]
    assert [i.n_faces for i in outer] == [2, 2, 2, 2]
    assert len({i.id for i in house.items}) == len(house.items)
    window, door = sorted(house.openings, key=lambda o: not o.is_window)
    assert (window.is_cut, door.is_cut) == (False, True)
    repaired, report = repair(house, RepairFields())
    assert report.structure.n_walls_thickened == 5
    assert report.structure.n_openings_cut == 2
    assert not report.structure.left_as_is
    assert [r.enclosure for r in report.rooms] == ["closed", "closed"]
    wall = next(i for i in repaired.items if i.id == outer[0].id)
    assert np.ptp(wall.bounds[:, 2]) == pytest.approx(0.1, abs=0.02)


def test_rooms_of_the_polygon_file_win() -> None:
    rooms = {
        "rooms": [{"name": "Hall", "polygon": [[0, 0], [0, 3], [6, 3], [6, 0]], "ceiling_y": 2.4}]
    }
    house = read(two_rooms(), rooms=json.dumps(rooms).encode())
    (room,) = house.rooms
    assert (room.name, room.ceiling_y, room.floor_y) == ("Hall", 2.4, 0.0)
    assert area(room.polygon) == pytest.approx(18.0, abs=1e-6)  # turned counter-clockwise


@pytest.mark.parametrize(
    ("rooms", "place"),
    [
        ({}, "rooms"),
        ({"rooms": []}, "rooms"),
        ({"rooms": [3]}, "rooms[0]"),
        ({"rooms": [{}]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1]]}]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1], [1, 0], [0, 1]]}]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1], [1e9, 0]]}]}, "rooms[0].polygon[2][0]"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1], ["a", 0]]}]}, "rooms[0].polygon[2][0]"),
        ({"rooms": [{"polygon": [[0, 0], [0, 1], [1, 0]], "floor_y": "x"}]}, "rooms[0].floor_y"),
    ],
)  # fmt: skip
def test_a_wrong_room_file_is_refused_naming_the_room(rooms: Any, place: str) -> None:
    with pytest.raises(BadHouse) as caught:
        read(two_rooms(), rooms=json.dumps(rooms).encode())
    assert (caught.value.file, caught.value.place) == ("scene.rooms.json", place)


def test_a_scan_of_one_mesh_is_refused_as_one() -> None:
    s = Scene()
    s.node("mesh_0", mesh=s.box([0, 0, 0], [6, 0.3, 4]))
    with pytest.raises(BadHouse, match="has no floor: one mesh without a known name, as in a scan"):
        read(s)
