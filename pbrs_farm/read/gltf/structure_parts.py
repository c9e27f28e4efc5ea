"""Split one node of a room into walls, floors, ceilings, windows, skirting, or classify it. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.classes import DOOR, OTHERSTRUCTURE, WALL, WINDOW
from pbrs_farm.core.house import Box, Item, ItemKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import closed_edge_share
from pbrs_farm.home.names import names_glass, words_of
from pbrs_farm.read.common.furniture_classes import PieceSize, words_of_list
from pbrs_farm.read.common.house_builder import CLASS_OF_STRUCTURE
from pbrs_farm.read.common.name_classes import UNMAPPED, class_of_material_name
from pbrs_farm.read.common.room_shells import (
    bounds_of_shells,
    components,
    picked,
    planar_parts,
    room_parts,
)

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


_WELD_M: Final = 1e-4  # corners this near are one
_NARROW_M: Final = 0.12  # a part whose second side is shorter is a strip
_THIN_M: Final = (1e-3, 0.3)  # least side of a closed part that is a board or a frame
_LARGEST_M: Final = 2.5  # longest side of such a part
_MOST_CLOSED: Final = 300  # parts tested for being closed, the largest first
_BESIDE_M: Final = 0.06  # fittings closer than this are one item, metres
_MOST_PARTS: Final = 3_000  # in a mesh of more parts, neighbours are not searched


def parted_fittings(item: Item, *, by_shape: bool) -> tuple[Item, tuple[Item, ...]]:
    """The item without a room's fittings, and the fittings, touching parts merged.

    Fittings are surfaces with materials named after glass, frames, windows, doors or skirting;
    by_shape: also connected parts in the shape of strips or thin closed boards. The item is unchanged
    if all or none of it qualifies.
    """
    corners = corners_of_surfaces(item.surfaces)
    if not len(corners):
        return item, ()
    kind_of_face = _said(item.surfaces)
    part_of_face = _connected_parts(corners, kind_of_face)
    bounds = bounds_of_shells(corners, part_of_face)
    is_named = np.zeros(len(bounds), np.bool_)
    is_named[part_of_face[kind_of_face > 0]] = True
    fitted = is_named
    if by_shape:
        fitted = is_named | _is_strip(bounds) | _is_board(corners, part_of_face, bounds)
    chosen = fitted[part_of_face]
    if chosen.all() or not chosen.any():
        return item, ()
    thing_of_part = _join_touching_parts(bounds, fitted)
    fittings: list[Item] = []
    for thing in range(int(thing_of_part.max()) + 1):
        faces = chosen & (thing_of_part[part_of_face] == thing)
        if faces.any():
            fittings.append(_fitting_item(item, faces, kind_of_face[faces], len(fittings)))
    return replace(item, surfaces=picked(item, ~chosen)), tuple(fittings)


_UNSAID, _GLAZED, _FRAMED, _DOORLIKE, _SKIRTED = range(5)


def _said(surfaces: Sequence[Surface]) -> I64:
    """(F,) what the name of each face's material says."""
    return np.concatenate([np.full(len(s.faces), _of_name(s.name), np.int64) for s in surfaces])


def _of_name(name: str) -> int:
    words = words_of(name)
    if words & words_of_list("skirting"):
        return _SKIRTED
    if words & words_of_list("door"):
        return _DOORLIKE
    if names_glass(name) or words & words_of_list("window"):
        return _GLAZED
    return _FRAMED if words & words_of_list("frame") else _UNSAID


def _connected_parts(corners: F64, kind_of_face: I64) -> I64:
    """(F,) connected parts, those of fittings apart from the walls that they share corners with."""
    part = np.zeros(len(corners), np.int64)
    n = 0
    for kind in np.unique(kind_of_face):
        is_kind = kind_of_face == kind
        part[is_kind] = components(corners[is_kind]) + n
        n = int(part[is_kind].max()) + 1
    return part


def _is_strip(bounds: F64) -> Bools:
    """(P,) whether a part's second longest side is that of a slat or a board."""
    return np.asarray(np.sort(bounds[:, 1] - bounds[:, 0], axis=1)[:, 1] < _NARROW_M)


def _is_board(corners: F64, part_of_face: I64, bounds: F64) -> Bools:
    """(P,) whether a part is a thin closed solid, smaller than a wall."""
    size = np.sort(bounds[:, 1] - bounds[:, 0], axis=1)
    thin = (size[:, 0] > _THIN_M[0]) & (size[:, 0] < _THIN_M[1]) & (size[:, 2] < _LARGEST_M)
    is_solid = np.zeros(len(bounds), np.bool_)
    for part in np.flatnonzero(thin)[np.argsort(-size[thin, 2], kind="stable")][:_MOST_CLOSED]:
        part_corners = corners[part_of_face == part]
        is_solid[part] = closed_edge_share(np.rint(part_corners / _WELD_M)) == 1
    return is_solid


def _join_touching_parts(bounds: F64, fitted: Bools) -> I64:
    """(P,) item index of each part: fitted parts whose boxes touch are one item."""
    numbers = np.flatnonzero(fitted)
    if len(numbers) > _MOST_PARTS:
        return np.zeros(len(bounds), np.int64)
    low, high = bounds[numbers, 0] - _BESIDE_M / 2, bounds[numbers, 1] + _BESIDE_M / 2
    plan = shapely.box(low[:, 0], low[:, 2], high[:, 0], high[:, 2])
    a, b = shapely.STRtree(plan).query(plan, "intersects")
    meets = (low[a, 1] <= high[b, 1]) & (low[b, 1] <= high[a, 1])
    graph = coo_array(
        (np.ones(int(meets.sum()), np.int8), (a[meets], b[meets])), shape=(len(numbers),) * 2
    )
    thing = np.zeros(len(bounds), np.int64)
    thing[numbers] = connected_components(graph, directed=False)[1]
    return thing


def _fitting_item(item: Item, faces: Bools, kind_of_face: I64, number: int) -> Item:
    """The item of some faces: what the names of its materials say most."""
    kind, nyu40, name = ItemKind.OBJECT, OTHERSTRUCTURE, "fitting"
    if (kind_of_face == _DOORLIKE).any():
        kind, nyu40, name = ItemKind.DOOR, DOOR, "door"
    elif (kind_of_face == _GLAZED).any():
        kind, nyu40, name = ItemKind.WINDOW, WINDOW, "window"
    elif (kind_of_face == _SKIRTED).any():
        nyu40, name = WALL, "skirting"
    surfaces = picked(item, faces)
    points = np.concatenate([s.positions for s in surfaces]).astype(np.float64)
    low, high = points.min(0), points.max(0)
    return replace(
        item,
        id=f"{item.id}.{name}{number}",
        name=f"{item.name} {name}".strip(),
        kind=kind,
        nyu40=nyu40,
        surfaces=surfaces,
        lights=(),
        source_class=name,
        box=_upright_box(low, high),
        tags=tuple(t for t in item.tags if t != "unmapped"),
    )


def _upright_box(low: F64, high: F64) -> Box:
    """The box along x, y and z, its thinner level axis last, as a door's or window's."""
    half = (high - low) / 2
    if half[2] <= half[0]:
        return Box((low + high) / 2, half, np.eye(3))
    axes = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    return Box((low + high) / 2, half[[2, 1, 0]], axes)
