"""Compressed glTF: Draco meshes, KTX2 pictures, sparse accessors."""

from __future__ import annotations

import base64
import builtins
import io
import struct
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.formats.glb import accessor_array, gltf_from_glb
from pbrs_farm.read.gltf.compressed import decoded_picture
from tests.read.gltf.gltf_scenes import Scene, item, read, two_rooms

KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"


def with_draco_sofa(data: bytes | None = None) -> Scene:
    """Two rooms and a sofa 1 m wide whose mesh exists only in Draco form."""
    import DracoPy

    scene = two_rooms()
    plain = gltf_from_glb(with_sofa(two_rooms()).glb(), "plain.glb")
    primitive = plain.document["meshes"][-1]["primitives"][0]
    points = accessor_array(plain, primitive["attributes"]["POSITION"])
    faces = accessor_array(plain, primitive["indices"]).reshape(-1, 3)
    packed = DracoPy.encode(points, faces, quantization_bits=16, preserve_order=True)
    n = len(DracoPy.decode(packed).points)
    view = scene.writer.add_bytes(packed if data is None else data)
    bare = {"componentType": 5126, "count": n, "type": "VEC3"}
    scene.writer.accessors.append(bare)
    extension = {"bufferView": view, "attributes": {"POSITION": 0}}
    row = {
        "attributes": {"POSITION": len(scene.writer.accessors) - 1},
        "extensions": {"KHR_draco_mesh_compression": extension},
    }
    scene.meshes.append({"primitives": [row]})
    scene.node("Sofa", mesh=len(scene.meshes) - 1)
    scene.more["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return scene


def with_sofa(scene: Scene) -> Scene:
    scene.node("Sofa", mesh=scene.box([1, 0, 1], [2, 1, 2]))
    return scene


def test_a_draco_mesh_is_the_mesh_that_was_packed() -> None:
    house = read(with_draco_sofa())
    sofa = item(house, "Sofa")
    assert sofa.n_faces == 12
    assert sofa.bounds == pytest.approx(np.array([[1, 0, 1], [2, 1, 2]]), abs=1e-4)


@pytest.mark.parametrize(
    "data", [b"", b"DRACO", b"DRACO\x02\x02\x01\x01" + b"\xff" * 40, b"x" * 99]
)
def test_damaged_draco_data_is_refused_with_its_place(data: bytes) -> None:
    with pytest.raises(BadHouse, match=r"meshes\[\d+\]\.primitives\[0\]"):
        read(with_draco_sofa(data))


def test_without_its_decoder_a_draco_file_is_refused_by_name(monkeypatch: Any) -> None:
    scene, import_before = with_draco_sofa(), builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name in ("DracoPy", "opengl_basisu"):
            raise ImportError(name)
        return import_before(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(BadHouse, match=r"KHR_draco_mesh_compression needs DracoPy.*gltf-transform"):
        read(scene)
    with pytest.raises(ValueError, match="gltf-transform ktxdecompress"):
        decoded_picture(KTX2 + struct.pack("<IIIIIIIII", 0, 1, 4, 4, 0, 0, 1, 1, 1) + bytes(40))


@pytest.mark.parametrize(
    ("size", "said"), [((4, 4), "cannot be decoded"), ((60_000, 60_000), "too large")]
)
def test_a_damaged_or_huge_ktx2_picture_is_refused_with_a_reason(
    size: tuple[int, int], said: str
) -> None:
    header = KTX2 + struct.pack("<IIIIIIIII", 0, 1, *size, 0, 0, 1, 1, 1) + bytes(40)
    with pytest.raises(ValueError, match=said):
        decoded_picture(header)


def test_a_sparse_accessor_replaces_the_listed_values() -> None:
    scene = with_sofa(two_rooms())
    position = scene.meshes[-1]["primitives"][0]["attributes"]["POSITION"]
    places = scene.writer.add_bytes(np.array([0], np.uint8).tobytes())
    values = scene.writer.add_bytes(np.array([[2, 0, 1.5]], np.float32).tobytes())
    accessor = scene.writer.accessors[position]
    accessor["sparse"] = {
        "count": 1,
        "indices": {"bufferView": places, "componentType": 5121},
        "values": {"bufferView": values},
    }
    plain = gltf_from_glb(scene.glb(), "s.glb")
    assert accessor_array(plain, position)[0].tolist() == [2, 0, 1.5]
    accessor["sparse"]["indices"]["componentType"] = 5126
    with pytest.raises(BadHouse, match=r"accessors\["):
        read(scene)


# An 8 x 8 picture of four uniform quarters, made for this test, in both Basis codecs.
UASTC = (
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAA"
    "AAAAAAAAAAAAAAAAAADAAAAAAAAAAEAAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAA"
    "AAB/AAAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuNTAAAAQAAAB/fwAAl5sW5T/a"
    "tgAAAAAAAAAAAJeCFuU/GrYAAAAAAAAAAACX2wPlP9qkAAAAAAAAAAAAl8ID5T9RiwEAAAAAAAAAAA=="
)
ETC1S = (
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgA"
    "AAAAAAAAjgAAAAAAAABGAQAAAAAAAAEAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAA"
    "AAA/AAAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuNTAAAAQAAgAwAAAACQAAAC0A"
    "AAAAAAAAAAAAAAAAAAABAAAAAAAAAAAAAAAaQNwAAAAAQAgvNKUCmBAAAAAAAIE+UAIwAwAAAAAAgEgIwBQAAAAA"
    "AAiURe3U4QCsqqqqUlVVVQUAwUQAAAAAAADyX40AmAEAAAAAAEDCEDAhQAAAAACA5JoAYAIAAAAAAAABBAAE"
)


@pytest.mark.parametrize("text", [UASTC, ETC1S], ids=["uastc", "etc1s"])
def test_a_ktx2_picture_has_the_colours_that_were_encoded(text: str) -> None:
    picture = Image.open(io.BytesIO(decoded_picture(base64.b64decode(text))))
    assert (picture.size, picture.mode) == ((8, 8), "RGB")
    corners = np.asarray(picture).astype(int)[[0, 0, 7, 7], [0, 7, 0, 7]]
    expected = [(220, 180, 40), (20, 180, 40), (220, 30, 40), (20, 30, 40)]
    assert abs(corners - np.array(expected)).max() <= 2
