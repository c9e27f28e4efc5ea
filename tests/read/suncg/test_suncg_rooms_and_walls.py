from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE, item, material_of, outward_volume


def test_rooms_have_the_polygon_between_their_walls(house: House) -> None:
    room = house.room("0_0")
    x, z = room.polygon.T
    assert 0.5 * (x @ np.roll(z, -1) - z @ np.roll(x, -1)) == pytest.approx(12.0, abs=1e-3)
    assert np.allclose([x.min(), z.min(), x.max(), z.max()], [0, 0, 4, 3], atol=1e-4)
    assert (room.floor_y, room.ceiling_y) == pytest.approx((0.05, 2.69))
    assert (room.name, room.types) == ("Bedroom", ("Bedroom",))
    assert room.has_ceiling
    assert not house.room("0_1").has_ceiling
    assert [level.id for level in house.levels] == ["0", "1"]


def test_an_l_shaped_room_keeps_its_corner(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    from tests.read.suncg.suncg_meshes import Obj

    obj = Obj("x.mtl")
    obj.begin(group="Floor#0_1", material="surface")
    obj.box((4.1, 0, 0.0), (7.0, 0.05, 1.0))
    obj.box((4.1, 0, 1.0), (5.0, 0.05, 3.0))
    (tmp_path / f"room/{HOUSE}/fr_0rm_1f.obj").write_text(obj.text())
    polygon = read_suncg(tmp_path, HOUSE, ReadFields()).room("0_1").polygon
    x, z = polygon.T
    assert len(polygon) == 6
    assert 0.5 * (x @ np.roll(z, -1) - z @ np.roll(x, -1)) == pytest.approx(2.9 + 1.8, abs=0.01)


def test_released_walls_stay_two_closed_slabs(house: House) -> None:
    wall = item(house, "0_0w2")
    inside = tuple(s for s in wall.surfaces if s.name.startswith("WallInside"))
    hole = (2.88 - 1.52) * (2.28 - 0.92)
    assert outward_volume(inside) == pytest.approx((4.19 * 2.735 - hole) * 0.05, rel=1e-4)
    assert outward_volume(wall.surfaces) == pytest.approx((4.19 * 2.735 - hole) * 0.1, rel=1e-4)


def test_wall_texture_area_is_surface_area_in_metres(house: House) -> None:
    for surface in item(house, "0_0w2").surfaces:
        assert surface.uvs is not None
        p, uv = surface.positions[surface.faces], surface.uvs[surface.faces]
        area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()
        a, b = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
        assert np.abs(a[0] * b[1] - a[1] * b[0]).sum() == pytest.approx(area, rel=1e-4)


def test_walls_with_a_default_paper_are_white_despite_their_colour(house: House) -> None:
    inside = material_of(house, "0_0w2", "WallInside#0_0_2 in")
    outside = material_of(house, "0_0w2", "WallOutside#0_0_2 out")
    edge = material_of(house, "0_0w2", "WallInside#0_0_2 edge")
    assert inside.is_default
    assert outside.is_default
    assert outside.diffuse == (1, 1, 1)
    assert outside.texture_id is None
    assert not edge.is_default


def test_openings_are_the_holes_of_the_walls(house: House) -> None:
    by_item = {o.item_id: o for o in house.openings}
    assert set(by_item) == {"0_6", "0_7"}  # the second door is in no wall
    window, door = by_item["0_6"], by_item["0_7"]
    assert window.is_window
    assert not door.is_window
    assert np.allclose(window.quad.min(0), [1.52, 0.92, 3.0475], atol=1e-4)
    assert np.allclose(window.quad.max(0), [2.88, 2.28, 3.0475], atol=1e-4)
    assert np.allclose(np.abs(door.normal), [1, 0, 0])
    assert np.allclose(door.quad[:, 0], (4.0 + 4.095) / 2, atol=1e-4)  # between both rooms' walls
    assert outward_volume((door.cutter,)) > 0
    assert window.is_cut
    assert door.is_cut
    plug = door.cutter.positions
    assert np.allclose([plug[:, 0].min(), plug[:, 0].max()], [4.0, 4.095], atol=1e-4)
    assert plug[:, 2].min() < 1.02
    assert plug[:, 2].max() > 1.98


def test_a_wall_without_the_hole_is_left_for_repair_to_cut(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    suncg_root.write_room(tmp_path, "fr_0rm_1", "0_1", 4.095, 7.0, {})
    door = next(o for o in read_suncg(tmp_path, HOUSE, ReadFields()).openings if not o.is_window)
    assert not door.is_cut
    assert np.allclose(door.quad.min(0)[1:], [0.0, 1.02], atol=1e-4)


def test_a_box_has_six_faces_with_materials_by_position(house: House) -> None:
    box = item(house, "0_11")
    assert np.allclose(box.bounds, [[1.8, 0.05, 1.7], [2.2, 0.55, 2.3]])
    assert outward_volume(box.surfaces) == pytest.approx(0.4 * 0.5 * 0.6, rel=1e-5)
    reds = {s.name: round(house.materials[s.material].diffuse[0] * 255) for s in box.surfaces}
    assert reds == {"+y": 0, "-y": 1, "+x": 2, "-x": 3, "+z": 4, "-z": 204}
    top = next(s for s in box.surfaces if s.name == "+y")
    assert top.uvs is not None
    assert np.allclose(sorted(top.uvs.max(0)), [0.4, 0.6])


def test_objects_belong_to_the_room_that_lists_them(house: House) -> None:
    assert item(house, "0_2").room_id == "0_0"
    assert item(house, "0_8").room_id == "0_1"
    assert item(house, "1_0").room_id is None


def test_hidden_parts_are_left_out(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"][0] |= {"hideWalls": 1}
    plain["levels"][0]["nodes"][1] |= {"hideFloor": True, "hideCeiling": "0"}
    plain["levels"][0]["nodes"][12]["hideFloor"] = 1
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    ids = {i.id for i in house.items}
    assert not ids & {"0_0w0", "0_0w2", "0_1f", "0_12"}
    assert "0_1c" in ids
    room = house.room("0_1")
    assert not room.has_floor
    assert np.allclose(room.polygon.min(0), [4.095, 0], atol=1e-3)  # between the walls
