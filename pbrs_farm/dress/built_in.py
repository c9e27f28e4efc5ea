"""Apply the home's finish scheme to doors, windows, stairs, railings, radiators and appliances.

Textured parts and glass are unchanged. Effects: changes the house.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import DOOR, MIRROR, OTHERFURNITURE, OTHERSTRUCTURE, REFRIGERATOR
from pbrs_farm.core.house import Item, ItemKind, Material, MaterialKind, Surface, part_of
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.dress.box_mapping import connected_parts
from pbrs_farm.dress.finish_scheme import FinishScheme, finish_scheme
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.surface_finishes import Finish, is_plain, item_with_finish, with_finish
from pbrs_farm.home.names import RADIATORS, names_glass, words_of_item

PASS: Final = "joinery"  # in reports and random streams
_SMALL_M: Final = (
    0.25  # maximum size of handles and hinges; larger parts belong to the frame or the leaf
)
_FRAME: Final = 0.97  # of the width: what reaches so far is the frame
_SLENDER_M: Final = 0.13  # rails, balusters and pipes: their second longest side
_FRONT_SHARE: Final = 0.3  # of an appliance's faces: a part that has more is its body
_APPLIANCES: Final = frozenset(
    {"cooker", "dishwasher", "washer", "hood", "oven", "dryer", "fridge", "freezer"}
)
_TO_STREET: Final = ("front", "garage", "entrance")


def finish_built_in_parts(
    house: MutableHouse, catalogue: Catalogue, style: Style, share: float
) -> None:
    """Give a share of the kinds of doors, windows, stairs and appliances the scheme's finishes."""
    scheme = finish_scheme(house, style)
    kinds = {
        kind: float(house.rng(PASS, kind).random()) < share
        for kind in (
            "door",
            "window",
            "stairs",
            "railing",
            "radiator",
            "appliance",
            "spotlight",
            "mirror",
        )
    }
    for index, item in enumerate(house.items):
        if item.kind.is_structure or not item.n_faces:
            continue
        kind = _kind_in_scheme(item)
        if not kinds.get(kind, False):
            continue
        finished = _finish_by_scheme(house, item, kind, scheme)
        if finished is not item:
            house.change(index, finished, PASS)
            house.done[f"{PASS}: {kind}"] += 1


def _kind_in_scheme(item: Item) -> str:
    """The item's kind in the scheme, "" for none."""
    words = words_of_item(item)
    if item.kind is ItemKind.WINDOW:
        return "window"
    if item.kind is ItemKind.DOOR or item.nyu40 == DOOR:
        return "door"
    if item.kind is ItemKind.STAIRS:
        return "stairs"
    if item.nyu40 == MIRROR:
        return "mirror"
    if item.nyu40 == OTHERSTRUCTURE:
        return "railing"
    if item.kind is ItemKind.LAMP:
        return "spotlight" if any("spot" in word for word in words) else ""
    if item.nyu40 == OTHERFURNITURE and words & RADIATORS:
        return "radiator"
    is_appliance = item.nyu40 in (OTHERFURNITURE, REFRIGERATOR)
    return "appliance" if is_appliance and words & _APPLIANCES else ""


def _finish_by_scheme(house: MutableHouse, item: Item, kind: str, scheme: FinishScheme) -> Item:
    if kind == "door":
        words = f"{item.name} {item.source_class}".casefold()
        is_front = any(word in words for word in _TO_STREET)
        return _finish_opening(
            house, item, scheme, scheme.front if is_front else scheme.leaf, scheme.trim
        )
    if kind == "window":
        return _finish_opening(house, item, scheme, scheme.window, scheme.window)
    if kind == "stairs":
        finish = scheme.stone if item.room_id is None and len(item.surfaces) > 1 else scheme.stair
        return item_with_finish(house, item, finish)
    if kind == "railing":
        return item_with_finish(house, item, _finish_of_railing(item, scheme))
    if kind == "radiator":
        return item_with_finish(house, item, scheme.radiator)
    if kind == "mirror":
        return _finish_mirror_frame(house, item, scheme)
    if kind == "spotlight":
        return _finish_spotlight(house, item, scheme)
    return _finish_appliance(house, item, scheme)


def _finish_of_railing(item: Item, scheme: FinishScheme) -> Finish:
    # Rails and balusters are thin in two directions; other parts are built of stone.
    if float(np.sort(item.oriented_box.half * 2)[1]) > _SLENDER_M:
        return scheme.stone
    return scheme.pipe if "pipe" in item.name.casefold() else scheme.railing


def _finish_opening(
    house: MutableHouse, item: Item, scheme: FinishScheme, leaf: Finish, frame: Finish
) -> Item:
    """A door or window by its connected surfaces: those across its width are frame, small ones fittings.

    Generated ones name their fittings and joinery, of which parts may be small, and glass that is not clear.
    """
    # Lights refer to surfaces by index, which a split would change.
    takes = [_takes_finish(house.materials[s.material]) for s in item.surfaces]
    if any(light.emitting for light in item.lights) or not any(takes):
        return item
    box = item.oriented_box
    wide = float(box.half[0] * 2)
    surfaces: list[Surface] = []
    for surface, is_taken in zip(item.surfaces, takes, strict=True):
        if not is_taken:
            surfaces.append(surface)
            continue
        word = house.materials[surface.material].name.rpartition("_")[2]
        least = {"handle": np.inf, "joinery": 0.0}.get(word, _SMALL_M)
        for part, size in _connected_surfaces(surface, box.axes):
            is_frame = size[0] > _FRAME * wide and frame != leaf
            finish = scheme.fitting if size.max() < least else frame if is_frame else leaf
            surfaces.append(with_finish(house, part, finish, box.axes))
    return replace(item, surfaces=tuple(_merge_surfaces(surfaces)))


def _takes_finish(material: Material) -> bool:
    return is_plain(material) and not names_glass(material.name)


def _connected_surfaces(surface: Surface, axes: F64) -> Iterator[tuple[Surface, F64]]:
    """Each connected part of a surface, and its size along the axes (3,)."""
    part = connected_parts(surface, axes)[surface.faces[:, 0]]
    for k in range(int(part.max(initial=-1)) + 1):
        mine = part_of(surface, surface.faces[part == k], surface.name)
        if len(mine.faces):
            yield mine, np.ptp(mine.positions.astype(np.float64) @ axes, axis=0)


def _merge_surfaces(surfaces: list[Surface]) -> list[Surface]:
    """Surfaces of one name, material and part as one, in the order they are first met."""
    groups: dict[tuple[str, int, str], list[Surface]] = {}
    for surface in surfaces:
        groups.setdefault((surface.name, surface.material, surface.part), []).append(surface)
    return [_join_surfaces(some) for some in groups.values()]


def _join_surfaces(some: list[Surface]) -> Surface:
    if len(some) == 1:
        return some[0]
    starts = np.cumsum([0, *(len(s.positions) for s in some)])
    uvs = [s.uvs for s in some if s.uvs is not None]
    normals = [s.normals for s in some if s.normals is not None]
    return replace(
        some[0],
        positions=np.concatenate([s.positions for s in some]),
        faces=np.concatenate([s.faces + n for s, n in zip(some, starts, strict=False)]).astype(
            np.int32
        ),
        uvs=np.concatenate(uvs) if len(uvs) == len(some) else None,
        normals=np.concatenate(normals) if len(normals) == len(some) else None,
    )


def _finish_appliance(house: MutableHouse, item: Item, scheme: FinishScheme) -> Item:
    # The body alone: plates, doors and panels keep their glass and black.
    areas = [float(face_areas(triangle_corners(s.positions, s.faces)).sum()) for s in item.surfaces]
    return _finish_some(
        house,
        item,
        scheme.appliance,
        [
            a >= _FRONT_SHARE * sum(areas) and _is_bright(house, s)
            for a, s in zip(areas, item.surfaces, strict=True)
        ],
    )


def _finish_mirror_frame(house: MutableHouse, item: Item, scheme: FinishScheme) -> Item:
    # Where no surface is known to be glass, all of it may be.
    materials = [house.materials[s.material] for s in item.surfaces]
    if not any(m.kind is MaterialKind.MIRROR for m in materials):
        return item
    return item_with_finish(house, item, scheme.trim)


def _finish_spotlight(house: MutableHouse, item: Item, scheme: FinishScheme) -> Item:
    emitting = {k for light in item.lights for k in light.emitting}
    return _finish_some(
        house, item, scheme.spotlight, [k not in emitting for k in range(len(item.surfaces))]
    )


def _finish_some(house: MutableHouse, item: Item, finish: Finish, covers: list[bool]) -> Item:
    axes = item.oriented_box.axes
    surfaces = tuple(
        with_finish(house, s, finish, axes)
        if is_mine and is_plain(house.materials[s.material])
        else s
        for s, is_mine in zip(item.surfaces, covers, strict=True)
    )
    if all(a is b for a, b in zip(surfaces, item.surfaces, strict=True)):
        return item
    return replace(item, surfaces=surfaces)


def _is_bright(house: MutableHouse, surface: Surface) -> bool:
    return max(house.materials[surface.material].diffuse) > 0.25
