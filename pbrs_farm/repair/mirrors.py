"""Give mirrors a mirror material and panes a transparent one, also as parts of other pieces; no effects.

Sources draw a mirror as a white or grey board, with or without a frame. The room-facing faces in
the plane with most of the piece's area become the mirror's surface; frame, back and sides stay. In
other pieces (a dressing table, a cabinet with panes) parts named mirror or glass count; the label
stays the piece's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.classes import MIRROR, TELEVISION, WHITEBOARD
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Material,
    MaterialKind,
    Room,
    Surface,
    corners_of_surfaces,
    part_of,
)
from pbrs_farm.core.mesh import face_areas, unit_normals
from pbrs_farm.home.names import names_clear_glass, names_mirror

_REFLECTANCE: Final = 0.9
_FLAT_COS: Final = 0.985  # of the angle between faces of one plane
_PLANE_M: Final = 0.004  # across it
_PANE_OPACITY: Final = 0.2  # as of glass that a source calls opaque
_DARK: Final = 0.25  # of the brightest channel, sRGB: darker glass is a hob's or an oven's
_THICKEST_PANE_M: Final = 0.02
_OPAQUE_PIECES: Final = (MIRROR, TELEVISION, WHITEBOARD)
_LEAST_M2: Final = 0.01  # of a mirror's glass
_LEAST_SHARE: Final = 0.12  # of the piece's area
_NEAR_BEST: Final = 0.7  # of the largest plane's area, from which facing the room decides


def with_mirrors(house: House) -> tuple[House, tuple[str, ...]]:
    """The house with working mirrors, also parts named mirror of other pieces, and the changed items' ids."""
    materials = list(house.materials)
    glass: dict[int, int] = {}  # material as read -> its mirror
    rooms = {room.id: room for room in house.rooms}
    items, changed = [], []
    for item in house.items:
        kinds = {house.materials[s.material].kind for s in item.surfaces if len(s.faces)}
        faces = None
        if MaterialKind.MIRROR not in kinds and item.kind is ItemKind.OBJECT:
            if item.nyu40 == MIRROR:
                faces = _glass_of(item, rooms)
            else:
                faces = _named_mirror(item, house.materials, rooms)
        if faces is None:
            items.append(item)
            continue
        items.append(_with_glass(item, faces, materials, glass))
        changed.append(item.id)
    return replace(house, items=tuple(items), materials=tuple(materials)), tuple(changed)


def with_clear_panes(house: House) -> House:
    """The house with transparent panes: thin flat parts named glass, of one light, opaque colour."""
    materials = list(house.materials)
    clear: dict[int, int] = {}  # material as read -> one that lets light through
    items = []
    for item in house.items:
        panes = [
            k
            for k, s in enumerate(item.surfaces)
            if item.kind is ItemKind.OBJECT
            and item.nyu40 not in _OPAQUE_PIECES
            and _is_pane(s, house.materials[s.material])
        ]
        if not panes:
            items.append(item)
            continue
        surfaces = list(item.surfaces)
        for k in panes:
            number = surfaces[k].material
            if number not in clear:
                clear[number] = len(materials)
                pane = replace(materials[number], kind=MaterialKind.GLASS, opacity=_PANE_OPACITY)
                materials.append(pane)
            surfaces[k] = replace(surfaces[k], material=clear[number])
        items.append(replace(item, surfaces=tuple(surfaces)))
    if not clear:
        return house
    return replace(house, items=tuple(items), materials=tuple(materials))


def _is_pane(surface: Surface, material: Material) -> bool:
    is_called = names_clear_glass(surface.name) or names_clear_glass(material.name)
    is_plain = material.kind is MaterialKind.OPAQUE and material.texture_id is None
    if not (is_called and is_plain and len(surface.faces)) or max(material.diffuse) < _DARK:
        return False
    corners = corners_of_surfaces([surface])
    points = corners.reshape(-1, 3)
    largest = unit_normals(corners)[np.argmax(np.nan_to_num(face_areas(corners)))]
    return bool(np.ptp(points @ largest) < _THICKEST_PANE_M)


def _named_mirror(
    item: Item, materials: Sequence[Material], rooms: Mapping[str, Room]
) -> Bools | None:
    """(F,) mirror faces of a piece with a part named mirror; None without such a part."""
    is_named = [
        (names_mirror(s.name) or names_mirror(materials[s.material].name))
        and materials[s.material].kind is MaterialKind.OPAQUE
        for s in item.surfaces
    ]
    named = tuple(s for s, is_one in zip(item.surfaces, is_named, strict=True) if is_one)
    glass = _glass_of(replace(item, surfaces=named), rooms) if named else None
    if glass is None:
        return None
    rows = [
        np.full(len(s.faces), is_one) for s, is_one in zip(item.surfaces, is_named, strict=True)
    ]
    faces = np.concatenate(rows)
    faces[faces] = glass
    return faces


def _glass_of(item: Item, rooms: Mapping[str, Room]) -> Bools | None:
    """(F,) which of all its faces, surface after surface, are its glass; None where none can be."""
    corners = corners_of_surfaces(item.surfaces)
    areas, normals = np.nan_to_num(face_areas(corners)), unit_normals(corners)
    if not areas.size or areas.sum() <= 0:
        return None
    # Collect planes, from the largest face on.
    offsets = np.einsum("ni,ni->n", normals, corners.mean(1))
    rest = areas > 0
    planes: list[Bools] = []
    while rest.any() and len(planes) < 64:
        first = int(np.argmax(np.where(rest, areas, 0)))
        plane = rest & (normals @ normals[first] > _FLAT_COS)
        plane &= np.abs(corners @ normals[first] - offsets[first]).max(1) < _PLANE_M
        plane[first] = True
        planes.append(plane)
        rest &= ~plane
    sizes = np.array([areas[plane].sum() for plane in planes])
    if sizes.max() < max(_LEAST_M2, _LEAST_SHARE * areas.sum()):
        return None
    # Front and back are often alike: the glass is the foremost face towards the room.
    facing = [float(_towards_room(item, corners, rooms) @ normals[np.argmax(p)]) for p in planes]
    best = [k for k in range(len(planes)) if sizes[k] >= _NEAR_BEST * sizes.max()]
    return planes[max(best, key=lambda k: (round(facing[k], 2), sizes[k]))]


def _towards_room(item: Item, corners: F64, rooms: Mapping[str, Room]) -> F64:
    """(3,) unit, level, from the item to the middle of its room; (0, 0, 0) where it is in none."""
    room = rooms.get(item.room_id or "")
    if room is None:
        return np.zeros(3)
    points = corners.reshape(-1, 3)
    middle = (points.min(0) + points.max(0)) / 2
    x, z = np.asarray(room.polygon, np.float64).mean(0) - middle[[0, 2]]
    length = float(np.hypot(x, z))
    return np.array([x, 0.0, z]) / length if length > 0 else np.zeros(3)


def _with_glass(item: Item, faces: Bools, materials: list[Material], glass: dict[int, int]) -> Item:
    """The item with its glass: whole surfaces change material, of others a part becomes one more."""
    surfaces, more = list(item.surfaces), []
    ends = np.cumsum([len(s.faces) for s in item.surfaces])
    for k, part in enumerate(np.split(faces, ends[:-1])):
        if not part.any():
            continue
        surface = item.surfaces[k]
        if surface.material not in glass:
            glass[surface.material] = len(materials)
            materials.append(_as_mirror(materials[surface.material]))
        number = glass[surface.material]
        if part.all():
            surfaces[k] = replace(surface, material=number)
            continue
        surfaces[k] = part_of(surface, surface.faces[~part], surface.name)
        glass_part = part_of(surface, surface.faces[part], f"{surface.name}_glass")
        more.append(replace(glass_part, material=number))
    # Append new surfaces, so that LightPart.emitting stays valid.
    return replace(item, surfaces=(*surfaces, *more))


def _as_mirror(material: Material) -> Material:
    return replace(
        material,
        name=f"{material.name}_mirror",
        kind=MaterialKind.MIRROR,
        specular=(_REFLECTANCE,) * 3,
        opacity=1.0,
        texture_id=None,
        alpha_cutout=False,
        roughness=None,
        roughness_texture_id=None,
        normal_texture_id=None,
    )
