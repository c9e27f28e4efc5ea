"""Primitives of a glTF mesh -> triangle meshes in its own frame; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrs_farm.core.arrays import F64, I32
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.formats.glb import Gltf, accessor_array, entry
from pbrs_farm.read.gltf.document import numbers, object_at, texture_slots
from pbrs_farm.read.mesh.obj import Mesh

_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # values of primitive.mode


def meshes_of(gltf: Gltf, index: Any, *, max_triangles: int) -> list[tuple[int | None, Mesh]]:
    """(material number or None, mesh) of every primitive of meshes[index] that has triangles.

    Raises BadHouse for damaged arrays and for more than max_triangles.
    """
    primitives = entry(gltf, "meshes", index).get("primitives")
    if not isinstance(primitives, list) or not all(isinstance(p, dict) for p in primitives):
        raise BadHouse(gltf.file, f"meshes[{index}].primitives", "expected a list of objects")
    found: list[tuple[int | None, Mesh]] = []
    n_triangles = 0
    for k, primitive in enumerate(primitives):
        place = f"meshes[{index}].primitives[{k}]"
        if not has_surface(primitive):
            continue
        triangles = _mesh(gltf, primitive, place)
        if triangles is not None:
            n_triangles += len(triangles.faces)
            found.append((primitive.get("material"), triangles))
        if n_triangles > max_triangles:
            text = f"more than {max_triangles} triangles"
            raise BadHouse(gltf.file, place, text, hint="limit: read.max_model_triangles")
    return found


def has_surface(primitive: dict[str, Any]) -> bool:
    """Whether a primitive is made of triangles: points and lines have no surface."""
    return primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN)


def _mesh(gltf: Gltf, primitive: dict[str, Any], place: str) -> Mesh | None:
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict) or "POSITION" not in attributes:
        raise BadHouse(gltf.file, place, "has no positions", hint="or they are compressed")
    positions = _floats(gltf, attributes["POSITION"], 3, f"{place}.POSITION")
    faces = _faces(gltf, primitive, len(positions), place)
    if not len(faces):
        return None
    # Take the texture coordinates that the leading picture uses.
    leading = next(iter(texture_slots(gltf, primitive.get("material")).values()), {})
    name, uvs = f"TEXCOORD_{leading.get('texCoord', 0)}", None
    if name in attributes:
        uvs = _floats(gltf, attributes[name], 2, f"{place}.TEXCOORD")
        uvs = _transformed(gltf, uvs, leading, place) * [1, -1] + [0, 1]  # v up
    normals = np.zeros_like(positions)  # zero: flat, as glTF asks where there are none
    if "NORMAL" in attributes:
        normals = _floats(gltf, attributes["NORMAL"], 3, f"{place}.NORMAL")
    # One value per vertex, or none.
    for array in (uvs, normals):
        if array is not None and len(array) != len(positions):
            raise BadHouse(gltf.file, place, "has attributes of different lengths")
    return Mesh("", "", positions, faces, uvs, normals)


def _floats(gltf: Gltf, accessor: Any, width: int, place: str) -> F64:
    raw = accessor_array(gltf, accessor)
    if raw.shape[1] != width:
        raise BadHouse(gltf.file, place, f"expected {width} components, got {raw.shape[1]}")
    # A signalling NaN sets a flag in the cast; what is not finite is refused below.
    with np.errstate(invalid="ignore"):
        values = raw.astype(np.float64)
    if raw.dtype.kind in "iu" and entry(gltf, "accessors", accessor).get("normalized") is True:
        # Normalised integers are fractions of their type's range (glTF 2.0, section 3.6.2.2).
        values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
    if not (np.abs(values) < 1e9).all():
        raise BadHouse(gltf.file, place, "holds a number that is not finite")
    return values


def _faces(gltf: Gltf, primitive: dict[str, Any], n: int, place: str) -> I32:
    if "indices" in primitive:
        raw = accessor_array(gltf, primitive["indices"])
        if raw.shape[1] != 1 or raw.dtype.kind != "u":
            raise BadHouse(gltf.file, f"{place}.indices", "are no vertex numbers")
        order = raw[:, 0].astype(np.int64)
        if len(order) and order.max() >= n:
            raise BadHouse(gltf.file, place, "a face names a vertex that does not exist")
    else:
        order = np.arange(n)  # the vertices as they come
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        if len(order) % 3:
            raise BadHouse(gltf.file, place, f"{len(order)} corners are no triangles")
        return order.reshape(-1, 3).astype(np.int32)
    # Number the triangles of a fan or a strip; a strip turns every second one over.
    k = np.arange(max(len(order) - 2, 0))
    odd = k % 2
    fan, strip = (np.zeros_like(k), k + 1, k + 2), (k, k + 1 + odd, k + 2 - odd)
    corners = np.stack([order[i] for i in (fan if mode == _FAN else strip)], 1)
    return corners.reshape(-1, 3).astype(np.int32)


def _transformed(gltf: Gltf, uvs: F64, info: dict[str, Any], place: str) -> F64:
    """uvs after KHR_texture_transform: translation x rotation x scale, v still down."""
    turn = object_at(info, "extensions").get("KHR_texture_transform")
    if not isinstance(turn, dict):
        return uvs
    offset = numbers(gltf, turn.get("offset", [0, 0]), 2, f"{place}: texture offset")
    scale = numbers(gltf, turn.get("scale", [1, 1]), 2, f"{place}: texture scale")
    (angle,) = numbers(gltf, [turn.get("rotation", 0)], 1, f"{place}: texture rotation")
    c, s = np.cos(angle), np.sin(angle)
    # Rotate about uv (0, 0), where the picture is top left.
    rotation = np.array([[c, s], [-s, c]])
    return np.asarray((uvs * scale) @ rotation.T + offset)
