"""A home for the forms of homes: its items as pieces; no effects.

Each piece has a frame, meshes, a class, collision parts, mass, lamps and a valid file name; the home has
the outlines of its walkable floor.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, TypeVar

import numpy as np
import shapely
from scipy.spatial.transform import Rotation

from pbrs_farm.core import classes
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import House, Item, ItemKind, LightPart, Material, Room, Surface
from pbrs_farm.core.lighting import LightForm, flux_lm
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.core.record import Record
from pbrs_farm.export.home_bodies import Body, bodies_of, box_inertia
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.surface_points import surface_points

_Options = TypeVar("_Options", bound=Record)
COLLISION: Final = "convex parts within 5 mm, no more than 128"
COLLIDES: Final = f"items collide as {COLLISION}"
_MOST_KG: Final = 150.0
_LARGE_M: Final = 0.5  # maximum size of a loose piece that opens
_RESTING_M: Final = 0.03  # maximum gap between an item and its support
_FOOT_M: Final = 0.01  # height of an item's feet
_DRAPED_M: Final = 0.04  # spacing of points on the underside of a cloth
WALKER_M: Final = 0.2  # radius of the walker on the navigable floor
_HEAD_M: Final = 1.6  # height of the walker
_STEP_M: Final = 0.05  # maximum height of a step, as over rugs
_BORNE: Final = 0.25  # minimum supported share of an item's feet

# kinds of the building: static, with their own mesh as collider
BUILDING: Final = (
    ItemKind.WALL,
    ItemKind.FLOOR,
    ItemKind.CEILING,
    ItemKind.GROUND,
    ItemKind.DOOR,
    ItemKind.WINDOW,
    ItemKind.STAIRS,
)
# classes fixed to the building
# fmt: off
_FIXED: Final = frozenset({
    classes.NYU40_NAMES.index(name)
    for name in ("cabinet", "counter", "sink", "toilet", "bathtub", "blinds", "curtain",
                 "mirror", "shower curtain", "otherstructure", "whiteboard", "bookshelf", "dresser",
                 "refrigerator", "floor mat", "wall", "floor", "ceiling", "door", "window")
    if name in classes.NYU40_NAMES
})
# fmt: on


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """A light source of an item, for other programs."""

    position: F64  # (3,) world, metres
    flux_lm: float  # leaving the lamp
    rgb_linear: tuple[float, float, float]  # largest 1
    radius_m: float
    is_coloured: bool  # the source gives a colour, even if it is white
    spot: tuple[tuple[float, float, float], float] | None  # direction in the world, half angle rad

    def placed(self, frame: F64) -> tuple[F64, Rotation | None]:
        """Its position (3,) in a frame, and the turn of -z to a spot's direction; frame: (4, 4) from the world."""
        place = frame[:3, :3] @ self.position + frame[:3, 3]
        if self.spot is None:
            return place, None
        looks = frame[:3, :3] @ np.array(self.spot[0])
        return place, Rotation.align_vectors([looks], [[0.0, 0.0, -1.0]])[0]

    @property
    def candela(self) -> float:
        """The intensity of a point, or within the cone of a spot.

        The flux is taken as even over the sphere, or over the cone of half angle `spot[1]`.
        """
        cutoff = self.spot[1] if self.spot else np.pi
        return float(self.flux_lm / (2 * np.pi * (1 - np.cos(cutoff))))


@dataclass(frozen=True, eq=False)
class Piece:
    """An item in a local frame: the middle of its box's bottom, axes of its box (right-handed).

    The frame of walls, floors and ceilings is the world's, so that their coordinates stay exact.
    """

    item: Item
    instance: int  # in labels of the home's views
    name: str  # unique in the home: letters, digits and _
    world_from_local: F64  # (4, 4) rigid
    surfaces: tuple[Surface, ...]  # local
    size: F64  # (3,) of its box, metres
    is_fixed: bool  # part of the building, fixed to it, floating, or without support
    lamps: tuple[Lamp, ...]
    materials: tuple[Material, ...]  # of its house

    @property
    def is_building(self) -> bool:
        """Wall, floor, ceiling, ground, door, window or stairs: collides as its own mesh."""
        return self.item.kind in BUILDING

    @property
    def class_name(self) -> str:
        """Its NYU40 class."""
        return classes.NYU40_NAMES[self.item.nyu40]

    @cached_property
    def local_from_world(self) -> F64:
        """(4, 4) rigid."""
        return np.asarray(np.linalg.inv(self.world_from_local), np.float64)

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Its body, and each part that a joint moves."""
        return bodies_of(self.name, self.surfaces, self.item, self.materials, self.local_from_world)

    @property
    def opens(self) -> bool:
        """True if it has a part that a joint moves."""
        return len(self.bodies) > 1

    @cached_property
    def colliders(self) -> tuple[F64, ...]:
        """Convex parts (V, 3) of all its bodies, local; () of the building and of items without surfaces.

        No part reaches more than 5 mm beyond the mesh, as long as 32 parts, or 128 separate boards, are enough.
        """
        if self.is_building:
            return ()
        return tuple(part for body in self.bodies for part in body.colliders)

    @cached_property
    def mass_kg(self) -> float:
        """Of all its bodies, no more than 150 kg."""
        return min(sum(body.mass_kg for body in self.bodies), _MOST_KG)

    @property
    def inertia(self) -> F64:
        """(3,) kg m2 about the middle of its box: a solid box's."""
        return box_inertia(self.mass_kg, self.size)


@dataclass(frozen=True, eq=False)
class ExportedHome:
    """A home in the frames of its items."""

    house: House
    pieces: tuple[Piece, ...]  # an item each, in the house's order
    options: Record | None = None  # of the form; None: its defaults

    def of(self, kind: type[_Options]) -> _Options:
        """The form's options, of the type that its FORM names."""
        return self.options if isinstance(self.options, kind) else kind()

    @property
    def building(self) -> tuple[Piece, ...]:
        """Walls, floors, ceilings, doors, windows, stairs."""
        return tuple(p for p in self.pieces if p.is_building)

    @property
    def things(self) -> tuple[Piece, ...]:
        """All other pieces with a surface or a lamp."""
        return tuple(p for p in self.pieces if not p.is_building and (p.surfaces or p.lamps))

    @cached_property
    def materials(self) -> tuple[int, ...]:
        """The used materials, by their number in the house."""
        return tuple(sorted({s.material for piece in self.pieces for s in piece.surfaces}))

    @cached_property
    def navigable(self) -> dict[str, list[F64]]:
        """Room id -> outlines (N, 2) in plan of the floor area free for a disc of WALKER_M.

        Metres, world x and z. Outer outlines only, without holes for a table in the middle of a room. A room
        without free floor has []. Obstacles are boxes of items, and doors do not join rooms.
        """
        return {room.id: _walkable(room, self.pieces) for room in self.house.rooms}

    @property
    def credit(self) -> str:
        """The attribution that the home's source asks for, or its author and licence."""
        source = self.house.source
        return source.attribution or ", ".join(x for x in (source.author, source.licence) if x)


def exported_home(house: House, options: Record | None = None) -> ExportedHome:
    """The home in the frames of its items, without the outdoors and removed items.

    Each item becomes a piece: local meshes, a unique valid file name, lamps in lumen, fixed or loose.
    Collision parts, masses and the walkable floor are computed at first use.
    """
    numbered = [
        (number, item)
        for number, item in enumerate(house.items, 1)
        if not item.is_outside and not item.is_removed
    ]
    house = replace(house, items=tuple(item for _number, item in numbered))
    names = _unique_names(house.items)
    scene = SceneTriangles(house.items)
    pieces = [
        _piece(item, house.materials, number, name, _rests(scene, k))
        for k, ((number, item), name) in enumerate(zip(numbered, names, strict=True))
    ]
    return ExportedHome(house, tuple(pieces), options)


def _unique_names(items: Iterable[Item]) -> list[str]:
    """A name for each item, valid in all file systems and scene formats."""
    taken: set[str] = set()
    names = []
    for item in items:
        word = re.sub(r"[^A-Za-z0-9]+", "_", item.name)[:40].strip("_") or item.kind.value
        name, k = (word if word[0].isalpha() else f"item_{word}"), 2
        while name.lower() in taken:
            name, k = f"{word}_{k}" if word[0].isalpha() else f"item_{word}_{k}", k + 1
        taken.add(name.lower())
        names.append(name)
    return names


def _piece(
    item: Item, materials: tuple[Material, ...], instance: int, name: str, is_resting: bool
) -> Piece:
    frame = np.eye(4)
    box = item.oriented_box
    size = 2 * box.half if item.surfaces else np.zeros(3)
    if not item.kind.is_structure and item.surfaces:
        axes = np.array(box.axes, np.float64)
        if np.linalg.det(axes) < 0:
            axes[:, 0] *= -1
        frame[:3, :3] = axes
        frame[:3, 3] = box.centre - axes[:, 1] * box.half[1]
    local_from_world = np.asarray(np.linalg.inv(frame), np.float64)
    surfaces = tuple(_surface_in_frame(s, local_from_world) for s in item.surfaces if len(s.faces))
    is_fixed = item.kind in BUILDING or item.nyu40 in _FIXED or not is_resting
    is_fixed |= item.is_floating
    is_fixed |= bool(item.joints) and float(size.max()) > _LARGE_M
    return Piece(
        item,
        instance,
        name,
        frame,
        surfaces,
        size,
        is_fixed,
        tuple(map(_lamp, item.lights)),
        materials,
    )


def _surface_in_frame(surface: Surface, b_from_a: F64) -> Surface:
    positions = transform_points(b_from_a, surface.positions).astype(np.float32)
    normals = surface.normals
    if normals is not None:
        turned = normals.astype(np.float64) @ b_from_a[:3, :3].T
        normals = unit_vectors(turned).astype(np.float32)
    return replace(surface, positions=positions, normals=normals)


def _lamp(light: LightPart) -> Lamp:
    flux = flux_lm(light.power, light.unit, light.share)
    if light.is_bare and light.escape is not None:
        flux *= light.escape
    is_spot = light.form is LightForm.SPOT and light.cutoff_rad < np.pi
    spot = (light.direction, light.cutoff_rad) if is_spot else None
    position = np.array(light.position, np.float64)
    if light.position_end is not None:
        position = (position + np.array(light.position_end)) / 2
    return Lamp(position, flux, light.rgb_linear, light.radius_m, light.is_coloured, spot)


def _rests(scene: SceneTriangles, index: int) -> bool:
    """True if an item has a support: a floor, a top, a shelf, the bottom of a drawer; or a bed below a duvet.

    The support is within 3 cm of its feet in height, below a quarter of them, and on both sides of its
    middle along x or along z; or below half of all its underside.
    """
    corners = scene.of_item(index)
    if not len(corners):
        return False
    low, high = scene.bounds[index]
    points = surface_points(corners[corners[:, :, 1].min(1) < low[1] + _FOOT_M], _FOOT_M)
    feet = points[points[:, 1] < low[1] + _FOOT_M]
    borne = _borne(scene, index, feet, low[1])
    if len(borne) >= _BORNE * len(feet) and len(borne):
        middle = (low + high)[[0, 2]] / 2
        sides = (borne.min(0) <= middle + _FOOT_M) & (borne.max(0) >= middle - _FOOT_M)
        if sides.any():
            return True
    points = surface_points(corners, _DRAPED_M)
    points = points[np.argsort(points[:, 1], kind="stable")]
    _, first = np.unique(np.rint(points[:, [0, 2]] / _DRAPED_M), axis=0, return_index=True)
    underside = points[first]
    return len(_borne(scene, index, underside, high[1])) >= len(underside) / 2


def _borne(scene: SceneTriangles, index: int, points: F64, top: float) -> F64:
    """(N, 2) places of those of an item's points that have a support; top: the highest of them."""
    low, high = scene.bounds[index]
    reach = np.array([0.0, _RESTING_M, 0.0])
    below, owners = scene.in_box(low - reach, np.array([high[0], top, high[2]]) + reach)
    # Contents of an open cupboard are no support, although they are near its underside.
    below = below[(owners != index) & (scene.bounds[owners, 0, 1] <= low[1] + _FOOT_M / 2)]
    places = points[:, [0, 2]]
    tops = highest_below(places, below, points[:, 1] + _RESTING_M)
    return np.asarray(places[tops > points[:, 1] - _RESTING_M - _FOOT_M])


def _walkable(room: Room, pieces: Sequence[Piece]) -> list[F64]:
    free: Any = shapely.Polygon(room.polygon).buffer(-WALKER_M, join_style="mitre")
    taken = []
    for piece in pieces:
        item = piece.item
        if item.kind in (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND) or not item.surfaces:
            continue
        low, high = item.bounds
        if low[1] < room.floor_y + _HEAD_M and high[1] > room.floor_y + _STEP_M:
            corners = item.oriented_box.corners[:, [0, 2]]
            taken.append(shapely.MultiPoint(corners).convex_hull)
    if taken and not free.is_empty:
        near = [t for t in taken if t.distance(free) < WALKER_M]
        free = free.difference(shapely.union_all([t.buffer(WALKER_M) for t in near]))
    pieces_of_floor = [g for g in shapely.get_parts(free) if g.area > 0.01]
    rings = [shapely.simplify(g, 0.01) for g in pieces_of_floor if g.geom_type == "Polygon"]
    return [np.asarray(shapely.get_coordinates(g.exterior)[:-1]) for g in rings]


def rooms_json(house: House) -> list[dict[str, Any]]:
    """The rooms in the form of the room file of a glTF scene."""
    return [
        {
            "name": room.name,
            "types": list(room.types),
            "floor_y": float(room.floor_y),
            "ceiling_y": float(room.ceiling_y),
            "polygon": np.asarray(room.polygon).tolist(),
        }
        for room in house.rooms
    ]
