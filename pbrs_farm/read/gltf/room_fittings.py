"""Split windows, blinds and skirting off a room's mesh, by materials and connected parts; no effects."""

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
from pbrs_farm.read.common.room_shells import bounds_of_shells, components, picked

_WELD_M: Final = 1e-4  # corners this near are one
_NARROW_M: Final = 0.12  # a part whose second side is shorter is a strip
_THIN_M: Final = (1e-3, 0.3)  # least side of a closed part that is a board or a frame
_LARGEST_M: Final = 2.5  # longest side of such a part
_MOST_CLOSED: Final = 300  # parts tested for being closed, the largest first
_BESIDE_M: Final = 0.06  # fittings closer than this are one item, metres
_MOST_PARTS: Final = 3_000  # in a mesh of more parts, neighbours are not searched

# Words of names of materials, accents folded.
_WINDOWS: Final = """window fenster fenetre ventana finestra raam fonster vindu glazing sash sill mullion
    louvre louver slat slats blind blinds shutter jalousie"""
_WINDOW_WORDS: Final = frozenset(_WINDOWS.split())
_FRAME_WORDS: Final = frozenset(
    ["frame", "frames", "trim", "casing", "rahmen", "cadre", "marco", "telaio", "kozijn"]
)
_DOOR_WORDS: Final = frozenset(["door", "doors", "tur", "porte", "puerta", "porta", "deur"])
_SKIRTINGS: Final = """skirting baseboard baseboards sockelleiste fussleiste plinthe rodapie battiscopa plint
    listwa"""
_SKIRTING_WORDS: Final = frozenset(_SKIRTINGS.split())


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
    if words & _SKIRTING_WORDS:
        return _SKIRTED
    if words & _DOOR_WORDS:
        return _DOORLIKE
    if names_glass(name) or words & _WINDOW_WORDS:
        return _GLAZED
    return _FRAMED if words & _FRAME_WORDS else _UNSAID


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
