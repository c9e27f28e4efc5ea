"""Draco meshes and KTX2 pictures of glTF, by optional packages; a missing one is an error. No effects."""

from __future__ import annotations

import io
import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pbrs_farm.core.arrays import I64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.formats.glb import Gltf, entry, view_bytes
from pbrs_farm.installation import install_command

DRACO: Final = "KHR_draco_mesh_compression"
BASISU: Final = "KHR_texture_basisu"
_KTX2: Final = b"\xabKTX 20\xbb\r\n\x1a\n"
_MOST_EDGE_PX: Final = 16384
_MOST_PIXELS: Final = 64_000_000
_MOST_POINTS: Final = 20_000_000


def draco_arrays(gltf: Gltf, primitive: dict[str, Any], place: str) -> DracoMesh | None:
    """Decode a primitive's Draco data, if any; BadHouse for damage, wrong counts, and without DracoPy."""
    extensions = primitive.get("extensions")
    row = extensions.get(DRACO) if isinstance(extensions, dict) else None
    if not isinstance(row, dict):
        return None
    try:
        import DracoPy
    except ImportError:
        hint = f"{install_command('gltf')}, or gltf-transform copy IN.glb OUT.glb"
        raise BadHouse(gltf.file, place, f"{DRACO} needs DracoPy", hint=hint) from None
    # Limit the decoding by the file's accessor counts.
    position = entry(gltf, "accessors", (primitive.get("attributes") or {}).get("POSITION"))
    n = position.get("count")
    if type(n) is not int or not 0 < n <= _MOST_POINTS:
        raise BadHouse(gltf.file, place, "has an impossible number of vertices")
    try:
        mesh = DracoPy.decode(view_bytes(gltf, row.get("bufferView")))
        arrays = {int(a["unique_id"]): np.asarray(a["data"]) for a in mesh.attributes}
        faces = np.asarray(mesh.faces, np.int64).reshape(-1)
    except BadHouse:
        raise
    except Exception:  # noqa: BLE001 - whatever a decoder says of damaged data
        raise BadHouse(gltf.file, place, "its Draco data cannot be decoded: damaged") from None
    ids = row.get("attributes")
    named = {
        name: arrays[number].reshape(len(arrays[number]), -1)
        for name, number in (ids.items() if isinstance(ids, dict) else ())
        if type(number) is int and number in arrays
    }
    if "POSITION" not in named or any(len(a) != n for a in named.values()):
        raise BadHouse(gltf.file, place, "its Draco data has other vertices than its accessors")
    return DracoMesh(named, faces)


class DracoMesh:
    """Decoded arrays by attribute, and the vertex numbers of triangles (3 F,)."""

    def __init__(self, attributes: dict[str, NDArray[Any]], order: I64) -> None:
        self.attributes = attributes
        self.order = order


def decoded_picture(data: bytes) -> bytes:
    """PNG bytes of a KTX2 picture, others unchanged; ValueError with the reason."""
    if not data.startswith(_KTX2):
        return data
    if len(data) < 80:
        raise ValueError("the KTX2 picture is cut short")
    width, height = struct.unpack_from("<II", data, 20)
    # Check the size before the decoder takes memory for it.
    if max(width, height) > _MOST_EDGE_PX or not 0 < width * height <= _MOST_PIXELS:
        raise ValueError(f"the picture is too large: {width} x {height}")
    try:
        import opengl_basisu
    except ImportError:
        hint = f"{install_command('gltf')}, or gltf-transform ktxdecompress IN.glb OUT.glb"
        raise ValueError(f"{BASISU} needs opengl-basisu: {hint}") from None
    try:
        texture = opengl_basisu.open(data)
        pixels = np.asarray(texture.transcode("rgba8").data, np.uint8)
    except Exception:  # noqa: BLE001 - whatever a decoder says of damaged data
        raise ValueError("the KTX2 picture cannot be decoded: damaged, or no Basis") from None
    buffer = io.BytesIO()
    picture = Image.fromarray(pixels)
    (picture if texture.has_alpha else picture.convert("RGB")).save(buffer, "PNG")
    return buffer.getvalue()
