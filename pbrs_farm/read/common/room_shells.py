"""A mesh that shows a room from inside -> its walls, floors and ceilings as items; no effects.

Modellers draw floor, walls and ceiling as one mesh whose faces look into the room. Taken for a
solid it is a block that fills the room. Which way faces look is measured by the volume they bound
about their centre: it is negative where they look inward, also where a doorway leaves them open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.house import Item, ItemKind, Surface, corners_of_surfaces, part_of
from pbrs_farm.core.mesh import (
    area_vectors,
    closed_edge_share,
    face_areas,
    signed_volume,
    unit_vectors,
)
from pbrs_farm.geometry.connected import connected_faces
from pbrs_farm.read.common.house_builder import CLASS_OF_STRUCTURE

MAX_PLANES: Final = 200  # A wall of more planes is sculpted, not built of sheets, and stays whole

_WELD_M: Final = 1e-4  # corners this near are one
_LEAST_HEIGHT_M: Final = 1.8  # least height of a room
_LEAST_SIDE_M, _LARGEST_SIDE_M = 0.6, 200.0  # of a room in plan; a larger box is a sky
_LEVEL_UP, _UPRIGHT_UP = 0.98, 0.1  # |y| of the normal: above is level, below is upright
_LEAST_BOXY: Final = 0.7  # minimum share of horizontal and vertical faces in a room
# Twice the volume over the area is the thickness of a plate: a wall has less, a room more.
_THICKER_THAN_WALLS_M: Final = 0.3
_THICKER_THAN_BLOCKS_M: Final = 0.5
_LEVEL: Final = 0.7  # least |y| of the normal of a floor, a ceiling or a roof


def planar_parts(item: Item) -> tuple[Item, ...]:
    """Split an open wall mesh into an item per plane (to a degree and a centimetre); other items unchanged."""
    if item.kind is not ItemKind.WALL or _is_closed(item.surfaces):
        return (item,)
    plane_of_face = plane_of_faces(item.surfaces)
    n = int(plane_of_face.max(initial=0)) + 1
    if not 1 < n <= MAX_PLANES:
        return (item,)
    # Gather the faces of each plane from all surfaces.
    ends = np.cumsum([len(s.faces) for s in item.surfaces])[:-1]
    by_surface = np.split(plane_of_face, ends)
    planes = []
    for plane in range(n):
        parts = tuple(
            part_of(s, s.faces[of_face == plane], s.name)
            for s, of_face in zip(item.surfaces, by_surface, strict=True)
            if (of_face == plane).any()
        )
        planes.append(replace(item, id=f"{item.id}.{plane}", surfaces=parts, lights=(), box=None))
    return (replace(planes[0], lights=item.lights), *planes[1:])


def _is_closed(surfaces: Sequence[Surface]) -> bool:
    """Whether every edge has a face on either side, vertices within a tenth of a millimetre one."""
    return closed_edge_share(np.rint(corners_of_surfaces(surfaces) / _WELD_M)) == 1


def plane_of_faces(surfaces: Sequence[Surface]) -> I64:
    """(F,) plane index, to a degree and a centimetre, ignoring orientation, of all surfaces' faces in turn."""
    p = corners_of_surfaces(surfaces)
    n = unit_vectors(area_vectors(p))
    # Make the two sides of a plane one: the leading component of its normal is positive.
    leading = np.abs(n).argmax(1)
    n *= np.sign(n[np.arange(len(n)), leading])[:, None]
    offset = np.einsum("ij,ij->i", n, p.mean(1))
    # Equal planes agree in normal to about a degree and in offset to a centimetre.
    key = np.rint(np.column_stack([n * 50, offset * 100]))
    _, first, plane = np.unique(key, axis=0, return_index=True, return_inverse=True)
    # Number planes by first appearance, so that ids are stable.
    order = np.argsort(np.argsort(first))
    return np.asarray(order[plane.reshape(-1)], np.int64)


def room_parts(item: Item, others: F64) -> tuple[Item, ...]:
    """The walls, floors and ceilings that an item shows on its inside, one per plane.

    others: (N, 3) centres of other items; a closed block around some of them with outward faces is a
    room too, and is inverted. Remaining faces come last; the outer side, visible only from outside,
    is dropped. Other items are returned unchanged.
    """
    corners = corners_of_surfaces(item.surfaces)
    if not len(corners):
        return (item,)
    # Take the connected shells that look inward, else closed ones that look outward.
    shell_of_face = components(corners)
    bounds = bounds_of_shells(corners, shell_of_face)
    large = np.flatnonzero(_is_large(bounds[:, 0], bounds[:, 1]))  # a plant has 60,000 leaves
    shells = [shell_of_face == k for k in large]
    facing = [_which_way_faces_look(corners[faces], others) for faces in shells]
    sign = min((f for f in facing if f), default=0)
    rooms = [faces for faces, f in zip(shells, facing, strict=True) if sign and f == sign]
    # Take sheets that do not touch together.
    if not rooms and (sign := _which_way_faces_look(corners, others)):
        rooms = [np.ones(len(corners), np.bool_)]
    if not rooms:
        return (item,)
    shown = np.any(rooms, axis=0)
    rest = ~shown & ~_encloses(corners, bounds, shown)[shell_of_face]
    parts = _parts_by_plane(_turn_faces(item, shown) if sign > 0 else item, shown)
    # Leave items unchanged if they contain only the walls of a room.
    if sign < 0 and {p.kind for p in parts} == {item.kind}:
        return (item,)
    remaining = picked(item, rest)
    return (*parts, replace(item, surfaces=remaining, lights=(), box=None)) if remaining else parts


def components(corners: F64) -> I64:
    """(F,) number of the connected mesh of each face; corners (F, 3, 3) within _WELD_M are one."""
    keys = np.rint(corners.reshape(-1, 3) / _WELD_M)
    _, place = np.unique(keys, axis=0, return_inverse=True)
    label = connected_faces(place.reshape(-1, 3))
    return np.asarray(np.unique(label, return_inverse=True)[1], np.int64)


def _which_way_faces_look(corners: F64, others: F64) -> int:
    """-1: the faces show a room from inside; 1: they would if they were turned; 0: no room."""
    low, high = corners.min((0, 1)), corners.max((0, 1))
    if not _is_large(low, high):
        return 0
    # A room is made of level and upright faces.
    areas = face_areas(corners)
    up = np.abs(area_vectors(corners)[:, 1]) / np.maximum(2 * areas, 1e-12)
    boxy = float(areas[(up > _LEVEL_UP) | (up < _UPRIGHT_UP)].sum() / max(areas.sum(), 1e-12))
    if boxy < _LEAST_BOXY:
        return 0
    thickness_m = 2 * signed_volume(corners, (low + high) / 2) / float(areas.sum())
    if thickness_m < -_THICKER_THAN_WALLS_M:
        return -1
    inside = ((others > low) & (others < high)).all(1)
    is_closed = closed_edge_share(np.rint(corners / _WELD_M)) == 1
    return int(thickness_m > _THICKER_THAN_BLOCKS_M and is_closed and bool(inside.any()))


def _is_large(low: F64, high: F64) -> Bools:
    """Whether bounds (..., 3) are those of a room: neither too small nor a sky."""
    size = high - low
    side = size[..., [0, 2]]
    fits = (size[..., 1] >= _LEAST_HEIGHT_M) & (side.min(-1) >= _LEAST_SIDE_M)
    return np.asarray(fits & (side.max(-1) <= _LARGEST_SIDE_M))


def bounds_of_shells(corners: F64, shell_of_face: I64) -> F64:
    """(S, 2, 3) lowest and highest corner of each shell, by the faces' corners and shell numbers."""
    order = np.argsort(shell_of_face, kind="stable")
    starts = np.searchsorted(shell_of_face[order], np.arange(int(shell_of_face.max()) + 1))
    low = np.minimum.reduceat(corners.min(1)[order], starts)
    high = np.maximum.reduceat(corners.max(1)[order], starts)
    return np.stack([low, high], 1)


def _encloses(corners: F64, bounds: F64, shown: Bools) -> Bools:
    """(S,) true for shells whose box contains all visible faces: a hollow block's outer side."""
    low, high = corners[shown].min((0, 1)), corners[shown].max((0, 1))
    return np.asarray((bounds[:, 0] < low).all(1) & (bounds[:, 1] > high).all(1))


def _split(item: Item, chosen: Bools) -> list[Bools]:
    return np.split(chosen, np.cumsum([len(s.faces) for s in item.surfaces])[:-1])


def picked(item: Item, chosen: Bools) -> tuple[Surface, ...]:
    """The item's surfaces with the chosen (F,) faces alone, without unused vertices and empty surfaces."""
    pairs = zip(item.surfaces, _split(item, chosen), strict=True)
    return tuple(part_of(s, s.faces[is_own], s.name) for s, is_own in pairs if is_own.any())


def _turn_faces(item: Item, outward: Bools) -> Item:
    """The item with some faces turned round; normals with those of surfaces turned as a whole."""
    surfaces = []
    for s, is_turned in zip(item.surfaces, _split(item, outward), strict=True):
        faces = np.where(is_turned[:, None], s.faces[:, [0, 2, 1]], s.faces).astype(np.int32)
        normals = None if is_turned.any() and not is_turned.all() else s.normals
        if normals is not None and is_turned.any():
            normals = -normals
        surfaces.append(replace(s, faces=faces, normals=normals))
    return replace(item, surfaces=tuple(surfaces))


def _parts_by_plane(item: Item, shown: Bools) -> tuple[Item, ...]:
    """An item per plane of the faces shown: what looks up is a floor, what looks down a ceiling."""
    corners = corners_of_surfaces(item.surfaces)
    plane = plane_of_faces(item.surfaces)
    normal = area_vectors(corners)
    items: list[Item] = []
    for number in dict.fromkeys(plane[shown].tolist()):
        faces = shown & (plane == number)
        # Faces of one plane may look both ways; part them.
        for sign in (1, -1):
            leading = normal[:, int(np.abs(normal[faces].sum(0)).argmax())]
            is_own = faces & (sign * leading > 0)
            if not is_own.any():
                continue
            total = normal[is_own].sum(0)
            up = float(total[1] / max(float(np.linalg.norm(total)), 1e-12))
            kind = ItemKind.WALL
            if abs(up) > _LEVEL:
                kind = ItemKind.FLOOR if up > 0 else ItemKind.CEILING
            items.append(
                replace(
                    item,
                    id=f"{item.id}.{len(items)}",
                    name=f"{item.name} {kind}".strip(),
                    kind=kind,
                    nyu40=CLASS_OF_STRUCTURE[kind],
                    surfaces=picked(item, is_own),
                    lights=(),
                    box=None,
                    tags=tuple(t for t in item.tags if t != "unmapped"),
                )
            )
    return (replace(items[0], lights=item.lights), *items[1:])
