"""Pieces of a home as GLB bytes: a node an item, its class in extras, lamps as lights; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, ItemKind
from pbrs_farm.export.home_pieces import Lamp, Piece
from pbrs_farm.formats.glb import GlbWriter
from pbrs_farm.formats.house_glb import gltf_document, item_extras, primitive, write_textures

_LIGHTS = "KHR_lights_punctual"


def glb_of_pieces(
    house: House,
    pieces: Sequence[Piece],
    *,
    with_lamps: bool,
    rooms: list[dict[str, Any]] | None = None,
    in_place: bool = True,
) -> bytes:
    """A GLB of some of the pieces with their materials alone.

    with_lamps: as KHR_lights_punctual, candela. in_place False: one piece in its own frame, without the
    item's name, so that equal items have equal bytes.
    """
    writer = GlbWriter()
    # Number the used materials and textures.
    used = sorted({s.material for p in pieces for s in p.surfaces})
    number = {old: new for new, old in enumerate(used)}
    materials = [house.materials[k] for k in used]
    names = {name for m in materials for name in m.texture_ids}
    textures = write_textures(writer, {k: t for k, t in house.textures.items() if k in names})
    narrow = replace(house, materials=tuple(materials))
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    lights: list[dict[str, Any]] = []
    roots = []
    for piece in pieces:
        extras = item_extras(piece.item, piece.instance)
        if house.is_repaired and piece.item.kind is ItemKind.WALL:
            extras["solid"] = True  # cut by repair: not to be split by its planes
        if not in_place:
            extras = {}
        node: dict[str, Any] = {"name": piece.name if in_place else piece.class_name}
        node["extras"] = extras
        if in_place:
            node |= _placement(piece.world_from_local)
        surfaces = [replace(s, material=number[s.material]) for s in piece.surfaces]
        if surfaces:
            node["mesh"] = len(meshes)
            rows = [primitive(writer, narrow, piece.item, s) for s in surfaces]
            meshes.append({"name": node["name"], "primitives": rows})
        roots.append(len(nodes))
        nodes.append(node)
        if with_lamps and piece.lamps:
            children = range(len(nodes), len(nodes) + len(piece.lamps))
            node["children"] = list(children)
            nodes += [
                _lamp_node(lamp, piece.local_from_world, len(lights) + k)
                for k, lamp in enumerate(piece.lamps)
            ]
            lights += [_punctual_light(lamp) for lamp in piece.lamps]
    document = gltf_document(narrow, nodes, roots, meshes, textures)
    if rooms is not None:
        document["scenes"][0]["extras"] = {"rooms": rooms}
    if lights:
        document |= {"extensions": {_LIGHTS: {"lights": lights}}, "extensionsUsed": [_LIGHTS]}
    return writer.glb(document)


def _placement(world_from_local: F64) -> dict[str, Any]:
    """Translation and rotation of a node, without those that are the identity."""
    placement: dict[str, Any] = {}
    if world_from_local[:3, 3].any():
        placement["translation"] = world_from_local[:3, 3].tolist()
    if not np.array_equal(world_from_local[:3, :3], np.eye(3)):
        placement["rotation"] = Rotation.from_matrix(world_from_local[:3, :3]).as_quat().tolist()
    return placement


def _punctual_light(lamp: Lamp) -> dict[str, Any]:
    light: dict[str, Any] = {"type": "spot" if lamp.spot else "point", "intensity": lamp.candela}
    if lamp.is_coloured or min(lamp.rgb_linear) < 1:
        light["color"] = [float(c) for c in lamp.rgb_linear]
    if lamp.spot:
        # glTF's cones end at a right angle.
        outer = min(lamp.spot[1], np.pi / 2)
        light["spot"] = {"innerConeAngle": 0.0, "outerConeAngle": float(outer)}
        light["intensity"] = float(lamp.flux_lm / (2 * np.pi * (1 - np.cos(outer))))
    return light


def _lamp_node(lamp: Lamp, local_from_world: F64, light: int) -> dict[str, Any]:
    place, turn = lamp.placed(local_from_world)
    node: dict[str, Any] = {
        "name": f"light {light}",
        "translation": place.tolist(),
        "extensions": {_LIGHTS: {"light": light}},
    }
    if turn is not None:
        node["rotation"] = turn.as_quat().tolist()
    return node
