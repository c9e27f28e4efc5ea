"""Ceilings under sloped walls, staircases and cut-outs."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import trimesh

from pbrs_farm.core.house import House, ItemKind
from pbrs_farm.geometry.roofs import roof_over
from pbrs_farm.read.sweethome3d.home import read_home
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, ROOM, home_xml, piece, sh3d

GABLE = """
<wall id='s0' wallAtEnd='g0' xStart='0' yStart='300' xEnd='0' yEnd='0' thickness='10' height='150'/>
<wall id='g0' wallAtStart='s0' wallAtEnd='g1' xStart='0' yStart='0' xEnd='200' yEnd='0' thickness='10' height='150' heightAtEnd='300'/>
<wall id='g1' wallAtStart='g0' wallAtEnd='s1' xStart='200' yStart='0' xEnd='400' yEnd='0' thickness='10' height='300' heightAtEnd='150'/>
<wall id='s1' wallAtStart='g1' wallAtEnd='h0' xStart='400' yStart='0' xEnd='400' yEnd='300' thickness='10' height='150'/>
<wall id='h0' wallAtStart='s1' wallAtEnd='h1' xStart='400' yStart='300' xEnd='200' yEnd='300' thickness='10' height='150' heightAtEnd='300'/>
<wall id='h1' wallAtStart='h0' wallAtEnd='s0' xStart='200' yStart='300' xEnd='0' yEnd='300' thickness='10' height='300' heightAtEnd='150'/>
"""


def read(body: str, room: str = ROOM, obj: bytes = BOX_OBJ) -> House:
    return read_home(sh3d(home_xml(body, room=room), {"1": obj}), "test.sh3d")


def ceiling(house: House, number: int = 0) -> trimesh.Trimesh:
    items = [i for i in house.items if i.kind is ItemKind.CEILING]
    s = items[number].surfaces[0]
    return trimesh.Trimesh(s.positions, s.faces, process=False)


def test_a_ceiling_follows_a_gable() -> None:
    mesh = ceiling(read(GABLE))
    # Two slopes from 1.5 m at the walls' inner faces to 3 m at the ridge 1.95 m away.
    assert mesh.area == pytest.approx(2 * 2.9 * math.hypot(1.95, 1.5), rel=1e-5)
    assert mesh.bounds[1, 1] == pytest.approx(3.0, abs=0.01)
    assert (mesh.face_normals[:, 1] < 0).all()


def test_a_room_under_a_gable_is_as_high_as_its_ridge() -> None:
    (room,) = read(GABLE).rooms
    assert room.ceiling_y == pytest.approx(3.0, abs=0.01)


def test_a_gable_over_a_room_with_a_niche_keeps_its_ridge() -> None:
    niche = ROOM.replace(
        "<point x='395' y='5'/>",
        "<point x='250' y='5'/><point x='250' y='-2'/><point x='300' y='-2'/><point x='300' y='5'/>"
        "<point x='395' y='5'/>",
    )
    mesh = ceiling(read(GABLE, room=niche))
    plan = 3.9 * 2.9 + 0.5 * 0.07
    assert mesh.area == pytest.approx(plan * math.hypot(1.95, 1.5) / 1.95, rel=5e-3)
    assert mesh.bounds[1, 1] == pytest.approx(3.0, abs=0.01)


def test_a_flat_ceiling_stays_flat_under_a_gable() -> None:
    mesh = ceiling(read(GABLE, room=ROOM.replace("<room ", "<room ceilingFlat='true' ")))
    assert np.ptp(mesh.vertices[:, 1]) == 0


def test_a_valley_is_cut_by_its_plan() -> None:
    ring = np.array([[0.0, 0], [2, 0], [4, 0], [4, 3], [2, 3], [0, 3]])
    heights = np.array([3.0, 2, 3, 3, 2, 3])
    roof = roof_over([ring], heights)
    assert np.array_equal(roof.heights, heights)
    assert len(roof.faces) == 4


STOREYS = """
<level id='0' elevation='0' floorThickness='12' height='250'/>
<level id='1' elevation='262' floorThickness='12' height='250'{}/>
"""
ROOMS = ROOM.replace("<room ", "<room level='0' ") + ROOM.replace("<room ", "<room level='1' ")
STAIRS = piece("level='0' height='262' staircaseCutOutShape='M0,0 v1 h1 v-1 z'")


def test_a_staircase_cuts_the_ceiling_and_the_floor_above() -> None:
    house = read(STOREYS.format("") + STAIRS, room=ROOMS)
    area = {
        i.id: trimesh.Trimesh(i.surfaces[0].positions, i.surfaces[0].faces).area
        for i in house.items
        if i.kind in (ItemKind.FLOOR, ItemKind.CEILING)
    }
    whole = 3.9 * 2.9
    assert area["floor_0_0"] == pytest.approx(whole, rel=1e-5)
    assert area["ceiling_0_0"] == pytest.approx(whole - 2, rel=1e-5)
    assert area["floor_1_0"] == pytest.approx(whole - 2, rel=1e-5)
    assert area["ceiling_1_0"] == pytest.approx(whole, rel=1e-5)


def test_no_sky_through_a_staircase_to_a_hidden_level() -> None:
    house = read(STOREYS.format(" visible='false'") + STAIRS, room=ROOMS)
    assert ceiling(house).area == pytest.approx(3.9 * 2.9, rel=1e-5)


WALL = "<wall id='a' xStart='0' yStart='0' xEnd='400' yEnd='0' thickness='20'/>"


def door(attributes: str = "", y: float = 0.0) -> str:
    return piece(
        f"{attributes} catalogId='eTeks#door' x='200' y='{y}' width='100' depth='30' height='200'"
        " wallCutOutOnBothSides='true'",
        tag="doorOrWindow",
    )


def cutter_plan(house: House) -> tuple[np.ndarray, np.ndarray]:
    positions = house.openings[0].cutter.positions
    return positions.min(0), positions.max(0)


def test_a_door_cuts_its_rectangle_through_both_faces() -> None:
    house = read(WALL + door())
    low, high = cutter_plan(house)
    assert low[[0, 1]] == pytest.approx([1.5, 0.0], abs=1e-5)
    assert high[[0, 1]] == pytest.approx([2.5, 2.0], abs=1e-5)
    assert low[2] < -0.1
    assert high[2] > 0.1
    assert high[2] - low[2] < 0.35
    opening = house.openings[0]
    assert opening.item_id == "piece_0"
    assert np.abs(opening.normal) == pytest.approx([0, 0, 1])
    assert shapely.Polygon(opening.quad[:, :2]).area == pytest.approx(2.0, rel=1e-5)


def test_a_cutter_of_any_outline_is_a_closed_solid() -> None:
    for shape in ("M0,0 v1 h1 v-1 z", "M0,1 v-0.8 a0.5,0.2 0 1,1 1,0 v0.8 z",
                  "M0,0.5 a0.5,0.5 0 1,0 1,0 a0.5,0.5 0 1,0 -1,0 z", "M0,0 L1,0 L.5,.5 L1,1 L0,1 z"):  # fmt: skip
        cutter = read(WALL + door(f"cutOutShape='{shape}'")).openings[0].cutter
        mesh = trimesh.Trimesh(cutter.positions, cutter.faces)
        assert mesh.is_watertight
        assert mesh.volume > 0


def test_a_round_door_is_round_at_its_top() -> None:
    cutter = (
        read(WALL + door("cutOutShape='M0,1 v-0.5 a0.5,0.5 0 1,1 1,0 v0.5 z'")).openings[0].cutter
    )
    top = cutter.positions[cutter.positions[:, 1] > 1.99]
    assert len(top)
    assert np.abs(top[:, 0] - 2.0).max() < 0.15


def test_a_door_cuts_both_walls_it_touches() -> None:
    second = "<wall id='b' xStart='0' yStart='20' xEnd='400' yEnd='20' thickness='20'/>"
    low, high = cutter_plan(read(WALL + second + door(y=10.0)))
    assert low[2] < -0.1
    assert high[2] > 0.3


def test_a_door_leaves_the_wall_behind_another_room_alone() -> None:
    far = "<wall id='b' xStart='0' yStart='60' xEnd='400' yEnd='60' thickness='20'/>"
    _, high = cutter_plan(read(WALL + far + door()))
    assert high[2] < 0.3


def test_a_door_cuts_the_baseboard_too() -> None:
    board = "<baseboard attribute='rightSideBaseboard' thickness='3' height='7'/>"
    wall = WALL.replace("/>", f">{board}</wall>")
    _, high = cutter_plan(read(wall + door("", y=-1.0).replace("depth='30'", "depth='12'")))
    assert high[2] > 0.13


def test_a_mirrored_door_mirrors_its_cut_out() -> None:
    half = "cutOutShape='M0,0 v1 h0.5 v-1 z'"
    low, high = cutter_plan(read(WALL + door(half + " modelMirrored='true'")))
    assert [low[0], high[0]] == pytest.approx([2.0, 2.5], abs=1e-5)


def test_a_door_in_no_wall_cuts_nothing_and_is_noted() -> None:
    house = read(WALL + door(y=150.0))
    assert not house.openings
    assert any(n.kind == "opening-without-wall" for n in house.notes)
