from __future__ import annotations

import io
import json
import struct
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest
import trimesh

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Material, geometry_from_house
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats import glb
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.example_homes import example_homes
from tests.read.small_houses import full_house


def assert_same(a: Any, b: Any, place: str = "house") -> None:
    """Equal types, values, dtypes and bits, recursively."""
    assert type(a) is type(b), place
    if is_dataclass(a):
        for field in fields(a):
            x, y = getattr(a, field.name), getattr(b, field.name)
            assert_same(x, y, f"{place}.{field.name}")
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape) == (b.dtype, b.shape), place
        assert a.tobytes() == b.tobytes(), place
    elif isinstance(a, (tuple, list)):
        assert len(a) == len(b), place
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{place}[{i}]")
    elif isinstance(a, dict):
        assert list(a) == list(b), place
        for key in a:
            assert_same(a[key], b[key], f"{place}[{key}]")
    else:
        assert a == b, place


def test_a_bundle_reads_back_to_exactly_the_same_house() -> None:
    house = full_house()
    assert_same(house, house_from_bundle(*bundle_from_house(house)))


def test_equal_houses_give_equal_bytes() -> None:
    assert bundle_from_house(full_house()) == bundle_from_house(full_house())
    again = house_from_bundle(*bundle_from_house(full_house()))
    assert bundle_from_house(again) == bundle_from_house(full_house())


def test_random_float32_survives_bit_by_bit() -> None:
    bits = np.random.default_rng(0).integers(0, 2**32, (3000, 2), dtype=np.uint32)
    uvs = bits.view(np.float32)
    uvs = uvs[np.isfinite(uvs).all(1)]
    house = full_house()
    item = house.items[0]
    surface = replace(item.surfaces[0], uvs=uvs, normals=None, positions=uvs[:, [0, 1, 0]])
    house = house.with_items([replace(item, surfaces=(surface,))])
    back = house_from_bundle(*bundle_from_house(house)).items[0].surfaces[0]
    assert back.uvs is not None
    assert back.uvs.tobytes() == uvs.tobytes()
    assert back.positions.tobytes() == surface.positions.tobytes()


def test_trimesh_opens_the_glb_with_every_item_and_triangle() -> None:
    house = full_house()
    scene = trimesh.load_scene(io.BytesIO(bundle_from_house(house)[0]), file_type="glb")
    meshes = [g for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh)]
    assert sum(len(m.faces) for m in meshes) == len(geometry_from_house(house).faces)
    with_mesh = {i.id for i in house.items if i.n_faces}
    names = {n for n in scene.graph.nodes if any(n.startswith(w) for w in with_mesh)}
    assert with_mesh <= names
    assert np.allclose(scene.bounds, [[0, 0, 0], [5, 2.1, 4]])


def test_texture_coordinates_show_the_picture_upright_in_a_gltf_viewer() -> None:
    house = full_house()
    uvs = house.items[0].surfaces[0].uvs
    scene = trimesh.load_scene(io.BytesIO(bundle_from_house(house)[0]), file_type="glb")
    floor = next(g for g in scene.geometry.values() if g.bounds[1][0] == 5)
    assert uvs is not None
    turns = floor.visual.uv - uvs  # trimesh flips v again: whole turns of the texture remain
    assert np.allclose(turns, np.round(turns), atol=1e-6)


def test_the_glb_names_class_room_and_instance_of_every_item() -> None:
    gltf = glb.gltf_from_glb(bundle_from_house(full_house())[0], "x")
    nodes = gltf.document["nodes"]
    assert nodes[1]["name"] == "w1"
    assert nodes[1]["extras"] == {
        "instance": 2, "item": "w1", "name": "Window", "kind": "window", "nyu40": 9,
        "class": "window", "room": None,
    }  # fmt: skip
    assert gltf.document["asset"]["copyright"] == "Full, by a test"
    materials = gltf.document["materials"]
    assert materials[1]["alphaMode"] == "BLEND"
    assert materials[1]["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.5
    assert materials[2]["emissiveFactor"] == [1.0, 1.0, 1.0]
    assert all(m["doubleSided"] for m in materials)
    assert "baseColorTexture" not in materials[3]["pbrMetallicRoughness"]  # a GIF


def with_maps(house: House) -> House:
    """The house with roughness and maps on its first material."""
    picture = next(iter(house.textures))
    mapped = replace(
        house.materials[0],
        roughness=0.25,
        roughness_texture_id=picture,
        normal_texture_id=picture,
        normal_scale=0.5,
    )
    return replace(house, materials=(mapped, *house.materials[1:]))


def test_roughness_and_maps_read_back_and_are_stored_as_gltf_viewers_expect() -> None:
    house = with_maps(full_house())
    glb_data, json_data = bundle_from_house(house)
    assert_same(house, house_from_bundle(glb_data, json_data))
    material = glb.gltf_from_glb(glb_data, "x").document["materials"][0]
    look = material["pbrMetallicRoughness"]
    assert (look["roughnessFactor"], look["metallicFactor"]) == (0.25, 0.0)
    assert look["metallicRoughnessTexture"] == look["baseColorTexture"] == {"index": 0}
    assert material["normalTexture"] == {"index": 0, "scale": 0.5}


def test_house_json_names_every_field_of_a_material_and_a_lamp() -> None:
    row = json.loads(bundle_from_house(full_house())[1])
    # The alpha cutoff is written if it is not the default.
    usual, *_, holed = row["materials"]
    assert set(usual) == set(Material.__slots__) - {"alpha_cutoff"}
    assert set(holed) == set(Material.__slots__)
    lamp = next(item for item in row["items"] if item["lights"])
    assert {"is_coloured", "is_bare"} <= set(lamp["lights"][0])
    assert lamp["pose"] is None


def test_house_json_is_readable_and_complete_except_for_arrays() -> None:
    text = bundle_from_house(full_house())[1].decode()
    plain = json.loads(text)
    assert plain["classes"] == {"0": "none", "2": "floor", "9": "window", "35": "lamp"}
    assert plain["items"][2]["lights"][0]["power"] == 60.0
    assert plain["items"][2]["class"] == "lamp"
    assert '"position": [2.0, 2.0, 2.0]' in text  # a list of numbers is on one line
    assert len(text) < 12_000


def _damaged(house: House, edit: Any) -> tuple[bytes, bytes]:
    glb_data, json_data = bundle_from_house(house)
    plain = json.loads(json_data)
    edit(plain)
    return glb_data, json.dumps(plain).encode()


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda p: p.update(format="other"), "format"),
        (lambda p: p.update(glb_sha256="0"), "glb_sha256"),
        (lambda p: p.pop("rooms"), "rooms"),
        (lambda p: p["rooms"][0].update(floor_y="low"), "rooms[0].floor_y"),
        (lambda p: p["rooms"][0].update(floor_y=10**400), "rooms[0].floor_y"),
        (lambda p: p["rooms"][0].update(polygon=[1, 2, 3]), "rooms[0].polygon"),
        (lambda p: p["rooms"][0].update(polygon=[[1, 2], [3]]), "rooms[0].polygon"),
        (lambda p: p["items"][1].update(kind="spaceship"), "items[1].kind"),
        (lambda p: p["items"][1].update(nyu40=41), "items[1].nyu40"),
        (lambda p: p["items"][1].update(nyu40=True), "items[1].nyu40"),
        (lambda p: p["items"][1].update(room_id="9_9"), "items[1].room_id"),
        (lambda p: p["items"][1].update(level_id="9"), "items[1].level_id"),
        (lambda p: p["items"][1]["surfaces"][0].update(material=99), "items[1].surfaces[0].material"),
        (lambda p: p["items"][1]["surfaces"][0].update(n_faces=1), "items[1].surfaces[0]"),
        (lambda p: p["items"].append(dict(p["items"][1])), "nodes[5]"),
        (lambda p: p["openings"][0].update(quad=[[0, 0, 0]]), "openings[0].quad"),
        (lambda p: p["textures"].pop(), "extras.textures"),
        (lambda p: p["materials"][0].update(diffuse=[1, 2]), "materials[0].diffuse"),
        (lambda p: p["materials"][0].update(diffuse=[1, 2, "3"]), "materials[0].diffuse[2]"),
        (lambda p: p["materials"][0].update(opacity=True), "materials[0].opacity"),
        (lambda p: p["items"][1].update(name=3), "items[1].name"),
        (lambda p: p["openings"][0].update(is_window=1), "openings[0].is_window"),
        (lambda p: p["openings"][0].update(normal=[0, 0, 10**400]), "openings[0].normal"),
    ],
)  # fmt: skip
def test_a_damaged_house_json_is_refused_naming_the_place(edit: Any, place: str) -> None:
    with pytest.raises(BadHouse) as caught:
        house_from_bundle(*_damaged(full_house(), edit))
    assert caught.value.place == place


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b'{"a": NaN}', b"[" * 100_000, b"\xff\xfe"])
def test_text_that_is_no_house_json_is_refused(text: bytes) -> None:
    with pytest.raises(BadHouse):
        house_from_bundle(bundle_from_house(full_house())[0], text)


def test_a_glb_cut_anywhere_is_refused() -> None:
    glb_data, _ = bundle_from_house(full_house())
    for end in range(0, len(glb_data), 97):
        with pytest.raises(BadHouse):
            glb.gltf_from_glb(glb_data[:end], "house.glb")


def test_accessors_that_reach_outside_are_refused() -> None:
    gltf = glb.gltf_from_glb(bundle_from_house(full_house())[0], "house.glb")
    for change in ({"count": 10**9}, {"byteOffset": 10**12}, {"count": -1}, {"type": "MAT4"}):
        document = json.loads(json.dumps(gltf.document))
        document["accessors"][0].update(change)
        with pytest.raises(BadHouse, match=r"accessors\[0\]"):
            glb.accessor_array(glb.Gltf(document, gltf.buffers, "house.glb"), 0)


def test_geometry_that_is_not_finite_is_not_written() -> None:
    house = full_house()
    item = house.items[0]
    bad = replace(item.surfaces[0], positions=item.surfaces[0].positions + np.float32("inf"))
    with pytest.raises(BadHouse, match="item floor, surface floor"):
        bundle_from_house(house.with_items([replace(item, surfaces=(bad,))]))


def test_the_glb_follows_the_container_rules() -> None:
    data, _ = bundle_from_house(full_house())
    magic, version, length, json_length, kind = struct.unpack_from("<4sIIII", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), 0x4E4F534A)
    assert json_length % 4 == 0
    document = glb.gltf_from_glb(data, "x").document
    assert all(v["byteOffset"] % 4 == 0 for v in document["bufferViews"])
    assert all(a["count"] >= 1 for a in document["accessors"])


def test_the_builtin_home_survives_the_bundle() -> None:
    house = builtin_home()
    assert_same(house, house_from_bundle(*bundle_from_house(house)))


@pytest.mark.homes
def test_an_example_home_survives_the_bundle() -> None:
    example_homes()
    house = read_house(resolve("Studio"), ReadFields())
    assert_same(house, house_from_bundle(*bundle_from_house(house)))
