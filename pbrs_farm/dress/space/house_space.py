"""The space of a home being dressed: rooms with their walls, doors, windows, items; no effects."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import FLOOR_MAT
from pbrs_farm.core.house import Item, ItemKind, Room
from pbrs_farm.core.mesh import area_vectors, points_bounds, triangle_bounds
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space.footprints import areal, plan_area
from pbrs_farm.dress.space.passages import Passage, passages_of
from pbrs_farm.dress.space.room_faces import (
    WallAreas,
    meeting,
    reach_of,
    room_faces,
    with_structure,
    with_things,
)
from pbrs_farm.dress.space.wall_faces import Hidden, WallFace, hidden_cells, wall_planes
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.geometry.surface_points import item_triangles, surface_points
from pbrs_farm.home.room_use import RoomKind, room_kind

_ABOVE_FLOOR_M = 0.5  # structure lower than this above a floor is no ceiling
_CHEST_M = 1.2  # height above the floor at which walls are cut for their plan
_INSIDE_SHARE = 0.34  # minimum share of an item's points inside a room for the item to belong to it
_STRUCTURE = (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND)


@dataclass(frozen=True, slots=True, eq=False)
class RoomSpace:
    """A room with its contents and surroundings, in world metres; numbers are indices into MutableHouse.items."""

    room: Room
    kind: RoomKind
    area: BaseGeometry  # its polygon, valid, plan (x, z)
    faces: tuple[WallFace, ...]
    doors: tuple[Passage, ...]  # and archways
    windows: tuple[Passage, ...]
    items: tuple[int, ...]  # indices into MutableHouse.items of its contents
    walls: BaseGeometry  # plan area of the walls at the height of a man's chest
    above: F64  # (F, 3, 3) triangles of ceilings and of what else is over it

    def ceiling_y(self, places: F64) -> F64:
        """(N,) world y of the lowest structure above plan positions (N, 2), else the nominal height."""
        return _ceiling(self.above, self.room)(places)


@dataclass(frozen=True, slots=True, eq=False)
class HouseSpace:
    """Rooms, doors, windows, and points of surfaces, to about 2 cm; later changes need a new one."""

    rooms: tuple[RoomSpace, ...]
    passages: tuple[Passage, ...]
    points: tuple[F64, ...]  # (N, 3) by number of MutableHouse.items; empty for structure
    bounds: F64  # (I, 2, 3) of those points; NaN if there are none

    def room(self, room_id: str) -> RoomSpace:
        """The room with an id; KeyError for an unknown one."""
        for room in self.rooms:
            if room.room.id == room_id:
                return room
        raise KeyError(room_id)

    def is_free(self, low: F64, high: F64, *, without: Collection[int] = ()) -> bool:
        """True if no item but structure and `without` has a point in the box low..high (3,)."""
        for n in meeting(self.bounds, np.array([low, high])):
            if (
                n not in without
                and ((self.points[n] >= low) & (self.points[n] <= high)).all(1).any()
            ):
                return False
        return True


@dataclass(frozen=True, slots=True, eq=False)
class _EmptyRoom:
    # Parts that dressing never moves: the room, and its bare walls.
    room: Room
    area: BaseGeometry
    faces: tuple[WallFace, ...]
    walls: BaseGeometry
    above: F64


@dataclass(slots=True)
class _KeptSpaces:
    # Cache, valid while its items are the same objects; they are referenced, so ids stay unique.
    rooms: tuple[_EmptyRoom, ...]
    passages: tuple[Passage, ...]
    items: dict[int, tuple[Item, F64, F64]]  # with points on it and their bounds
    faces: dict[int, tuple[tuple[int, ...], WallFace]]  # by the empty face, with the items near it
    space: tuple[tuple[int, ...], HouseSpace] | None = None
    reach: dict[int, F64] = field(default_factory=dict)  # by the empty face: see reach_of
    hidden: dict[tuple[int, int], Hidden | None] = field(default_factory=dict)  # by face and item
    inside: dict[tuple[str, int], bool] = field(default_factory=dict)  # by room and item


def house_space(house: MutableHouse) -> HouseSpace:
    """The current rooms of a house: wall faces, doors, windows, contents.

    Call it again after each change of house.items: it compares items by identity, and only recomputes
    the parts of changed items. Never keep its value over a change. Without need for wall faces,
    floor_space is cheaper.

        space = house_space(house)
        room = space.room("0_1")
        is_free = space.is_free(low, high)  # a box (3,), (3,) of the world, metres
    """
    cached, key = _kept_spaces(house), tuple(id(item) for item in house.items)
    if cached.space is None or cached.space[0] != key:
        cached.space = key, _house_space(house.items, cached)
    return cached.space[1]


def floor_space(house: MutableHouse) -> HouseSpace:
    """Like house_space, but cheaper, without wall faces, for passes that use no walls."""
    cached = _kept_spaces(house)
    bare = replace(cached, rooms=tuple(replace(room, faces=()) for room in cached.rooms))
    return _house_space(house.items, bare)


def _kept_spaces(house: MutableHouse) -> _KeptSpaces:
    """The cache of a house, with points on its new items, too."""
    cached = house.kept.get("space")
    if not isinstance(cached, _KeptSpaces):
        cached = house.kept["space"] = _empty_house(house)
    cached.items |= {id(i): _with_points(i) for i in house.items if id(i) not in cached.items}
    return cached


def _with_points(item: Item) -> tuple[Item, F64, F64]:
    if item.kind in _STRUCTURE:
        return item, np.zeros((0, 3)), np.full((2, 3), np.nan)
    points = surface_points(item_triangles(item))
    bounds = np.array(points_bounds(points)) if len(points) else np.full((2, 3), np.nan)
    return item, points, bounds


def _empty_house(mutable: MutableHouse) -> _KeptSpaces:
    house = mutable.source
    areas = [room_area(room) for room in house.rooms]
    wall_items = [i for i in house.items if i.kind is ItemKind.WALL and i.n_faces]
    bounds = np.array([i.bounds for i in wall_items]).reshape(-1, 2, 3)
    walls = WallAreas(
        tuple(plan_area(item_triangles(i), upright=False) for i in wall_items), bounds
    )
    # A place in two rooms belongs to the smaller.
    order = sorted(range(len(areas)), key=lambda k: (areas[k].area, k))
    in_order = [(house.rooms[k], areas[k]) for k in order]
    passages = passages_of(house.items, house.openings, in_order, walls.at)
    overhead = _overhead(house.items)
    faces = room_faces(wall_planes(wall_items), house.rooms, areas)
    rooms = []
    for k, room in enumerate(house.rooms):
        above = _triangles_over(overhead, areas[k])
        empty = _EmptyRoom(room, areas[k], (), walls.at(room.floor_y + _CHEST_M), above)
        ceiling_y = _ceiling(above, room)
        cut = [with_structure(face, walls, passages, ceiling_y) for face in faces.get(k, [])]
        rooms.append(replace(empty, faces=tuple(face for face in cut if face.clear.any())))
    return _KeptSpaces(tuple(rooms), passages, {}, {})


def room_area(room: Room) -> BaseGeometry:
    """The room's outline as a valid plan area; empty where it has fewer than three corners."""
    if len(room.polygon) < 3 or not np.isfinite(room.polygon).all():
        return shapely.Polygon()
    return areal(shapely.Polygon(room.polygon))


def _overhead(items: Sequence[Item]) -> F64:
    # Triangles that can close a room from above: no upright ones.
    corners = [item_triangles(i) for i in items if i.kind in _STRUCTURE]
    triangles = np.concatenate([np.zeros((0, 3, 3)), *corners])
    vectors = area_vectors(triangles)
    return np.asarray(triangles[np.abs(vectors[:, 1]) > 0.02 * np.linalg.norm(vectors, axis=1)])


def _triangles_over(triangles: F64, area: BaseGeometry) -> F64:
    if area.is_empty or not len(triangles):
        return triangles[:0]
    x0, z0, x1, z1 = area.bounds
    low, high = triangle_bounds(triangles)
    meets = (high[:, 0] > x0) & (low[:, 0] < x1) & (high[:, 2] > z0) & (low[:, 2] < z1)
    return np.asarray(triangles[meets])


def _ceiling(above: F64, room: Room) -> Callable[[F64], F64]:
    def ceiling_y(places: F64) -> F64:
        heights = lowest_above(places, above, room.floor_y + _ABOVE_FLOOR_M)
        return np.where(np.isfinite(heights), heights, room.ceiling_y)

    return ceiling_y


def _house_space(items: Sequence[Item], cache: _KeptSpaces) -> HouseSpace:
    points = tuple(cache.items[id(i)][1] for i in items)
    bounds = np.array([cache.items[id(i)][2] for i in items]).reshape(-1, 2, 3)
    rooms = []
    for empty in cache.rooms:
        inside = _items_in(items, points, bounds, empty, cache)
        room_passages = [p for p in cache.passages if empty.room.id in p.room_ids]
        faces = [_face_behind_things(face, items, points, bounds, cache) for face in empty.faces]
        rooms.append(
            RoomSpace(
                empty.room,
                room_kind(empty.room, [items[n] for n in inside], float(empty.area.area)),
                empty.area,
                tuple(face for face in faces if face.clear.any()),
                tuple(p for p in room_passages if not p.is_window),
                tuple(p for p in room_passages if p.is_window),
                inside,
                empty.walls,
                empty.above,
            )
        )
    return HouseSpace(tuple(rooms), cache.passages, points, bounds)


def _face_behind_things(
    face: WallFace, items: Sequence[Item], points: Sequence[F64], bounds: F64, cache: _KeptSpaces
) -> WallFace:
    """The empty face limited by items in front of it; rugs are ignored."""
    if id(face) not in cache.reach:
        cache.reach[id(face)] = reach_of(face)
    near_numbers = meeting(bounds, cache.reach[id(face)])
    near = [n for n in near_numbers if items[n].nyu40 != FLOOR_MAT]
    key = tuple(id(items[n]) for n in near)
    cached = cache.faces.get(id(face))
    if cached is None or cached[0] != key:
        hidden = [_hidden_by(face, items[n], points[n], cache) for n in near]
        cached = cache.faces[id(face)] = key, with_things(face, hidden)
    return cached[1]


def _hidden_by(face: WallFace, item: Item, points: F64, cache: _KeptSpaces) -> Hidden | None:
    key = id(face), id(item)
    if key not in cache.hidden:
        cache.hidden[key] = hidden_cells(face, points)
    return cache.hidden[key]


def _items_in(
    items: Sequence[Item], points: Sequence[F64], bounds: F64, empty: _EmptyRoom, cache: _KeptSpaces
) -> tuple[int, ...]:
    """Numbers of the items of which a good part is in the room; neighbours' poke through outlines."""
    room, area = empty.room, empty.area
    if area.is_empty:
        return ()
    x0, z0, x1, z1 = area.bounds
    shapely.prepare(area)
    numbers = []
    reach = np.array([[x0, room.floor_y - 0.05, z0], [x1, room.ceiling_y, z1]])
    for number in meeting(bounds, reach):
        if items[number].kind in (ItemKind.DOOR, ItemKind.WINDOW):
            continue
        key = room.id, id(items[number])
        if key not in cache.inside:
            some = points[number][:: max(1, len(points[number]) // 200)]
            share = shapely.contains_xy(area, some[:, 0], some[:, 2]).mean()
            cache.inside[key] = bool(share > _INSIDE_SHARE)
        if cache.inside[key]:
            numbers.append(number)
    return tuple(numbers)
