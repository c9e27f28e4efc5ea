from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.gltf.document import MAX_NODES, placed_nodes
from pbrs_farm.read.gltf.scene import read_gltf, read_gltf_file
from tests.read.gltf.gltf_scenes import Scene, two_rooms


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
        (lambda s: s.more.update(extensionsRequired=["EXT_meshopt_compression"]), "extensionsRequired"),
        (lambda s: s.more.update(scene=5), "scenes[5]"),
        (lambda s: s.nodes[0].update(name="thing"), "scene"),
    ],
)  # fmt: skip
def test_a_damaged_scene_is_refused_naming_the_place(edit: Any, place: str) -> None:
    with pytest.raises(BadHouse) as caught:
        read_gltf(_edited(edit), "scene.glb", fields=ReadFields())
    assert caught.value.place == place
    assert caught.value.file == "scene.glb"


@pytest.mark.parametrize(
    ("data", "name", "said"),
    [
        (b"a list of things", "list.glb", "is not a GLB file"),
        (b"a list of things", "list.gltf", "not valid JSON"),
        (b' {"nodes": []}', "text.glb", "this is not a glTF file"),
    ],
)
def test_a_file_that_is_no_scene_is_refused(data: bytes, name: str, said: str) -> None:
    with pytest.raises(BadHouse, match=said):
        read_gltf(data, name, fields=ReadFields())


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
        with pytest.raises(BadHouse, match=r"leads out|a network address"):
            read_gltf_file(inner / "a.gltf", ReadFields())
    (inner / "link.bin").symlink_to(tmp_path / "secret.bin")
    document = {"asset": {"version": "2.0"}, "buffers": [{"uri": "link.bin", "byteLength": 4}]}
    (inner / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(BadHouse, match="link that leads out"):
        read_gltf_file(inner / "a.gltf", ReadFields())


@pytest.mark.parametrize("is_flat", [True, False])
def test_too_many_nodes_are_refused_before_any_is_read(
    is_flat: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    read_nodes: list[int] = []
    monkeypatch.setattr(
        "pbrs_farm.read.gltf.document.parent_from_node",
        lambda _gltf, _node, index: read_nodes.append(index) or np.eye(4),
    )
    many = [1] * (MAX_NODES + 1)
    nodes = [{}, {}] if is_flat else [{"children": many}, {}]
    document = {"nodes": nodes, "scenes": [{"nodes": many if is_flat else [0]}]}
    with pytest.raises(BadHouse, match=f"more than {MAX_NODES} nodes"):
        list(placed_nodes(Gltf(document, (), "scene.glb")))
    assert len(read_nodes) < 2
