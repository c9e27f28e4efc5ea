"""Binary glTF 2.0: writing deterministic GLB files and reading the arrays of any; no effects."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse

_MAGIC: Final = b"glTF"
_JSON_CHUNK: Final = 0x4E4F534A  # "JSON", little-endian
_BIN_CHUNK: Final = 0x004E4942  # "BIN"
_ARRAY_BUFFER: Final = 34962  # vertices, in OpenGL's numbers
_ELEMENT_ARRAY_BUFFER: Final = 34963  # indices

_UINT, _FLOAT = 5125, 5126  # component types, in OpenGL's numbers

# Component type of an accessor -> dtype.
DTYPES: Final[dict[int, np.dtype[Any]]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    _UINT: np.dtype("<u4"),
    _FLOAT: np.dtype("<f4"),
}

# Type of an accessor -> components per element (matrices are not geometry).
WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True)
class Gltf:
    """A glTF document and its buffers."""

    document: dict[str, Any]
    buffers: tuple[bytes, ...]
    file: str  # its name, for messages


class GlbWriter:
    """Collects buffer views and accessors, then returns the GLB's bytes. State: the parts added so far."""

    def __init__(self) -> None:
        self._binary = bytearray()  # the one buffer
        self.views: list[dict[str, int]] = []  # parts of it
        self.accessors: list[dict[str, Any]] = []  # a view each, with type and count

    def add_bytes(self, data: bytes, *, target: int | None = None) -> int:
        """Index of a new, aligned buffer view of data; target: glTF's number for vertices or indices."""
        # Begin every view at a multiple of four bytes, as accessors of floats need it.
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self._binary += data + b"\0" * (-len(data) % 4)
        self.views.append(view)
        return len(self.views) - 1

    def add_vertices(self, array: F32, *, with_bounds: bool = False) -> int:
        """Index of a new accessor over finite float32 (N >= 1, 2 or 3); with_bounds: for positions."""
        # Give bounds where glTF asks for them: of positions.
        accessor = {
            "bufferView": self.add_bytes(_little(array, "<f4"), target=_ARRAY_BUFFER),
            "componentType": _FLOAT,
            "count": len(array),
            "type": f"VEC{array.shape[1]}",
        }
        if with_bounds:
            accessor["min"] = array.min(0).tolist()
            accessor["max"] = array.max(0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_faces(self, faces: I32) -> int:
        """Index of a new accessor over the unchecked vertex numbers of faces (F >= 1, 3)."""
        self.accessors.append(
            {
                "bufferView": self.add_bytes(_little(faces, "<u4"), target=_ELEMENT_ARRAY_BUFFER),
                "componentType": _UINT,
                "count": faces.size,
                "type": "SCALAR",
            }
        )
        return len(self.accessors) - 1

    def glb(self, document: dict[str, Any]) -> bytes:
        """The file: document with buffers, keys sorted, without empty lists; ValueError for a non-finite number."""
        # Chunks are padded to 4 bytes: JSON with spaces, the binary one with zeros.
        text = json.dumps(
            self._whole(document), sort_keys=True, separators=(",", ":"), allow_nan=False
        ).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), _JSON_CHUNK) + text
        if self._binary:
            chunks += struct.pack("<II", len(self._binary), _BIN_CHUNK) + bytes(self._binary)
        return _MAGIC + struct.pack("<II", 2, 12 + len(chunks)) + chunks

    def gltf(self, document: dict[str, Any], file: str) -> Gltf:
        """The same as a Gltf in memory, for readers of other formats; file: its name in messages."""
        return Gltf(self._whole(document), (bytes(self._binary),), file)

    def _whole(self, document: dict[str, Any]) -> dict[str, Any]:
        document = {
            **document,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self._binary)}] if self._binary else [],
        }
        return {k: v for k, v in document.items() if v != []}


def _little(array: NDArray[Any], dtype: str) -> bytes:
    return np.ascontiguousarray(array).astype(dtype, copy=False).tobytes()


def gltf_from_glb(data: bytes, file: str) -> Gltf:
    """Document and binary chunk of a GLB 2.0, accessors unread; BadHouse for damage."""
    # Header: magic, version, length of the file.
    if len(data) < 20 or data[:4] != _MAGIC:
        raise BadHouse(file, "", "is not a GLB file")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise BadHouse(file, "", f"is glTF {version}; only glTF 2.0 is read")
    if length > len(data):
        raise BadHouse(file, "", f"is cut short: {len(data)} of {length} bytes")
    chunks = _chunks(data, length, file)
    document = json_from_bytes(chunks.get(_JSON_CHUNK, b""), file)
    if not isinstance(document, dict):
        raise BadHouse(file, "", "the JSON chunk is not an object")
    binary = chunks.get(_BIN_CHUNK)
    return Gltf(document, () if binary is None else (binary,), file)


def _chunks(data: bytes, length: int, file: str) -> dict[int, bytes]:
    # Chunks: length, kind, bytes; the first of each kind counts.
    chunks: dict[int, bytes] = {}
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        if offset + 8 + size > length:
            raise BadHouse(file, f"byte {offset}", "chunk reaches past the end")
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    return chunks


def entry(gltf: Gltf, kind: str, index: Any) -> dict[str, Any]:
    """document[kind][index], for references inside a foreign file; BadHouse for any invalid index."""
    entries = gltf.document.get(kind, [])
    fits = isinstance(entries, list) and isinstance(index, int) and not isinstance(index, bool)
    if not fits or not 0 <= index < len(entries) or not isinstance(entries[index], dict):
        raise BadHouse(gltf.file, f"{kind}[{index}]", "does not exist")
    value: dict[str, Any] = entries[index]
    return value


def count(gltf: Gltf, holder: dict[str, Any], key: str, place: str, default: int = 0) -> int:
    """holder[key], or default, as a whole number >= 0; BadHouse names place (as "accessors[3]") and key."""
    value = holder.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise BadHouse(gltf.file, f"{place}.{key}", f"expected a count, got {str(value)[:40]}")
    return value


def view_bytes(gltf: Gltf, index: Any) -> bytes:
    """A copy of the bytes of buffer view index, strides unapplied; BadHouse if it leaves its buffer."""
    # Check every number: the file may be a stranger's.
    place = f"bufferViews[{index}]"
    view = entry(gltf, "bufferViews", index)
    buffer = count(gltf, view, "buffer", place)
    start = count(gltf, view, "byteOffset", place)
    size = count(gltf, view, "byteLength", place)
    if buffer >= len(gltf.buffers) or start + size > len(gltf.buffers[buffer]):
        raise BadHouse(gltf.file, place, "reaches outside its buffer")
    return gltf.buffers[buffer][start : start + size]


def accessor_array(gltf: Gltf, index: Any) -> NDArray[Any]:
    """(count, components) array of accessor index in its own dtype, with sparse values applied.

    Raises BadHouse for an accessor damaged or not of geometry.
    """
    place, accessor = f"accessors[{index}]", entry(gltf, "accessors", index)
    dtype = DTYPES.get(_hashable(accessor.get("componentType")))
    width = WIDTHS.get(_hashable(accessor.get("type")))
    if dtype is None or width is None:
        raise BadHouse(gltf.file, place, "has a type that meshes do not use")
    if "sparse" in accessor:
        return _sparse_array(gltf, accessor, place, dtype, width)
    if "bufferView" not in accessor:
        text, hint = "has no data: its mesh is compressed", "export again without compression"
        raise BadHouse(gltf.file, place, text, hint=hint)
    n = count(gltf, accessor, "count", place)
    # Elements may be interleaved with others: step over the bytes between them.
    data = view_bytes(gltf, accessor.get("bufferView"))
    view = entry(gltf, "bufferViews", accessor["bufferView"])
    size = width * dtype.itemsize
    stride = count(gltf, view, "byteStride", place, size) or size
    start = count(gltf, accessor, "byteOffset", place)
    if stride < size or (n and start + (n - 1) * stride + size > len(data)):
        raise BadHouse(gltf.file, place, "reaches outside its buffer view")
    if n == 0:
        return np.zeros((0, width), dtype)
    return np.ndarray((n, width), dtype, data, start, (stride, dtype.itemsize)).copy()


_MOST_SPARSE: Final = 20_000_000  # maximum elements of an accessor without a buffer view


def _sparse_array(
    gltf: Gltf, accessor: dict[str, Any], place: str, dtype: np.dtype[Any], width: int
) -> NDArray[Any]:
    """Zeros, or the accessor's own data, with some elements replaced (glTF 2.0, section 3.6.2.3)."""
    sparse = accessor["sparse"]
    table = sparse if isinstance(sparse, dict) else {}
    parts: list[dict[str, Any]] = [table.get(k, {}) for k in ("indices", "values")]
    if not all(isinstance(part, dict) and part for part in parts):
        raise BadHouse(gltf.file, f"{place}.sparse", "expected indices and values")
    n, n_given = count(gltf, accessor, "count", place), count(gltf, sparse, "count", place)
    if n > _MOST_SPARSE or n_given > n:
        raise BadHouse(gltf.file, f"{place}.sparse", "has an impossible number of elements")
    # Read both lists as separate accessors.
    kinds = ("SCALAR", accessor.get("type"))
    types = (parts[0].get("componentType"), accessor.get("componentType"))
    rows = [
        part | {"count": n_given, "type": kind, "componentType": number}
        for part, kind, number in zip(parts, kinds, types, strict=True)
    ]
    base = {key: value for key, value in accessor.items() if key != "sparse"}
    whole = Gltf(gltf.document | {"accessors": [*rows, base]}, gltf.buffers, gltf.file)
    places, values = accessor_array(whole, 0)[:, 0], accessor_array(whole, 1)
    if places.dtype.kind != "u" or (len(places) and places.max() >= n):
        raise BadHouse(gltf.file, f"{place}.sparse", "replaces an element that does not exist")
    array = accessor_array(whole, 2) if "bufferView" in base else np.zeros((n, width), dtype)
    array[places] = values
    return array


def _hashable(value: Any) -> Any:
    return value if isinstance(value, (int, str)) else None
