from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, MaterialKind
from pbrs_farm.core.lighting import LightForm, flux_lm
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.read.gltf.scene import Beside, read_gltf, read_gltf_file
from pbrs_farm.repair.repair_house import repair
from tests.read.gltf.gltf_scenes import Scene, two_rooms
from tests.read.small_houses import png


def read(scene: Scene, **beside: Any) -> House:
    return read_gltf(scene.glb(), "scene.glb", fields=ReadFields(), beside=Beside(**beside))


def item(house: House, name: str) -> Item:
    return next(i for i in house.items if i.name == name)


def area(polygon: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    x, z = polygon.T
    return float(0.5 * (x @ np.roll(z, -1) - z @ np.roll(x, -1)))


def test_our_own_glb_reads_back_as_the_same_items_and_rooms(tmp_path: Path) -> None:
    home = builtin_home()
    path = tmp_path / "home.glb"
    path.write_bytes(bundle_from_house(home)[0])
    house = read_gltf_file(path, ReadFields())
    facts = [(i.id, i.name, i.kind, i.nyu40) for i in house.items]
    assert facts == [(i.id, i.name, i.kind, i.nyu40) for i in home.items]
    for ours, theirs in zip(home.items, house.items, strict=True):
        assert np.allclose(ours.bounds, theirs.bounds)
        if ours.kind is not ItemKind.WALL and not ours.kind.is_structure:
            assert ours.room_id == theirs.room_id, ours.id
    assert [area(r.polygon) for r in house.rooms] == pytest.approx([20.0, 15.6], abs=0.01)
    for a, b in zip(home.openings, house.openings, strict=True):
        assert (a.item_id, a.is_window) == (b.item_id, b.is_window)
        assert np.allclose(a.quad, b.quad, atol=1e-5)
    kinds = {m.name: m.kind for m in home.materials}
    assert all(kinds[m.name] is m.kind for m in house.materials)


def test_rooms_are_the_pieces_of_floor_that_walls_part() -> None:
    house = read(two_rooms())
    assert [r.id for r in house.rooms] == ["0_0", "0_1"]
    assert [area(r.polygon) for r in house.rooms] == pytest.approx([12.0, 6.0], abs=0.05)
    assert house.rooms[0].floor_y == 0
    assert house.rooms[0].ceiling_y == pytest.approx(2.6)
    assert house.rooms[0].has_ceiling


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


def test_names_tell_classes_and_unknown_ones_are_otherprop_and_said_so() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [0.5, 0.5, 0.5])
    for name in ("Armchair_01", "wall lamp", "Thing.002", "floor mat", "Kitchen cabinet L"):
        s.node(name, mesh=cube, translation=[1, 0, 1])
    house = read(s)
    got = {i.name: (i.nyu40, i.kind) for i in house.items}
    assert got["Floor"] == (2, ItemKind.FLOOR)
    assert got["Walls outer"] == (1, ItemKind.WALL)
    assert got["Wall.001"] == (1, ItemKind.WALL)
    assert got["Ceiling"] == (22, ItemKind.CEILING)
    assert got["Armchair_01"] == (5, ItemKind.OBJECT)
    assert got["wall lamp"] == (35, ItemKind.LAMP)
    assert got["floor mat"] == (20, ItemKind.OBJECT)
    assert got["Kitchen cabinet L"] == (3, ItemKind.OBJECT)
    assert got["Thing.002"] == (40, ItemKind.OBJECT)
    assert [n.kind for n in house.notes] == ["unmapped-class"]
    assert "Thing.002" in house.notes[0].place


def test_the_mapping_file_beats_names_and_extras_beat_the_mapping() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [0.5, 0.5, 0.5])
    s.node("Chair A", mesh=cube)
    s.node("Chair B", mesh=cube)
    s.node("Chair C", mesh=cube, extras={"class": "night_stand"})
    s.node("X7", mesh=cube)
    mapping = {"nodes": {"Chair*": "sofa", "Chair B": {"class": "bed", "kind": "object"}, "X?": 25}}
    house = read(s, mapping=json.dumps(mapping).encode())
    assert [item(house, f"Chair {x}").nyu40 for x in "ABC"] == [6, 4, 32]
    assert item(house, "X7").nyu40 == 25
    assert not house.notes


def test_a_group_is_one_item_unless_its_name_means_several() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [0.2, 0.2, 0.2])
    legs = [s.node(f"leg {k}", mesh=cube, translation=[k, 0, 0]) for k in range(3)]
    s.node("Table", children=legs)
    chairs = [s.node(f"Cube.{k:03}", mesh=cube) for k in range(2)]
    s.node("Chairs", children=chairs)
    lamp = s.node("Lamp", mesh=cube)
    vase = s.node("Vase", mesh=cube, extras={"class": "otherprop"})
    s.node("Furniture", children=[s.node("Desk", mesh=cube, children=[lamp, vase])])
    house = read(s)
    assert item(house, "Table").n_faces == 36
    names = [i.name for i in house.items][7:]
    assert names == ["Table", "Cube.000", "Cube.001", "Desk", "Vase"]
    assert item(house, "Cube.001").nyu40 == 5
    assert item(house, "Desk").n_faces == 24  # its lamp, untagged, is a part of it
    assert not house.notes


def test_a_storey_named_floor_is_no_floor() -> None:
    s = two_rooms()
    cube = s.node("Cube", mesh=s.box([1, 0, 1], [1.5, 0.5, 1.5]))
    chair = s.node("Chair", mesh=s.box([2, 0, 1], [2.5, 0.5, 1.5]))
    s.node("Ground floor", children=[0, 1, 2, 3, cube, chair])
    house = read(s)
    assert [i.name for i in house.items if i.kind is ItemKind.FLOOR] == ["Floor"]
    assert item(house, "Cube").tags == ("unmapped",)
    assert item(house, "Chair").nyu40 == 5
    assert len(house.rooms) == 2


def test_interleaved_and_quantized_arrays_read_as_the_plain_ones() -> None:
    s = two_rooms()
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    rows = np.zeros(4, [("p", "<i2", 3), ("pad", "<u2"), ("uv", "<u1", 2), ("end", "<u2")])
    rows["p"] = np.rint(corners * 32767)
    rows["uv"] = corners[:, :2] * 255
    view = s.writer.add_bytes(rows.tobytes())
    s.writer._views[view]["byteStride"] = rows.itemsize
    indices = s.writer.add_bytes(np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes())
    first = len(s.writer._accessors)
    s.writer._accessors += [
        {"bufferView": view, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True},
        {"bufferView": view, "byteOffset": 8, "componentType": 5121, "count": 4, "type": "VEC2",
         "normalized": True},
        {"bufferView": indices, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ]  # fmt: skip
    attributes = {"POSITION": first, "TEXCOORD_0": first + 1}
    s.meshes.append({"primitives": [{"attributes": attributes, "indices": first + 2}]})
    s.more["extensionsRequired"] = ["KHR_mesh_quantization"]
    s.node("Chair", mesh=len(s.meshes) - 1, scale=[2, 2, 2])
    (surface,) = item(read(s), "Chair").surfaces
    assert np.allclose(surface.positions, 2 * corners)
    assert surface.uvs is not None
    assert np.allclose(surface.uvs, corners[:, :2] * [1, -1] + [0, 1])
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_transforms_compose_down_the_tree() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [1, 1, 1])
    half = np.sqrt(0.5)
    child = s.node("Bed", mesh=cube, translation=[0, 0, 1], scale=[2, 1, 1])
    matrix = np.eye(4)
    matrix[:3, 3] = [1, 0, 0.5]
    s.node("a", children=[child], rotation=[0, half, 0, half])
    s.node("b", children=[len(s.nodes) - 1], matrix=matrix.T.reshape(-1).tolist())
    bed = item(read(s), "Bed")
    # A quarter turn about +y takes x to -z and z to x: (0..2, 0..1, 1..2) -> (1..2, 0..1, -2..0).
    assert np.allclose(bed.bounds, [[2, 0, -1.5], [3, 1, 0.5]], atol=1e-6)
    assert bed.box is not None
    assert sorted(bed.box.half) == pytest.approx([0.5, 0.5, 1.0])


def test_mirrored_nodes_keep_their_fronts_outside() -> None:
    s = two_rooms()
    s.node("Chair", mesh=s.box([0, 0, 0], [1, 2, 3]), scale=[-1, 1, 1], translation=[3, 0, 0])
    chair = item(read(s), "Chair")
    p = np.concatenate([x.positions[x.faces] for x in chair.surfaces]).astype(np.float64)
    volume = np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6
    assert volume == pytest.approx(6.0)
    assert chair.tags == ("mirrored",)


@pytest.mark.parametrize("mode", [5, 6])
def test_strips_and_fans_become_the_same_triangles_as_drawn(mode: int) -> None:
    s = two_rooms()
    corners = {
        5: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
        6: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    }
    p = np.array(corners[mode], np.float32)
    s.meshes.append(
        {"primitives": [{"attributes": {"POSITION": s.writer.add_vertices(p)}, "mode": mode}]}
    )
    s.node("Chair", mesh=len(s.meshes) - 1)
    (surface,) = item(read(s), "Chair").surfaces
    p = surface.positions[surface.faces]
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    assert np.allclose(n, [[0, 0, 1]] * 2)
    assert surface.normals is None  # flat, as glTF asks where there are none


def test_texture_coordinates_turn_v_up_and_follow_the_texture_transform() -> None:
    s = two_rooms()
    view = s.writer.add_bytes(png())
    s.more = {
        "images": [{"bufferView": view, "mimeType": "image/png", "name": "red"}],
        "textures": [{"source": 0}],
    }
    info: dict[str, Any] = {"index": 0}
    s.materials.append({"pbrMetallicRoughness": {"baseColorTexture": info}})
    s.node("Chair", mesh=s.mesh([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], 0))
    house = read(s)
    (surface,) = item(house, "Chair").surfaces
    assert surface.uvs is not None
    assert np.allclose(surface.uvs, [[0, 0], [1, 0], [1, 1], [0, 1]])  # bottom left first
    texture = house.textures[house.materials[surface.material].texture_id or ""]
    assert (texture.name, texture.data) == ("red", png())
    info["extensions"] = {"KHR_texture_transform": {"scale": [2, 3], "offset": [0.25, 0.5]}}
    (surface,) = item(read(s), "Chair").surfaces
    assert surface.uvs is not None
    assert np.allclose(surface.uvs[2], [2.25, 1 - 0.5])  # uv (1, 0) v down -> (2.25, 0.5)
    assert np.allclose(surface.uvs[0], [0.25, 1 - 3.5])


def test_materials_keep_colour_gloss_glass_and_mirror() -> None:
    s = two_rooms()
    pbr = "pbrMetallicRoughness"
    s.materials += [
        {"name": "paint", pbr: {"baseColorFactor": [0.214, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1}},
        {"name": "glass", "alphaMode": "BLEND", pbr: {"baseColorFactor": [1, 1, 1, 0.2], "metallicFactor": 0}},
        {"name": "silver", pbr: {"metallicFactor": 1, "roughnessFactor": 0.02}},
        {"name": "clear", pbr: {"metallicFactor": 0}, "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}},
    ]  # fmt: skip
    for k, name in enumerate(("Table", "Window", "Mirror", "Chair")):
        s.node(name, mesh=s.box([0, 0, 0], [1, 1, 0.05], k))
    house = read(s)
    look = {m.name: m for m in house.materials}
    assert look["paint"].diffuse == pytest.approx((0.5, 0, 0), abs=1e-3)
    assert (look["paint"].shininess, look["paint"].specular) == (0.0, (0.0, 0.0, 0.0))
    assert (look["glass"].kind, look["glass"].opacity) == (MaterialKind.PANE, 0.2)
    assert look["silver"].kind is MaterialKind.MIRROR
    assert (look["clear"].kind, look["clear"].opacity) == (MaterialKind.GLASS, 0.0)


def test_gloss_survives_the_way_through_our_own_glb() -> None:
    home = builtin_home()
    shiny = replace(home.materials[0], shininess=40.0)
    home = replace(home, materials=(shiny, *home.materials[1:]))
    house = read_gltf(bundle_from_house(home)[0], "a.glb", fields=ReadFields())
    assert next(m for m in house.materials if m.name == shiny.name).shininess == pytest.approx(40.0)


def test_punctual_lights_become_lumens_of_the_lamp_they_hang_in() -> None:
    s = two_rooms()
    s.more["extensions"] = {
        "KHR_lights_punctual": {
            "lights": [
                {"type": "point", "intensity": 50, "color": [1, 0.5, 0.25]},
                {"type": "spot", "intensity": 100, "spot": {"outerConeAngle": np.pi / 3}},
                {"type": "directional", "intensity": 3},
            ]
        }
    }
    uses = [{"KHR_lights_punctual": {"light": k}} for k in range(3)]
    bulb = s.node("bulb", extensions=uses[0], translation=[0, 0.3, 0])
    s.node("Lamp", mesh=s.box([0, 0, 0], [0.2, 0.2, 0.2]), children=[bulb], translation=[1, 1, 1])
    turn = [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # -z turned down
    s.node("Spot", extensions=uses[1], translation=[2, 2.4, 1], rotation=turn)
    s.node("Sun", extensions=uses[2])
    house = read(s)
    (point,) = item(house, "Lamp").lights
    assert np.allclose(point.position, [1, 1.3, 1])
    assert flux_lm(point.power, point.unit, point.share) == pytest.approx(50 * 4 * np.pi)
    assert point.rgb_linear == (1.0, 0.5, 0.25)
    (spot,) = item(house, "Spot").lights
    assert (item(house, "Spot").kind, item(house, "Spot").room_id) == (ItemKind.LAMP, "0_0")
    assert spot.form is LightForm.SPOT
    assert np.allclose(spot.direction, [0, -1, 0], atol=1e-6)
    assert spot.power == pytest.approx(100 * np.pi)
    assert not any(i.name == "Sun" for i in house.items)


def test_emissive_surfaces_of_objects_emit_and_floors_never_glow() -> None:
    s = two_rooms()
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 1000}}
    s.materials += [
        {"name": "screen", "emissiveFactor": [1, 1, 1], "extensions": strong},
        {"name": "plain", "emissiveFactor": [1, 1, 1]},
    ]
    s.node("TV", mesh=s.mesh([[[0, 1, 0.1], [1, 1, 0.1], [1, 1.5, 0.1], [0, 1.5, 0.1]]], 0))
    s.node("Floor lamp", mesh=s.box([3, 0, 1], [3.1, 1, 1.1], 1))
    s.node("Picture", mesh=s.box([3, 1, 0], [3.1, 1.1, 0.1], 1))
    s.nodes[0]["mesh"] = s.mesh([[[0, 0, 3], [6, 0, 3], [6, 0, 0], [0, 0, 0]]], 0)
    house = read(s)
    (screen,) = item(house, "TV").lights
    assert screen.emitting == (0,)
    assert screen.power == pytest.approx(np.pi * 1000 * 0.5)
    (lamp,) = item(house, "Floor lamp").lights
    assert (lamp.power, lamp.emitting) == (800.0, (0,))
    assert not item(house, "Picture").lights
    floor = item(house, "Floor")
    assert not floor.lights
    assert house.materials[floor.surfaces[0].material].kind is MaterialKind.OPAQUE


def test_a_lamp_without_any_light_gets_an_assumed_one() -> None:
    s = two_rooms()
    s.node("Lamp", mesh=s.box([1, 0, 1], [1.2, 1, 1.2]))
    lamp = item(read(s), "Lamp")
    assert lamp.tags == ("assumed_light",)
    assert np.allclose(lamp.lights[0].position, [1.1, 0.5, 1.1])


def test_a_gltf_with_files_beside_it_reads_the_same(tmp_path: Path) -> None:
    from pbrs_farm.formats import glb

    binary = glb.gltf_from_glb(two_rooms().glb(), "x")
    document = json.loads(json.dumps(binary.document))
    document["buffers"][0]["uri"] = "geometry%20data.bin"
    (tmp_path / "geometry data.bin").write_bytes(binary.buffers[0])
    (tmp_path / "room.gltf").write_text(json.dumps(document))
    (tmp_path / "room.classes.json").write_text('{"nodes": {"Wall.*": "otherstructure"}}')
    house = read_gltf_file(tmp_path / "room.gltf", ReadFields())
    assert item(house, "Wall.001").nyu40 == 38
    assert len(house.rooms) == 1  # that wall is none now
    document["buffers"][0]["uri"] = (
        "data:application/octet-stream;base64," + base64.b64encode(binary.buffers[0]).decode()
    )
    (tmp_path / "other.gltf").write_text(json.dumps(document))
    other = read_gltf_file(tmp_path / "other.gltf", ReadFields())
    assert np.array_equal(other.items[0].bounds, house.items[0].bounds)
    assert other.id != house.id


def test_the_scene_survives_the_bundle() -> None:
    house = read(two_rooms())
    bundle = bundle_from_house(house)
    assert bundle_from_house(house_from_bundle(*bundle)) == bundle


def _edited(edit: Any) -> bytes:
    s = two_rooms()
    s.node("Chair", mesh=s.box([0, 0, 0], [1, 1, 1]))
    edit(s)
    return s.glb()


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda s: [s.nodes[k].update(children=[c]) for k, c in ((0, 1), (1, 2), (2, 1))], "nodes[1]"),
        (lambda s: s.nodes[4].update(children=[99]), "nodes[99]"),
        (lambda s: s.nodes[4].update(mesh=99), "meshes[99]"),
        (lambda s: s.nodes[4].update(mesh="a"), "meshes[a]"),
        (lambda s: s.nodes[4].update(matrix=[1] * 15), "nodes[4].matrix"),
        (lambda s: s.nodes[4].update(matrix=[1] * 16), "nodes[4].matrix"),
        (lambda s: s.nodes[4].update(rotation=[0, 0, 0, 0]), "nodes[4].rotation"),
        (lambda s: s.nodes[4].update(translation=[0, 1e6, 0]), "nodes[4] (Chair)"),
        (lambda s: s.meshes[4]["primitives"][0].update(material=7), "materials[7]"),
        (lambda s: s.meshes[4]["primitives"][0].update(indices=0), "meshes[4].primitives[0].indices"),
        (lambda s: s.meshes[4]["primitives"][0].pop("attributes"), "meshes[4].primitives[0]"),
        (lambda s: s.meshes[4].update(primitives=3), "meshes[4].primitives"),
        (lambda s: s.more.update(extensionsRequired=["KHR_draco_mesh_compression"]), "extensionsRequired"),
        (lambda s: s.more.update(scene=5), "scenes[5]"),
        (lambda s: s.nodes[0].update(name="thing"), "scene"),
    ],
)  # fmt: skip
def test_a_damaged_scene_is_refused_naming_the_place(edit: Any, place: str) -> None:
    with pytest.raises(BadHouse) as caught:
        read_gltf(_edited(edit), "scene.glb", fields=ReadFields())
    assert caught.value.place == place
    assert caught.value.file == "scene.glb"


def test_a_signalling_nan_is_a_number_that_is_not_finite() -> None:
    scene = two_rooms()
    scene.node("Chair", mesh=scene.box([1.375, 0, 1], [2, 1, 2]))
    data = scene.glb().replace(np.float32(1.375).tobytes(), b"\x01\x00\x80\x7f")
    with pytest.raises(BadHouse, match="not finite"):
        read_gltf(data, "scene.glb", fields=ReadFields())


def test_faces_out_of_range_and_too_many_triangles_are_refused() -> None:
    def far(s: Scene) -> None:
        faces = np.array([[0, 1, 99]], np.int32)
        s.meshes[4]["primitives"][0]["indices"] = s.writer.add_faces(faces)

    with pytest.raises(BadHouse, match="a face names a vertex that does not exist"):
        read_gltf(_edited(far), "scene.glb", fields=ReadFields())
    with pytest.raises(BadHouse, match=r"meshes\[2\].*more than 7 triangles"):
        read_gltf(two_rooms().glb(), "scene.glb", fields=ReadFields(max_model_triangles=7))
    with pytest.raises(BadHouse, match="more than 11 triangles"):
        read_gltf(two_rooms().glb(), "scene.glb", fields=ReadFields(max_triangles=11))


def test_names_that_lead_out_of_the_folder_are_refused(tmp_path: Path) -> None:
    (tmp_path / "secret.bin").write_bytes(b"0" * 100)
    inner = tmp_path / "in"
    inner.mkdir()
    for uri in ("../secret.bin", "/etc/passwd", "%2e%2e/secret.bin", "http://x.org/a.bin"):
        document = {"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 4}]}
        (inner / "a.gltf").write_text(json.dumps(document))
        with pytest.raises(BadHouse, match=r"leads out|on a network"):
            read_gltf_file(inner / "a.gltf", ReadFields())
    (inner / "link.bin").symlink_to(tmp_path / "secret.bin")
    document = {"asset": {"version": "2.0"}, "buffers": [{"uri": "link.bin", "byteLength": 4}]}
    (inner / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(BadHouse, match="link that leads out"):
        read_gltf_file(inner / "a.gltf", ReadFields())


@pytest.mark.parametrize(
    ("rooms", "place"),
    [
        ({}, "rooms"),
        ({"rooms": []}, "rooms"),
        ({"rooms": [3]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1], [1, 0], [0, 1]]}]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1], [1e9, 0]]}]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [1, 1], ["a", 0]]}]}, "rooms[0].polygon"),
        ({"rooms": [{"polygon": [[0, 0], [0, 1], [1, 0]], "floor_y": "x"}]}, "rooms[0].floor_y"),
    ],
)  # fmt: skip
def test_a_wrong_room_file_is_refused_naming_the_room(rooms: Any, place: str) -> None:
    with pytest.raises(BadHouse) as caught:
        read(two_rooms(), rooms=json.dumps(rooms).encode())
    assert (caught.value.file, caught.value.place) == ("scene.rooms.json", place)


def test_a_wrong_mapping_row_is_refused_naming_it() -> None:
    with pytest.raises(BadHouse, match="names no class"):
        read(two_rooms(), mapping=b'{"nodes": {"A": "spaceship"}}')


@pytest.mark.parametrize(
    ("names", "panes"),
    [
        (("Glass", "Frame"), {"Glass"}),
        (("windowGlass.001", "wood"), {"windowGlass.001"}),
        (("Fensterscheibe Glas", "Fensterrahmen"), {"Fensterscheibe Glas"}),
        (("Window", "Wood"), {"Window"}),
        (("window", "glass"), {"glass"}),  # beside a glass "window" names the frame
        (("glass frame", "plastic"), set()),
    ],
)
def test_an_opaque_material_named_glass_in_a_window_is_a_pane(
    names: tuple[str, ...], panes: set[str]
) -> None:
    s = two_rooms()
    s.materials += [{"name": n, "pbrMetallicRoughness": {}} for n in names]
    parts = [s.node(f"part {k}", mesh=s.box([1, 1 + k, 0], [2, 2 + k, 0.05], k)) for k in range(2)]
    s.node("Window", children=parts)
    s.node("Table", mesh=s.box([1, 0, 1], [2, 0.7, 2], 0))
    house = read(s)
    seen = [house.materials[x.material] for x in item(house, "Window").surfaces]
    assert {m.name for m in seen if m.kind is MaterialKind.PANE} == panes
    assert all(m.opacity < 0.5 for m in seen if m.kind is MaterialKind.PANE)
    (table,) = (house.materials[x.material] for x in item(house, "Table").surfaces)
    assert table.kind is MaterialKind.OPAQUE


def test_a_part_named_glass_of_a_window_is_a_pane_whatever_its_material() -> None:
    s = two_rooms()
    pane = s.node("Glass", mesh=s.box([1, 1, 0], [2, 2, 0.02]))
    frame = s.node("Glass frame", mesh=s.box([1, 0.9, 0], [2, 1, 0.05]))
    s.node("Window", children=[pane, frame])
    house = read(s)
    kinds = [house.materials[x.material].kind for x in item(house, "Window").surfaces]
    assert kinds == [MaterialKind.PANE, MaterialKind.OPAQUE]
