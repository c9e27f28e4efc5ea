"""A House as one neutral pair of files, house.glb and house.json, and back; no effects.

house.glb opens in any glTF viewer: a node per item, a primitive per surface, textures with their
own bytes. house.json says everything else in pretty, canonical JSON. The pair reads back to
exactly the same House: the float32 geometry and the texture bytes are equal bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import USUAL_CUTOFF, House, Item, Material
from pbrs_farm.core.motions import fault_of_motion
from pbrs_farm.formats import glb
from pbrs_farm.formats.house_glb import V_DOWN, glb_from_house
from pbrs_farm.formats.serialise import json_from_value, pretty_json, value_from_json

FORMAT: Final = "pbrs_farm house 1"


def bundle_from_house(house: House) -> tuple[bytes, bytes]:
    """(house.glb, house.json), equal for equal houses; BadHouse for unsound geometry."""
    # Tie the two files together by the digest of the binary one.
    glb_bytes = glb_from_house(house)
    data = _json_of_house(house)
    data["format"] = FORMAT
    data["glb_sha256"] = keys.sha256(glb_bytes)
    data["classes"] = {str(i): NYU40_NAMES[i] for i in sorted({x.nyu40 for x in house.items})}
    return glb_bytes, pretty_json(data).encode("utf-8", "replace")


def _json_of_house(house: House) -> dict[str, Any]:
    """The JSON values of house without the arrays of its surfaces and the bytes of its textures."""
    data: dict[str, Any] = {
        name: json_from_value(getattr(house, name))
        for name in House.__slots__
        if name not in ("items", "textures", "materials")
    }
    # A home in which nothing moves says nothing of it.
    if not house.motions:
        del data["motions"]
    data["materials"] = [_json_of_material(m) for m in house.materials]
    data["items"] = [_json_of_item(item, i + 1) for i, item in enumerate(house.items)]
    data["textures"] = [
        {"key": key, "id": t.id, "name": t.name, "media_type": t.media_type}
        for key, t in house.textures.items()
    ]
    return data


def _json_of_material(material: Material) -> dict[str, Any]:
    data: dict[str, Any] = json_from_value(material)
    # The usual cutoff stays unsaid.
    if material.alpha_cutoff == USUAL_CUTOFF:
        del data["alpha_cutoff"]
    return data


def _json_of_item(item: Item, instance: int) -> dict[str, Any]:
    data = {
        name: json_from_value(getattr(item, name)) for name in Item.__slots__ if name != "surfaces"
    }
    # Items without joints have no such entries.
    if not item.joints:
        del data["joints"]
    data["surfaces"] = [
        {
            "name": s.name,
            "material": int(s.material),
            "n_vertices": len(s.positions),
            "n_faces": len(s.faces),
            **({"part": s.part} if s.part else {}),
        }
        for s in item.surfaces
    ]
    return data | {"instance": instance, "class": NYU40_NAMES[item.nyu40]}


def house_from_bundle(glb_data: bytes, json_data: bytes) -> House:
    """The House of a bundle; BadHouse for damage or files of different houses."""
    data = json_from_bytes(json_data, "house.json")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise BadHouse("house.json", "format", f"expected {FORMAT!r}; this is not a house bundle")
    if data.get("glb_sha256") != keys.sha256(glb_data):
        raise BadHouse("house.json", "glb_sha256", "belongs to another house.glb")
    # Put arrays and pictures of house.glb where house.json left them out.
    gltf = glb.gltf_from_glb(glb_data, "house.glb")
    data["items"] = [
        _item_with_arrays(gltf, item, i) for i, item in enumerate(_dicts(data, "items"))
    ]
    data["textures"] = _textures_with_data(gltf, _dicts(data, "textures"))
    house = value_from_json(House, data, "house.json")
    _check_references(house)
    return house


def _dicts(data: dict[str, Any], key: str) -> list[dict[str, Any]]:
    entries = data.get(key)
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise BadHouse("house.json", key, "expected a list of objects")
    return entries


def _item_with_arrays(gltf: glb.Gltf, item: dict[str, Any], index: int) -> dict[str, Any]:
    # Nodes are in the order of the items, primitives in that of the surfaces.
    node = glb.entry(gltf, "nodes", index)
    mesh = glb.entry(gltf, "meshes", node["mesh"]) if "mesh" in node else {}
    primitives = iter(_dicts(mesh, "primitives") if mesh else [])
    surfaces = [
        _surface_with_arrays(gltf, surface, primitives, f"items[{index}].surfaces[{j}]")
        for j, surface in enumerate(_dicts(item, "surfaces"))
    ]
    return item | {"surfaces": surfaces}


def _surface_with_arrays(
    gltf: glb.Gltf, surface: dict[str, Any], primitives: Iterator[dict[str, Any]], place: str
) -> dict[str, Any]:
    # Only surfaces with vertices have a primitive: an empty one takes none.
    arrays: dict[str, Any] = {
        "positions": np.zeros((0, 3), np.float32),
        "faces": np.zeros((0, 3), np.int32),
    }
    if surface.get("n_vertices"):
        primitive = next(primitives, None)
        if primitive is None:
            raise BadHouse("house.glb", place, "has no primitive")
        arrays = _arrays_of_primitive(gltf, primitive, place)
    got = {"n_vertices": len(arrays["positions"]), "n_faces": len(arrays["faces"])}
    if not got.items() <= surface.items():
        raise BadHouse("house.glb", place, f"has {got}, unlike house.json")
    return surface | arrays


def _arrays_of_primitive(gltf: glb.Gltf, primitive: dict[str, Any], place: str) -> dict[str, Any]:
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict) or "POSITION" not in attributes:
        raise BadHouse("house.glb", place, "has no positions")
    arrays: dict[str, Any] = {
        "positions": glb.accessor_array(gltf, attributes["POSITION"]),
        "faces": np.zeros((0, 3), np.int32),
    }
    if "NORMAL" in attributes:
        arrays["normals"] = glb.accessor_array(gltf, attributes["NORMAL"])
    if "TEXCOORD_0" in attributes:
        # glTF measures v downwards.
        arrays["uvs"] = glb.accessor_array(gltf, attributes["TEXCOORD_0"]) * V_DOWN
    n = len(arrays["positions"])
    if "indices" in primitive:
        numbers = glb.accessor_array(gltf, primitive["indices"])
        if numbers.size % 3 or (numbers.size and numbers.max() >= n):
            raise BadHouse("house.glb", place, "a face names a vertex that does not exist")
        arrays["faces"] = numbers.reshape(-1, 3).astype(np.int32)
    if any(len(arrays.get(k, arrays["positions"])) != n for k in ("normals", "uvs")):
        raise BadHouse("house.glb", place, "has attributes of different lengths")
    return arrays


def _textures_with_data(gltf: glb.Gltf, textures: list[dict[str, Any]]) -> dict[str, Any]:
    # The file lists a buffer view a texture, also of pictures that glTF does not know.
    extras = gltf.document.get("extras")
    views = extras.get("textures") if isinstance(extras, dict) else None
    if not isinstance(views, list) or len(views) != len(textures):
        raise BadHouse("house.glb", "extras.textures", "does not match house.json")
    return {
        str(t.get("key")): t | {"data": glb.view_bytes(gltf, view)}
        for t, view in zip(textures, views, strict=True)
    }


def _check_references(house: House) -> None:
    # Every id and index must lead somewhere: the stages do not ask again.
    levels = {level.id for level in house.levels}
    rooms = {room.id for room in house.rooms}
    for i, room in enumerate(house.rooms):
        if len(room.polygon) < 3:
            raise BadHouse("house.json", f"rooms[{i}].polygon", "has fewer than three corners")
    parts = {item.id: {"", *(joint.part for joint in item.joints)} for item in house.items}
    for i, motion in enumerate(house.motions):
        fault = fault_of_motion(motion)
        if motion.part not in parts.get(motion.item, ()):
            fault = f"no part {motion.part!r} of an item {motion.item!r}"
        if fault:
            raise BadHouse("house.json", f"motions[{i}]", fault)
    for i, item in enumerate(house.items):
        if item.level_id not in levels:
            raise BadHouse("house.json", f"items[{i}].level_id", f"no level {item.level_id!r}")
        if item.room_id is not None and item.room_id not in rooms:
            raise BadHouse("house.json", f"items[{i}].room_id", f"no room {item.room_id!r}")
        if not 0 <= item.nyu40 < len(NYU40_NAMES):
            raise BadHouse("house.json", f"items[{i}].nyu40", f"no class {item.nyu40}")
        for j, surface in enumerate(item.surfaces):
            if not 0 <= surface.material < len(house.materials):
                place = f"items[{i}].surfaces[{j}].material"
                raise BadHouse("house.json", place, f"no material {surface.material}")
