from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind, Surface
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("suncg")
    suncg_root.write_root(folder)
    return folder


@pytest.fixture(scope="module")
def house(root: Path) -> House:
    return read_suncg(root, HOUSE, ReadFields())


def item(house: House, item_id: str) -> Item:
    return next(i for i in house.items if i.id == item_id)


def look(house: House, item_id: str, surface: str) -> Material:
    found = next(s for s in item(house, item_id).surfaces if s.name == surface)
    return house.materials[found.material]


def texture_name(house: House, material: Material) -> str:
    assert material.texture_id is not None
    return house.textures[material.texture_id].name


def outward_volume(surfaces: tuple[Surface, ...]) -> float:
    """Signed volume by the divergence theorem: positive when closed faces look outwards."""
    p = np.concatenate([s.positions[s.faces] for s in surfaces]).astype(np.float64)
    return float(np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


def test_every_valid_node_becomes_its_items_in_order(house: House) -> None:
    assert [i.id for i in house.items] == [
        "0_0f", "0_0c", "0_0w0", "0_0w2", "0_0w3", "0_0w4",
        "0_1f", "0_1w0", "0_1w2", "0_1w3", "0_1w4",
        "0_2", "0_3", "0_4", "0_5", "0_6", "0_7", "0_8", "0_9", "0_11", "0_12", "0_15", "0_16",
        "1_0",
    ]  # fmt: skip


def test_pretty_and_compact_json_give_the_same_house(root: Path, tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path, pretty=True)
    compact, pretty = (read_suncg(r, HOUSE, ReadFields()) for r in (root, tmp_path))
    assert (
        bundle_from_house(compact)[0].replace(
            compact.source.sha256.encode(), pretty.source.sha256.encode()
        )
        == (bundle_from_house(pretty)[0])
    )


def test_reading_twice_gives_the_same_bytes(root: Path, house: House) -> None:
    assert bundle_from_house(read_suncg(root, HOUSE, ReadFields())) == bundle_from_house(house)


def test_the_house_survives_the_bundle(house: House) -> None:
    bundle = bundle_from_house(house)
    assert bundle_from_house(house_from_bundle(*bundle)) == bundle


def test_labels_and_kinds_come_from_the_users_table(house: House) -> None:
    got = {i.id: (i.kind, i.nyu40, i.name) for i in house.items}
    assert got["0_2"] == (ItemKind.OBJECT, 5, "office chair")
    assert got["0_4"] == (ItemKind.LAMP, 35, "floor lamp")
    assert got["0_6"] == (ItemKind.WINDOW, 9, "window")
    assert got["0_7"] == (ItemKind.DOOR, 8, "door")
    assert got["0_9"][:2] == (ItemKind.PLANT, 40)
    assert got["1_0"][:2] == (ItemKind.PERSON, 31)
    assert got["0_0f"][:2] == (ItemKind.FLOOR, 2)
    assert got["0_0c"][:2] == (ItemKind.CEILING, 22)
    assert got["0_0w3"][:2] == (ItemKind.WALL, 1)
    assert got["0_12"][:2] == (ItemKind.GROUND, 0)
    assert got["0_11"][:2] == (ItemKind.OBJECT, 0)


def test_without_active_column_persons_and_plants_are_still_known(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    table = tmp_path / "metadata/ModelCategoryMappingNewActive.csv"
    lines = [line.rsplit(",", 1)[0] for line in table.read_text().splitlines()]
    (tmp_path / "metadata/ModelCategoryMapping.csv").write_text("\n".join(lines))
    table.unlink()
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert item(house, "0_9").kind is ItemKind.PLANT
    assert item(house, "1_0").kind is ItemKind.PERSON


def test_a_model_that_is_not_active_is_removed_as_a_plant(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    table = tmp_path / "metadata/ModelCategoryMappingNewActive.csv"
    table.write_text(table.read_text().replace("chair,2,chair,,,1", "chair,2,chair,,,0"))
    assert item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_2").kind is ItemKind.PLANT


def test_objects_stand_where_their_column_major_transform_puts_them(house: House) -> None:
    assert np.allclose(item(house, "0_2").bounds, [[0.8, 0.05, 0.8], [1.2, 1.05, 1.2]])
    assert np.allclose(item(house, "0_15").bounds, [[2.7, 0.05, 1.7], [3.3, 1.55, 2.3]])
    # A quarter turn about +y takes the chair's back from -z to -x.
    back = next(s for s in item(house, "0_16").surfaces if s.name == "material_1")
    assert np.allclose([back.positions.min(0)[0], back.positions.max(0)[0]], [0.8, 0.85])
    assert np.allclose([back.positions.min(0)[2], back.positions.max(0)[2]], [1.8, 2.2])


def test_mirrored_nodes_keep_their_fronts_outside(house: House) -> None:
    plain, mirrored = item(house, "0_2"), item(house, "0_3")
    assert outward_volume(plain.surfaces) == pytest.approx(0.083, rel=1e-5)
    assert outward_volume(mirrored.surfaces) == pytest.approx(0.083, rel=1e-5)
    assert "mirrored" in mirrored.tags
    assert "mirrored" not in plain.tags
    for surface in mirrored.surfaces:
        assert surface.normals is not None
        p = surface.positions[surface.faces]
        face_normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        shading = surface.normals[surface.faces].mean(1)
        assert (np.einsum("ij,ij->i", face_normal, shading) > 0).all()


def test_normals_follow_the_inverse_transpose(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    slanted = suncg_root.house_json()
    m = np.eye(4)
    m[:3, :3] = suncg_slope() @ np.diag([2.0, 0.5, 1.0])
    slanted["levels"][0]["nodes"][2]["transform"] = m.T.reshape(-1).tolist()
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(slanted))
    for surface in item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_2").surfaces:
        p = surface.positions[surface.faces].astype(np.float64)
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        assert surface.normals is not None
        assert np.allclose(surface.normals[surface.faces[:, 0]], n, atol=1e-5)


def suncg_slope() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    c, s = np.cos(0.3), np.sin(0.3)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def test_a_wrong_isMirrored_is_noted_and_the_transform_believed(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"][2]["isMirrored"] = 1
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert "mirrored" not in item(house, "0_2").tags
    assert any(n.kind == "mirrored-differs" and "0_2" in n.place for n in house.notes)


def test_state_one_takes_the_variant_mesh(house: House) -> None:
    closed, opened = item(house, "0_7"), item(house, "0_8")
    assert np.ptp(closed.bounds, axis=0)[0] == pytest.approx(0.1, abs=1e-5)  # turned to the wall
    assert np.ptp(opened.bounds, axis=0)[2] == pytest.approx(0.95, abs=1e-5)


def test_materials_are_overridden_by_position(house: House) -> None:
    stone, orange = look(house, "0_15", "material_0"), look(house, "0_15", "material_1")
    assert texture_name(house, stone) == "stone.png"  # PNG before JPEG
    assert stone.diffuse == (1.0, 1.0, 1.0)
    assert orange.diffuse == (1.0, 128 / 255, 0.0)
    assert orange.texture_id is None
    both, same = look(house, "0_16", "material_0"), look(house, "0_16", "material_1")
    assert (texture_name(house, both), both.diffuse) == ("leaves.png", (128 / 255,) * 3)
    assert same.diffuse == (0.1, 0.2, 0.9)
    model = look(house, "0_2", "material_0")
    assert (texture_name(house, model), model.diffuse) == ("wood.jpg", (0.64, 0.64, 0.64))
    assert (model.specular, model.shininess) == ((0.1, 0.1, 0.1), 30.0)


def test_textures_keep_their_bytes_and_alpha_is_a_hole(root: Path, house: House) -> None:
    by_name = {t.name: t for t in house.textures.values()}
    assert by_name["wood.jpg"].data == (root / "texture/wood.jpg").read_bytes()
    assert by_name["wood.jpg"].media_type == "image/jpeg"
    assert look(house, "0_16", "material_0").alpha_cutout
    assert not look(house, "0_15", "material_0").alpha_cutout
    assert "stone.jpg" not in by_name


def test_glass_of_windows_is_a_pane_and_other_glass_is_glass(house: House, tmp_path: Path) -> None:
    assert look(house, "0_6", "material_1").kind is MaterialKind.PANE
    assert look(house, "0_6", "material_1").opacity == 0.5
    assert look(house, "0_6", "material_0").kind is MaterialKind.OPAQUE
    suncg_root.write_root(tmp_path)
    mtl = tmp_path / "object/chair/chair.mtl"
    mtl.write_text(mtl.read_text().replace("Ns 0\nd 1", "Ns 0\nd 0.5"))
    other = read_suncg(tmp_path, HOUSE, ReadFields())
    assert look(other, "0_2", "material_1").kind is MaterialKind.GLASS


def test_missing_things_are_notes_and_the_rest_goes_on(house: House) -> None:
    notes = {(n.kind, n.text.split()[0].rstrip(":")) for n in house.notes}
    assert notes == {
        ("missing-texture", "texture/gone.jpg"),
        ("unreadable-texture", "texture/broken.jpg"),
        ("unknown-type", "a"),
        ("missing-model", "object/nobody_has_this"),
        ("room-in-room", "lists"),
    }
    assert look(house, "0_5", "material_0").diffuse == (0.2, 0.3, 0.4)


def test_strict_makes_the_first_note_an_error(root: Path) -> None:
    with pytest.raises(BadHouse, match="Room 0_1"):
        read_suncg(root, HOUSE, ReadFields(strict=True))


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


def test_walls_with_a_default_paper_are_white_whatever_their_colour(house: House) -> None:
    inside = look(house, "0_0w2", "WallInside#0_0_2 in")
    outside = look(house, "0_0w2", "WallOutside#0_0_2 out")
    edge = look(house, "0_0w2", "WallInside#0_0_2 edge")
    assert inside.is_default
    assert outside.is_default
    assert outside.diffuse == (1, 1, 1)
    assert outside.texture_id is None
    assert not edge.is_default


def test_openings_are_the_holes_of_the_walls(house: House) -> None:
    by_item = {o.item_id: o for o in house.openings}
    assert set(by_item) == {"0_6", "0_7"}  # the second door stands in no wall
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


def test_lamps_have_lights_in_the_world_each_with_its_own_bulb(house: House) -> None:
    lamp = item(house, "0_4")
    point, spot = lamp.lights
    assert np.allclose(point.position, [0.3, 1.6, 2.5])
    assert (point.power, point.unit, point.share) == (60.0, PowerUnit.WATT, 1.0)
    assert spot.form is LightForm.SPOT
    assert (spot.cutoff_rad, spot.dropoff) == (1.57, 2.0)
    assert np.allclose(spot.direction, np.array([0, -1, 0.5]) / np.sqrt(1.25))
    for light in lamp.lights:
        (bulb,) = light.emitting
        surface = lamp.surfaces[bulb]
        assert house.materials[surface.material].kind is MaterialKind.BULB
        centre = (surface.positions.min(0) + surface.positions.max(0)) / 2
        assert np.allclose(centre, light.position, atol=1e-5)
        assert light.radius_m == pytest.approx((0.06 + 0.1 + 0.06) / 6, rel=1e-4)
    assert look(house, "0_4", "material_2").kind is MaterialKind.SHADE


def test_a_bulb_index_beyond_the_models_materials_leaves_the_bulb_to_repair(house: House) -> None:
    (light,) = item(house, "0_5").lights
    assert light.emitting == ()
    assert light.form is LightForm.LINE
    assert light.position_end is not None
    assert np.allclose([light.position, light.position_end], [[3.4, 0.65, 2.5], [3.6, 0.65, 2.5]])


def test_lights_turn_with_their_mirrored_lamp(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"][4]["transform"] = suncg_root.at(1, 0, 1, turn=1, mirror=True)
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    point, spot = item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_4").lights
    # (-0.2, 1.55, 0) mirrored in x, then a quarter turn: x goes to -z.
    assert np.allclose(point.position, [1.0, 1.55, 0.8])
    assert np.allclose(spot.direction, np.array([0.5, -1, 0]) / np.sqrt(1.25))


def test_a_lamp_with_bulbs_but_no_light_entry_gets_an_assumed_power(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    (tmp_path / "metadata/suncgModelLights.json").write_text("{}")
    lights = item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_4").lights
    assert [(x.emitting, x.power, x.share) for x in lights] == [
        ((1,), 60.0, 0.5),
        ((2,), 60.0, 0.5),
    ]


def test_objects_belong_to_the_room_that_lists_them(house: House) -> None:
    assert item(house, "0_2").room_id == "0_0"
    assert item(house, "0_8").room_id == "0_1"
    assert item(house, "1_0").room_id is None


def test_scale_and_axes_of_the_house_are_applied_to_rooms_too(tmp_path: Path, house: House) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json() | {"up": [0, 0, 1], "front": [1, 0, 0], "scaleToMeters": 0.5}
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    turned = read_suncg(tmp_path, HOUSE, ReadFields())
    for one, other in zip(house.items[:6], turned.items[:6], strict=True):
        expected = 0.5 * one.bounds[:, [1, 2, 0]]  # x = up x front = y, y = up = z, z = front = x
        assert np.allclose(other.bounds, expected, atol=1e-5)


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


def test_without_tables_everything_is_otherprop_and_said_so(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    for table in (tmp_path / "metadata").iterdir():
        table.unlink()
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert item(house, "0_2").nyu40 == 40
    assert sum(n.kind == "missing-table" for n in house.notes) == 3
    assert item(house, "0_4").lights == ()


def test_the_digest_covers_every_file_that_was_read(
    root: Path, tmp_path: Path, house: House
) -> None:
    suncg_root.write_root(tmp_path)
    assert read_suncg(tmp_path, HOUSE, ReadFields()).source.sha256 == house.source.sha256
    (tmp_path / "texture/wood.jpg").write_bytes(suncg_root.picture((1, 2, 3), "JPEG"))
    assert read_suncg(tmp_path, HOUSE, ReadFields()).source.sha256 != house.source.sha256
