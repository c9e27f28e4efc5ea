"""Read SUNCG v2's wall/<id>/<id>.arch.json as structure items and openings (docs/spec/suncg.md section 1.7).

No effects. Walls become solids of their given depth, outward from their points; floors and ceilings
slabs upwards from their offset, like v1's released meshes (the format does not define the direction);
holes become openings that repair cuts.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import checked, json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Item, ItemKind, Opening
from pbrs_farm.read.common.arch_elements import (
    KIND_OF_ELEMENT,
    Arch,
    Element,
    WallFrame,
    element_of,
    slab_surfaces,
    wall_frame,
    wall_surfaces,
)
from pbrs_farm.read.common.house_builder import structure_item
from pbrs_farm.read.common.json_values import Axes
from pbrs_farm.read.common.model_materials import ModelMaterials
from pbrs_farm.read.common.openings import CUTTER_REACH_M, LEAST_HOLE_M, box_between
from pbrs_farm.read.suncg.house_json import Node

MAX_ELEMENTS: Final = 100_000
_BESIDE_M: Final = 0.15  # maximum distance of a hole's centre from its door's bounds, metres
_LEAST_SILL_M: Final = 0.2  # a hole that begins lower is a door's
_MODEL_ROOM: Final = re.compile(r"fr_(\d+)(?:rm|gd)_(\d+)")


def arch_from_json(data: bytes, file: str) -> Arch:
    """The elements of arch.json by room; BadHouse, naming the invalid element."""
    hint = "an arch.json has a list of elements"
    document = checked(_Document, json_from_bytes(data, file), file, error=BadHouse, hint=hint)
    elements: dict[str, list[Element]] = {}
    for i, raw in enumerate(document.elements):
        element = element_of(file, raw, f"element {i}", document.defaults)
        if element is not None:
            elements.setdefault(element.room_id, []).append(element)
    return Arch(document.world_from_house(file), elements)


class _Document(Axes):
    # The count bounds the work before any element is looked at.
    elements: Annotated[list[Any], Field(max_length=MAX_ELEMENTS)]
    defaults: Any = None


def arch_items(arch: Arch, node: Node, room_id: str, materials: ModelMaterials) -> Iterator[Item]:
    """The structure items of a Room or Ground node."""
    for item_id, e, outline in _elements_of(arch, node, room_id):
        frame = wall_frame(e, outline)
        surfaces = (
            slab_surfaces(arch, e, materials)
            if frame is None
            else wall_surfaces(arch, e, frame, materials)
        )
        if not surfaces:
            continue
        yield structure_item(
            item_id,
            KIND_OF_ELEMENT[e.kind],
            surfaces,
            name=f"{e.kind.lower()} {room_id}",
            level_id=node.level_id,
            source_class=f"{node.model_id} {e.kind}",
            room_id=None if e.kind == "Ground" else room_id,
            boundary_of=(room_id,) if e.kind == "Wall" else (),
        )


def arch_openings(
    arch: Arch, rooms: Iterable[tuple[Node, str]], items: Sequence[Item]
) -> tuple[Opening, ...]:
    """The holes of the walls of (node, room id), each with its door or window."""
    results = []
    for node, room_id in rooms:
        for item_id, e, outline in _elements_of(arch, node, room_id):
            frame = wall_frame(e, outline)
            if frame is None:
                continue
            for k, hole in enumerate(e.holes):
                opening = opening_of_hole(arch, e, frame, hole, f"{item_id}_hole{k}", node.level_id)
                results += [_with_leaf(opening, items)] if opening is not None else []
    return tuple(results)


def _elements_of(arch: Arch, node: Node, room_id: str) -> Iterator[tuple[str, Element, F64 | None]]:
    """(item id, element, outline of the room's floor) of every element that is not hidden."""
    # Find the node's elements by its id, else by the room its model names.
    match = _MODEL_ROOM.fullmatch(node.model_id)
    named = [node.id, *([f"{match[1]}_{match[2]}"] if match else [])]
    elements = next((arch.elements[n] for n in named if n in arch.elements), [])
    outline = next((e.points[0] for e in elements if e.kind == "Floor"), None)
    # Skip elements hidden by the node; wall numbers count the remaining ones.
    hides = {"Wall": "Walls", "Ground": "Floor"}
    n_walls = 0
    for e in elements:
        if hides.get(e.kind, e.kind) in node.hidden:
            continue
        suffix = {"Wall": f"w{n_walls}", "Floor": "f", "Ceiling": "c", "Ground": ""}[e.kind]
        n_walls += e.kind == "Wall"
        yield f"{room_id}{suffix}", e, outline


def opening_of_hole(
    arch: Arch,
    e: Element,
    frame: WallFrame,
    hole: tuple[float, float, float, float],
    opening_id: str,
    level_id: str,
) -> Opening | None:
    u0, v0, u1, v1 = hole
    if u1 - u0 < LEAST_HOLE_M or v1 - v0 < LEAST_HOLE_M:
        return None
    # Bring the wall's axes into the world, right-handed.
    scale = np.linalg.norm(arch.world_from_house[:3, 0])
    world_axes = arch.world_from_house[:3, :3] / scale @ frame.axes
    world_axes = world_axes * [np.linalg.det(world_axes), 1, 1]
    # Lay the quad in the wall's middle plane, and let the cutter reach through both faces.
    corners = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
    quad = np.array([frame.start + frame.axes @ [u, v, e.depth_m / 2] for u, v in corners])
    quad = quad @ arch.world_from_house[:3, :3].T
    local = quad @ world_axes
    reach = np.array([0.0, 0.0, e.depth_m / 2 * scale + CUTTER_REACH_M])
    return Opening(
        id=opening_id,
        level_id=level_id,
        item_id=None,
        is_window=v0 > _LEAST_SILL_M,
        cutter=box_between(local.min(0) - reach, local.max(0) + reach, world_axes),
        quad=quad,
        normal=world_axes[:, 2],
    )


def _with_leaf(opening: Opening, items: Sequence[Item]) -> Opening:
    """The opening with the door or window whose bounds hold its middle, if there is one."""
    middle = opening.quad.mean(0)
    for item in items:
        if item.kind in (ItemKind.DOOR, ItemKind.WINDOW):
            low, high = item.bounds
            if (low - _BESIDE_M < middle).all() and (middle < high + _BESIDE_M).all():
                is_window = item.kind is ItemKind.WINDOW
                return replace(opening, item_id=item.id, is_window=is_window)
    return opening
