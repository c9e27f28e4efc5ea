"""Walls and slabs of an arch.json (SUNCG v2, sceneState) -> closed solids. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
import shapely
from pydantic import BeforeValidator, FailFast, Field

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, checked, exactly
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import ItemKind, MaterialKind, Surface
from pbrs_farm.geometry.plan_surfaces import counter_clockwise, horizontal
from pbrs_farm.geometry.solids import box_quads, quads_surface
from pbrs_farm.read.common.json_values import (
    Given,
    Label,
    Lenient,
    Override,
    Overrides,
    Vector,
    number_array,
)
from pbrs_farm.read.common.model_materials import ModelMaterials
from pbrs_farm.read.common.placed_mesh import mesh_of_surface, placed
from pbrs_farm.read.mesh.mtl import ObjMaterial

# Default wall thickness.
WALL_DEPTH_M: Final = 0.10
SLAB_DEPTH_M: Final = 0.05
_EDGE: Final = ObjMaterial("edge", (0.50196, 0.50196, 0.50196))  # sRGB 128; not given in files
KIND_OF_ELEMENT: Final = {kind.value.title(): kind for kind in ItemKind if kind.is_structure}


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """An element of arch.json."""

    kind: str
    place: str  # for messages
    room_id: str
    points: tuple[F64, ...]  # a wall's two ends, or a slab's outline and holes
    overrides: tuple[Override, ...]  # inside and outside of a wall
    depth_m: float  # thickness
    height_m: float = 0.0  # of a wall
    holes: tuple[tuple[float, float, float, float], ...] = ()  # (H, 4): from, up from, to, up to
    hole_types: tuple[str, ...] = ()  # as written, "" if a hole has no type


@dataclass(frozen=True, slots=True, eq=False)
class Arch:
    """arch.json as read."""

    world_from_house: F64  # (4, 4)
    elements: dict[str, list[Element]]  # by room or ground, in file order


_Length = Annotated[Finite, Field(ge=0, lt=1000)]
_Corner = Annotated[F64, number_array(2)]


class _Common(Given):
    room_id: Label = Field("", alias="roomId")
    overrides: Overrides = Field((), alias="materials")
    depth: _Length


class _Box(Given):
    min: _Corner
    max: _Corner


class _Hole(Given):
    box: _Box
    type: Label = ""


class _Wall(_Common):
    """A wall by its two ends, its height above them and its holes."""

    points: Annotated[list[Vector], exactly(2, "ends")]
    height: _Length
    extraHeight: _Length  # noqa: N815
    holes: Annotated[tuple[_Hole, ...], FailFast(), Lenient] = ()


def _list_of_rings(points: object) -> object:
    # Tell one ring of corners from a list of rings by what the first entries hold.
    if not isinstance(points, list):
        return points
    nested = points and all(isinstance(p, list) and p and isinstance(p[0], list) for p in points)
    return points if nested else [points]


_Ring = Annotated[list[Vector], Field(min_length=3, fail_fast=True)]


class _Slab(_Common):
    """A slab by its outline and holes in house coordinates, which may be one ring."""

    points: Annotated[list[_Ring], FailFast(), BeforeValidator(_list_of_rings)]
    offset: Vector = np.zeros(3)


def element_of(file: str, raw: Any, place: str, defaults: Any) -> Element | None:
    """A wall, floor, ceiling or ground of an arch.json, in the file's own axes and units of metres.

    raw: the entry. place: for messages. defaults: the file's, by kind, for missing fields. None for an
    unknown kind. Raises BadHouse, naming the invalid value.
    """
    raw = checked(dict, raw, file, place, error=BadHouse)
    kind = raw.get("type")
    if not isinstance(kind, str) or kind not in KIND_OF_ELEMENT:
        return None
    place = f"{place} ({kind} {str(raw.get('id', ''))[:40]})"
    # Take what the element lacks from the defaults of its kind.
    usual = defaults.get(kind) if isinstance(defaults, dict) else None
    usual = usual if isinstance(usual, dict) else {}
    depth = usual.get("depth", WALL_DEPTH_M if kind == "Wall" else SLAB_DEPTH_M)
    raw = {"depth": depth} | raw | {"extraHeight": usual.get("extraHeight", 0)}
    if kind == "Wall":
        wall = checked(_Wall, raw, file, place, error=BadHouse)
        holes = tuple((*h.box.min.tolist(), *h.box.max.tolist()) for h in wall.holes)
        height, ends = wall.height + wall.extraHeight, (np.array(wall.points),)
        types = tuple(h.type for h in wall.holes)
        return Element(
            kind, place, wall.room_id, ends, wall.overrides, wall.depth, height, holes, types
        )
    slab = checked(_Slab, raw, file, place, error=BadHouse)
    rings = tuple(np.array(ring) + slab.offset for ring in slab.points)
    return Element(kind, place, slab.room_id, rings, slab.overrides, slab.depth)


def _material(materials: ModelMaterials, e: Element, position: int) -> int:
    """The material at a position of the element, the first one where there are fewer."""
    override = e.overrides[min(position, len(e.overrides) - 1)] if e.overrides else None
    if e.kind == "Wall":
        material = materials.wall_material(None, override, place=e.place)
    else:
        material = materials.material(None, override, place=e.place, clear=MaterialKind.GLASS)
    return materials.library.index(material)


def _surfaces_with_area(arch: Arch, surfaces: Sequence[Surface]) -> tuple[Surface, ...]:
    in_world = (
        placed(mesh_of_surface(s), arch.world_from_house, name=s.name, material=s.material)
        for s in surfaces
    )
    return tuple(s for s in in_world if s is not None)


def slab_surfaces(arch: Arch, e: Element, materials: ModelMaterials) -> tuple[Surface, ...]:
    """A floor or ceiling as a slab upwards from its points: those of top, bottom and side with an area."""
    material = _material(materials, e, 0)
    # Turn the outline counter-clockwise and its holes the other way.
    low = float(e.points[0][:, 1].min())
    high = low + e.depth_m
    plans = [counter_clockwise(ring[:, [0, 2]]) for ring in e.points]
    plans = [plans[0], *(p[::-1] for p in plans[1:])]
    # Stand a side on each edge of each ring.
    sides = []
    for plan in plans:
        for a, b in zip(plan, np.roll(plan, -1, axis=0), strict=True):
            sides.append(
                [[b[0], low, b[1]], [a[0], low, a[1]], [a[0], high, a[1]], [b[0], high, b[1]]]
            )
    parts = [
        horizontal("top", [plans], high, material, up=True),
        horizontal("bottom", [plans], low, material, up=False),
    ]
    if e.depth_m > 0:
        parts.append(quads_surface("side", np.array(sides), material))
    return _surfaces_with_area(arch, parts)


@dataclass(frozen=True, slots=True, eq=False)
class WallFrame:
    """Frame of a wall: its start, (3, 3) unit columns along, up, outward, and its length."""

    start: F64
    axes: F64
    length: float


def wall_frame(e: Element, outline: F64 | None) -> WallFrame | None:
    """The frame of a wall with an extent, outward from the room's floor; None for all else.

    outline: (N, 3) of the room's floor in the world, None where it is not known: then it is the
    right side of the way from the wall's first point to its second, which may be the inner one.
    None also for a wall without length, height or thickness.
    """
    if e.kind != "Wall":
        return None
    # Span the wall by its level direction, and look outward.
    start, end = e.points[0]
    along = (end - start) * [1, 0, 1]
    length = float(np.linalg.norm(along))
    if length < 1e-3 or e.height_m <= 0 or e.depth_m <= 0:
        return None
    along /= length
    up = np.array([0.0, 1.0, 0.0])
    outward = np.cross(along, up)
    # Turn away from the room's floor.
    if outline is not None:
        x, _y, z = (start + end) / 2 + 0.05 * outward
        if shapely.contains_xy(shapely.Polygon(outline[:, [0, 2]]), x, z):
            outward = -outward
    return WallFrame(start, np.stack([along, up, outward], 1), length)


def wall_surfaces(
    arch: Arch, e: Element, frame: WallFrame, materials: ModelMaterials
) -> tuple[Surface, ...]:
    """A wall as a closed box without holes: inside, outside and edge, each with its side's material."""
    # Turn a left-handed frame round: the box's faces must look outward.
    half = np.array([frame.length, e.height_m, e.depth_m]) / 2
    right_handed = frame.axes * [np.linalg.det(frame.axes), 1, 1]
    quads = box_quads(frame.start + frame.axes @ half, half, right_handed)
    edge = materials.material(_EDGE, None, place=e.place, clear=MaterialKind.GLASS)
    return _surfaces_with_area(
        arch,
        [
            quads_surface("inside", quads[4:5], _material(materials, e, 0)),
            quads_surface("outside", quads[5:], _material(materials, e, 1)),
            quads_surface("edge", quads[:4], materials.library.index(edge)),
        ],
    )
