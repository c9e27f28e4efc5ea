"""house.glb -> triangles with instance, class and material, read here alone; no effects.

Deliberately shares no code with the package's own reader and writer of GLB: it is their check.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_DTYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # glTF component types
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}  # components of an element
_SEE_THROUGH = ("glass", "pane")  # kinds of material
_MAX_ELEMENTS = 50_000_000  # vertices, triangles: nodes may show one mesh many times


class BadGlb(ValueError):
    """house.glb cannot be read; the text says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """The F triangles of a house."""

    vertices: NDArray[np.float32]  # (V, 3) metres
    faces: NDArray[np.int64]  # (F, 3) indices of vertices
    instance: NDArray[np.int64]  # (F,) instance id
    material: NDArray[np.int64]  # (F,) index of the GLB's materials
    nyu40: dict[int, int]  # instance id -> class as the GLB says
    see_through: NDArray[np.bool_]  # (F,) glass and panes
    item: dict[int, str]  # instance id -> id of the item


def triangles_from_glb(data: bytes) -> Triangles:
    """Every triangle of every node; raises BadGlb."""
    try:
        return _triangles(*_chunks(data))
    except (KeyError, IndexError, TypeError, ValueError, struct.error) as error:
        raise BadGlb(f"cannot be read: {error}") from None


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or length != len(data):
        raise ValueError("not a whole glTF 2.0 binary")
    # The JSON chunk comes first; the binary one follows behind its own header.
    n_json, _ = struct.unpack_from("<I4s", data, 12)
    document = json.loads(data[20 : 20 + n_json])
    return document, data[20 + n_json + 8 :]


def _accessor(document: dict[str, Any], binary: bytes, index: int) -> NDArray[Any]:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    width = _WIDTHS[accessor["type"]]
    flat = np.frombuffer(
        binary, _DTYPES[accessor["componentType"]], accessor["count"] * width, start
    )
    return flat.reshape(-1, width)


def _triangles(document: dict[str, Any], binary: bytes) -> Triangles:
    vertices = [np.zeros((0, 3), np.float32)]
    faces = [np.zeros((0, 3), np.int64)]
    owners: list[tuple[int, int, int]] = []  # instance, material, number of faces
    nyu40: dict[int, int] = {}
    item: dict[int, str] = {}
    n_vertices = n_faces = 0
    # Join the primitives of all nodes: those of this package carry no transform.
    for node in document.get("nodes", []):
        instance = int(node["extras"]["instance"])
        nyu40[instance] = int(node["extras"]["nyu40"])
        item[instance] = str(node["extras"].get("item", instance))
        mesh = document["meshes"][node["mesh"]] if "mesh" in node else {"primitives": []}
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) != 4:
                continue  # not triangles
            points = _accessor(document, binary, primitive["attributes"]["POSITION"])
            corners = _accessor(document, binary, primitive["indices"]).reshape(-1, 3)
            vertices.append(points)
            faces.append(corners.astype(np.int64) + n_vertices)
            owners.append((instance, int(primitive["material"]), len(corners)))
            n_vertices += len(points)
            n_faces += len(corners)
            if max(n_vertices, n_faces) > _MAX_ELEMENTS:
                raise ValueError(f"more than {_MAX_ELEMENTS} vertices or triangles")

    # Repeat each primitive's instance and material for its faces.
    table = np.array(owners, np.int64).reshape(-1, 3)
    material = np.repeat(table[:, 1], table[:, 2])
    kinds = [m.get("extras", {}).get("kind", "opaque") for m in document.get("materials", [])]
    clear = np.array([k in _SEE_THROUGH for k in kinds], bool)
    return Triangles(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.repeat(table[:, 0], table[:, 2]),
        material,
        nyu40,
        clear[material] if len(material) else np.zeros(0, bool),
        item,
    )
