"""Split one node of a room into walls, floors and ceilings, or classify it by its materials. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.read.common.furniture_classes import PieceSize
from pbrs_farm.read.common.name_classes import UNMAPPED, class_of_material_name
from pbrs_farm.read.common.room_shells import planar_parts, room_parts
from pbrs_farm.read.common.structure_items import CLASS_OF_STRUCTURE
from pbrs_farm.read.gltf.room_fittings import parted_fittings

_THICKEST_OPENING_M: Final = 1.5  # a porch of glass has less


def centres_of(items: Sequence[Item]) -> F64:
    """(N, 3) centres of items that are not part of a room."""
    centres = [i.bounds.mean(0) for i in items if i.n_faces and i.kind not in CLASS_OF_STRUCTURE]
    return np.array(centres, np.float64).reshape(-1, 3)


def structure_parts(item: Item, others: F64) -> tuple[Item, ...]:
    """Split a node's item if its class is structure or unknown.

    others: centres_of all items. After its fittings (room_fittings), a room seen from inside is split
    by face directions; other meshes by the names of their materials; open walls plane by plane. A node
    whose name contains window or door ("Room with windows"), or is "Ground" or "Ground floor", may be
    a room too if it is large enough.
    """
    is_unknown = UNMAPPED in item.tags
    may_be_room = item.kind in (*CLASS_OF_STRUCTURE, ItemKind.GROUND) or is_unknown
    if not (may_be_room or _is_too_large_for_an_opening(item)):
        return (item,)
    # Parts identified by name or connectivity are not sides of the room, whatever their face
    # directions.
    rest, fittings = parted_fittings(item, by_shape=True)
    parts = room_parts(rest, others)
    if fittings and parts[0] is rest:
        rest, fittings = item, ()
        if item.kind is ItemKind.WALL:
            rest, fittings = parted_fittings(item, by_shape=False)
        parts = room_parts(rest, others)
    if parts[0] is rest and (is_unknown or item.kind is ItemKind.WALL):
        parts = _by_materials(rest)
    return (*(p for part in parts for p in planar_parts(part)), *fittings)


def _is_too_large_for_an_opening(item: Item) -> bool:
    if item.kind not in (ItemKind.DOOR, ItemKind.WINDOW) or not item.n_faces:
        return False
    low, high = item.bounds
    return bool((high - low)[[0, 2]].min() > _THICKEST_OPENING_M)


def _by_materials(item: Item) -> tuple[Item, ...]:
    kinds = [class_of_material_name(s.name) for s in item.surfaces]
    # Separate wall, floor and ceiling; surfaces with inconclusive names stay with the item.
    groups: dict[ItemKind | None, list[Surface]] = {}
    for surface, material_class in zip(item.surfaces, kinds, strict=True):
        kind = (
            material_class.kind
            if material_class and material_class.kind in CLASS_OF_STRUCTURE
            else None
        )
        groups.setdefault(None if kind is item.kind else kind, []).append(surface)
    if set(groups) == {None}:
        return (_name_by_materials(item),)
    parts = [replace(item, surfaces=tuple(groups.pop(None)))] if None in groups else []
    for kind, surfaces in groups.items():
        assert kind is not None
        part = replace(
            item,
            id=f"{item.id}.{kind}" if parts else item.id,
            kind=kind,
            nyu40=CLASS_OF_STRUCTURE[kind],
            surfaces=tuple(surfaces),
            box=None,
            lights=() if parts else item.lights,
            tags=_tags_of_known(item),
        )
        parts.append(part)
    return tuple(parts)


def _name_by_materials(item: Item) -> Item:
    # An unknown item takes the class that all of its materials agree on, if the size fits: a plane
    # of
    # Grass is ground, a board of Pine is not a plant.
    if UNMAPPED not in item.tags or not item.n_faces:
        return item
    width, height, depth = np.ptp(item.bounds, axis=0).tolist()
    size = PieceSize(width, height, depth)
    first_class, *other_classes = [class_of_material_name(s.name, size=size) for s in item.surfaces]
    if first_class is None or any(next_class != first_class for next_class in other_classes):
        return item
    if first_class.kind in (ItemKind.LAMP, ItemKind.PERSON, ItemKind.DOOR, ItemKind.WINDOW):
        return item  # needs more than a class: light, a place in a wall
    return replace(item, nyu40=first_class.nyu40, kind=first_class.kind, tags=_tags_of_known(item))


def _tags_of_known(item: Item) -> tuple[str, ...]:
    return tuple(t for t in item.tags if t != UNMAPPED)
