from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.read.gltf.scene import read_gltf_file
from tests.read.gltf.gltf_scenes import area, item, read, two_rooms


def test_our_glb_reads_back_as_the_same_items_and_rooms(tmp_path: Path) -> None:
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


def test_interleaved_and_quantized_arrays_read_as_the_plain_ones() -> None:
    s = two_rooms()
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    rows = np.zeros(4, [("p", "<i2", 3), ("pad", "<u2"), ("uv", "<u1", 2), ("end", "<u2")])
    rows["p"] = np.rint(corners * 32767)
    rows["uv"] = corners[:, :2] * 255
    view = s.writer.add_bytes(rows.tobytes())
    s.writer.views[view]["byteStride"] = rows.itemsize
    indices = s.writer.add_bytes(np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes())
    first = len(s.writer.accessors)
    s.writer.accessors += [
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


def test_items_far_smaller_than_their_nodes_units_are_read_and_flat_ones_are_noted() -> None:
    scene = two_rooms()
    for name, size, scale in (
        ("Jug", 2_000.0, [1e-4] * 3),
        ("Table", 16_384.0, [6.1e-5] * 3),  # 16-bit positions, as KHR_mesh_quantization scales them
        ("Chair", 1e8, [1e-8] * 3),
        ("Poster", 1.0, [1.0, 1.0, 1e-9]),
        ("Sofa", 1.0, [1.0, 1.0, 0.0]),
        ("Bed", 1.0, [1e-9] * 3),
    ):
        mesh = scene.box([0.0] * 3, [size] * 3)
        scene.node(name, mesh=mesh, scale=scale, translation=[1.0, 0.5, 1.0])
    vase = scene.node("Vase", mesh=scene.box([0.0] * 3, [20_000.0] * 3), scale=[1e-2] * 3)
    scene.node("Root", children=[vase], scale=[1e-3] * 3, translation=[1.0, 0.5, 1.0])
    house = read(scene)
    sizes = {
        name: np.ptp(item(house, name).bounds, axis=0) for name in ("Jug", "Table", "Chair", "Vase")
    }
    for name, size in (("Jug", 0.2), ("Table", 0.9994), ("Chair", 1.0), ("Vase", 0.2)):
        np.testing.assert_allclose(sizes[name], size, rtol=1e-3)
        assert item(house, name).box is not None
    np.testing.assert_allclose(np.ptp(item(house, "Poster").bounds, axis=0), [1, 1, 0], atol=1e-6)
    assert not {"Sofa", "Bed"} & {i.name for i in house.items}
    assert [n.kind for n in house.notes if n.kind == "flat-node"] == ["flat-node"] * 2


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
    assert surface.normals is None  # flat, the glTF default


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
    assert len(house.rooms) == 1  # that wall is no longer recognised as one
    document["buffers"][0]["uri"] = (
        "data:application/octet-stream;base64," + base64.b64encode(binary.buffers[0]).decode()
    )
    (tmp_path / "other.gltf").write_text(json.dumps(document))
    reread = read_gltf_file(tmp_path / "other.gltf", ReadFields())
    assert np.array_equal(reread.items[0].bounds, house.items[0].bounds)
    assert reread.id != house.id


def test_the_scene_survives_the_bundle() -> None:
    house = read(two_rooms())
    bundle = bundle_from_house(house)
    assert bundle_from_house(house_from_bundle(*bundle)) == bundle


def test_each_instance_of_a_node_is_an_item() -> None:
    s = two_rooms()
    moves = np.array([[0, 0, 0], [1, 0, 0], [4, 0, 1]], np.float32)
    sizes = np.array([[1, 1, 1], [1, 2, 1], [1, 1, 1]], np.float32)
    attributes = {
        "TRANSLATION": s.writer.add_vertices(moves),
        "SCALE": s.writer.add_vertices(sizes),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    cube = s.box([0, 0, 0], [0.5, 0.5, 0.5])
    chair = s.node("Chair", mesh=cube, translation=[0.5, 0, 1], extensions=extension)
    s.node("Furniture", children=[chair])
    s.more = {"extensionsUsed": ["EXT_mesh_gpu_instancing"]}
    house = read(s)
    chairs = [i for i in house.items if i.name == "Chair"]
    assert [i.nyu40 for i in chairs] == [5, 5, 5]
    np.testing.assert_allclose(
        [i.bounds[0] for i in chairs], moves + np.array([0.5, 0, 1]), atol=1e-6
    )
    np.testing.assert_allclose([np.ptp(i.bounds[:, 1]) for i in chairs], [0.5, 1.0, 0.5])
    assert not house.notes
    # The fault is of the instanced node, not of the node with the number of the instance.
    attributes["ROTATION"] = s.writer.add_vertices(np.zeros((3, 4), np.float32))
    with pytest.raises(BadHouse, match=rf"nodes\[{chair}\]: ROTATION: .*unit quaternion"):
        read(s)
