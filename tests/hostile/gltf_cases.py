"""glTF scenes with false tables: sizes, indices, cycles, matrices, pictures. No effects until written."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from tests.hostile.case import Case, Place, Words, by_verb, home, run
from tests.hostile.model_cases import pictures
from tests.hostile.sound_inputs import glb, glb_of_parts, parts_of_glb, png, scene
from tests.read.gltf.gltf_scenes import Scene

Spoil = Callable[[dict[str, Any]], Any]


def cases() -> Iterator[Case]:
    """The container, the document, pictures, and separate files."""
    for name, data in _containers().items():
        yield home(f"glb/{name}", "format", "bad.glb", data)
    for name, spoil in _documents().items():
        lossy = name in ("far_900_m", "mesh_nan", "mode_lines", "mode_99")
        fault = "silence" if lossy else "format"
        yield home(f"gltf/{name}", fault, "bad.glb", partial(_spoiled, spoil), lossy=lossy)
    for name in ("nodes_50_000", "chain_20_000"):
        edit = partial(_crowd, name)
        yield home(f"gltf/{name}", "bounds", "bad.glb", partial(glb, edit))
    for name, picture in pictures().items():
        if name not in ("gif", "svg", "exr_noise", "hdr_claims"):
            data = partial(_textured, picture)
            yield home(f"gltf/image_{name}", "silence", "bad.glb", data, lossy=True)
    for name, uri in _uris().items():
        yield Case(f"gltf/uri_{name}", "format", partial(_separate, uri))
    yield by_verb("gltf/cameras_cycle", "format", "cameras", "bad.glb", glb(_cycle))
    yield by_verb("gltf/repair_cut", "format", "repair", "bad.glb", glb()[:2000])


def _spoiled(spoil: Spoil) -> bytes:
    def edit(document: dict[str, Any]) -> None:
        spoil(document)

    return glb(edit)


def _containers() -> dict[str, bytes]:
    sound = glb()
    document, binary = parts_of_glb(sound)
    text = json.dumps(document).encode()

    def patched(offset: int, value: int) -> bytes:
        return sound[:offset] + struct.pack("<I", value) + sound[offset + 4 :]

    return {
        "empty": b"",
        "header_only": sound[:12],
        "cut": sound[: len(sound) // 2],
        "cut_json": sound[:200],
        "magic": b"glTX" + sound[4:],
        "version_1": patched(4, 1),
        "length_huge": patched(8, 2**32 - 1),
        "length_0": patched(8, 0),
        "chunk_huge": patched(12, 2**32 - 1),
        "chunk_type": patched(16, 7),
        "no_binary": glb_of_parts(text, b""),
        "json_noise": glb_of_parts(bytes(range(256)) * 4, binary),
        "json_list": glb_of_parts(b"[]", binary),
        "json_deep": glb_of_parts(b'{"a":' * 100_000, binary),
        "json_nan": glb_of_parts(text.replace(b"2.6", b"NaN", 1), binary),
        "json_not_utf8": glb_of_parts(text.replace(b"Floor", b"Fl\xff\xfe1", 1), binary),
        "json_twice": glb_of_parts(text + text, binary),
        "noise_binary": glb_of_parts(text, b"\xff" * len(binary)),
        "zero_binary": glb_of_parts(text, bytes(len(binary))),
        "trailing": sound + b"\0" * 4096,
    }


def _cycle(document: dict[str, Any]) -> None:
    document["nodes"][0]["children"] = [1]
    document["nodes"][1]["children"] = [0]


def _documents() -> dict[str, Spoil]:
    nan, inf = float("nan"), float("inf")

    def node(k: int, **more: Any) -> Spoil:
        return lambda d: d["nodes"][k].update(more)

    def accessor(k: int, **more: Any) -> Spoil:
        return lambda d: d["accessors"][k].update(more)

    def view(k: int, **more: Any) -> Spoil:
        return lambda d: d["bufferViews"][k].update(more)

    def primitive(**more: Any) -> Spoil:
        return lambda d: d["meshes"][-1]["primitives"][0].update(more)

    def top(**more: Any) -> Spoil:
        return lambda d: d.update(more)

    huge = [1e30] * 15 + [1]
    light = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1e300}]}}
    return {
        "cycle": _cycle,
        "own_child": node(0, children=[0]),
        "child_out_of_range": node(0, children=[999]),
        "child_minus": node(0, children=[-1]),
        "two_parents": lambda d: [n.update(children=[6]) for n in d["nodes"][:3]],
        "roots_twice": lambda d: d["scenes"][0].update(nodes=d["scenes"][0]["nodes"] * 3),
        "scene_out_of_range": top(scene=9),
        "no_scenes": lambda d: d.pop("scenes"),
        "no_nodes": top(nodes=[]),
        "nodes_wrong": top(nodes={"a": 1}),
        "node_is_text": lambda d: d["nodes"].__setitem__(0, "node"),
        "mesh_out_of_range": node(-1, mesh=999),
        "mesh_word": node(-1, mesh="0"),
        "matrix_nan": node(-1, matrix=[nan] * 16),
        "matrix_huge": node(-1, matrix=huge),
        "matrix_short": node(-1, matrix=[1, 0]),
        "matrix_zero": node(-1, matrix=[0] * 16),
        "scale_0": node(-1, scale=[0, 0, 0]),
        "scale_inf": node(-1, scale=[inf, 1, 1]),
        "scale_minus": node(-1, scale=[-1, -1, -1]),
        "rotation_0": node(-1, rotation=[0, 0, 0, 0]),
        "rotation_words": node(-1, rotation=["a", "b", "c", "d"]),
        "far_900_m": node(-1, translation=[900, 0, 0]),
        "far_1e7_m": node(-1, translation=[1e7, 0, 0]),
        "name_list": node(-1, name=["chair"]),
        "name_null": node(-1, name=None),
        "extras_wrong": node(-1, extras={"class": 7, "kind": [], "nyu40": "x"}),
        "count_huge": accessor(0, count=4_000_000_000),
        "count_minus": accessor(0, count=-1),
        "count_word": accessor(0, count="4"),
        "component_wrong": accessor(0, componentType=9),
        "type_wrong": accessor(0, type="MAT4"),
        "offset_huge": accessor(0, byteOffset=2**40),
        "view_out_of_range": accessor(0, bufferView=999),
        "sparse_wrong": accessor(0, sparse={"count": 10**9, "indices": {}, "values": {}}),
        "view_length_huge": view(0, byteLength=2**40),
        "view_offset_minus": view(0, byteOffset=-4),
        "stride_1": view(0, byteStride=1),
        "stride_huge": view(0, byteStride=2**31),
        "buffer_out_of_range": view(0, buffer=7),
        "buffer_length_huge": lambda d: d["buffers"][0].update(byteLength=2**50),
        "mode_lines": primitive(mode=1),
        "mode_99": primitive(mode=99),
        "no_positions": primitive(attributes={}),
        "positions_are_indices": lambda d: d["meshes"][-1]["primitives"][0]["attributes"].update(
            POSITION=d["meshes"][-1]["primitives"][0]["indices"]
        ),
        "indices_are_positions": lambda d: d["meshes"][-1]["primitives"][0].update(
            indices=d["meshes"][-1]["primitives"][0]["attributes"]["POSITION"]
        ),
        "indices_of_another": lambda d: d["meshes"][-1]["primitives"][0].update(
            indices=d["meshes"][2]["primitives"][0]["indices"]
        ),
        "material_out_of_range": primitive(material=99),
        "draco": lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"]),
        "unknown_required": top(extensionsRequired=["EXT_nobody"]),
        "light_huge": lambda d: d.update(extensions=light) or d["nodes"][-1].update(
            extensions={"KHR_lights_punctual": {"light": 0}}
        ),
        "light_out_of_range": node(-1, extensions={"KHR_lights_punctual": {"light": 5}}),
        "asset_version_9": top(asset={"version": "9.0"}),
        "no_asset": lambda d: d.pop("asset"),
        "skin": node(-1, skin=3),
        "camera": node(-1, camera=3),
    }  # fmt: skip


def _crowd(name: str, document: dict[str, Any]) -> None:
    """Many nodes with a mesh, or one chain of children."""
    nodes = document["nodes"]
    first, n = len(nodes), int(name.split("_", 1)[1].replace("_", ""))
    mesh = nodes[-1]["mesh"]
    if name.startswith("nodes"):
        nodes += [{"name": f"chair_{k}", "mesh": mesh} for k in range(n)]
        document["scenes"][0]["nodes"] += range(first, first + n)
        return
    nodes += [{"name": f"n{k}", "children": [first + k + 1]} for k in range(n)]
    nodes.append({"name": "chair", "mesh": mesh})
    document["scenes"][0]["nodes"].append(first)


def _textured(picture: bytes) -> bytes:
    """The sound scene with a picture on a chair."""
    s: Scene = scene()
    view = s.writer.add_bytes(picture)
    s.more = {
        "images": [{"bufferView": view, "mimeType": "image/png"}],
        "textures": [{"source": 0}],
    }
    s.materials.append({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    s.node("chair_9", mesh=s.box([2, 0, 1], [2.5, 0.5, 1.5], 0))
    return s.glb()


def _uris() -> dict[str, Any]:
    return {
        "missing": "nobody.bin",
        "path": "../../../../etc/passwd",
        "root_path": "/etc/passwd",
        "http": "http://127.0.0.1:9/a.bin",
        "file": "file:///etc/passwd",
        "data_bad": "data:application/octet-stream;base64,!!!!",
        "data_short": "data:;base64," + base64.b64encode(png(1, 1)).decode(),
        "data_no_comma": "data:application/octet-stream;base64",
        "number": 7,
        "nul": "a\0b.bin",
        "percent": "%2e%2e/%00",
        "long": "x" * 100_000,
        "itself": "bad.gltf",
    }


def _separate(uri: Any, place: Place) -> list[Words]:
    document, _ = parts_of_glb(glb())
    document["buffers"][0]["uri"] = uri
    path = place.folder / "bad.gltf"
    path.write_text(json.dumps(document))
    return [run(place, path)]
