"""The space of a home being dressed: rooms with their walls, doors, windows, things; no effects."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.classes import FLOOR_MAT
from pbrs_farm.core.house import Item, ItemKind, Room
from pbrs_farm.core.mesh import area_vectors, boxes_meeting, points_bounds, triangle_bounds
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space.footprints import areal, plan_area
from pbrs_farm.dress.space.passages import Passage, passages_of
from pbrs_farm.dress.space.wall_faces import (
    CELL_M,
    FAR_M,
    Hidden,
    WallFace,
    WallPlane,
    hidden_cells,
    runs,
    wall_planes,
)
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.geometry.surface_points import item_triangles, surface_points
from pbrs_farm.home.room_use import RoomKind, room_kind

# Wall faces cut to rooms, and what of them structure and things leave free.


_IN_FRONT_M = (0.1, 0.3, 0.02)  # of a wall's face, where its room is looked for
_WALL_BEFORE_M = (0.02, 0.1, 0.2, 0.35, 0.5, 0.8)  # where another wall may stand in front
_BY_OPENING_M = 0.1  # of wall round an opening that stays free
_OPENING_WALL_M = 0.45  # from a wall's face to the middle plane of an opening in it
_UNDER_CEILING_M = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class WallAreas:
    """Where walls stand: plan areas and (I, 2, 3) bounds."""

    areas: tuple[BaseGeometry, ...]
    bounds: F64
    _joined: dict[bytes, BaseGeometry] = field(default_factory=dict, init=False)

    def at(self, y: float) -> BaseGeometry:
        """The plan area of all walls that cross the height y."""
        crosses = (self.bounds[:, 0, 1] < y) & (self.bounds[:, 1, 1] > y)
        key = crosses.tobytes()
        if key not in self._joined:
            parts = [self.areas[n] for n in np.flatnonzero(crosses)]
            self._joined[key] = areal(shapely.union_all(parts))
        return self._joined[key]


def room_faces(
    planes: Iterable[WallPlane], rooms: Sequence[Room], areas: Sequence[BaseGeometry]
) -> dict[int, list[WallFace]]:
    """The wall faces of each room (by its number), cut to the room, nothing in front considered."""
    order = sorted(range(len(areas)), key=lambda k: (areas[k].area, k))
    found: dict[int, list[WallFace]] = {}
    for plane in planes:
        s, y = plane.corners[:, :, 0], plane.corners[:, :, 1]
        s0, n = float(s.min()), max(int((s.max() - s.min()) / CELL_M), 1)
        columns = np.asarray(s0 + (np.arange(n) + 0.5) * CELL_M, np.float64)
        # Ask on each storey which room is in front of each column.
        tried = [k for k in order if rooms[k].floor_y < y.max() and rooms[k].ceiling_y > y.min()]
        for level in dict.fromkeys(rooms[k].level_id for k in tried):
            on_level = [k for k in tried if rooms[k].level_id == level]
            for k, start, end in runs(_rooms_before(plane, columns, on_level, areas)):
                room = rooms[k]
                low_y = max(room.floor_y, float(y.min()))
                n_rows = int((max(room.ceiling_y, float(y.max())) - low_y) / CELL_M)
                first = s0 + start * CELL_M
                covered = plane.covered(first, low_y, (n_rows, end - start))
                if not covered.any():
                    continue
                origin = plane.point + plane.along * first + [0.0, low_y, 0.0]
                clear = np.where(covered, np.float32(FAR_M), np.float32(0))
                face = WallFace(
                    plane.wall_id, room.id, room.level_id, origin, plane.along, plane.normal, clear,
                    plane.recess(first, end - start),
                )  # fmt: skip
                found.setdefault(k, []).append(face)
    return found


def _rooms_before(
    plane: WallPlane, columns: F64, rooms: Sequence[int], areas: Sequence[BaseGeometry]
) -> list[int]:
    found = np.full(len(columns), -1)
    for out_m in _IN_FRONT_M:
        places = plane.world(columns, out_m)
        for k in rooms:
            open_ = found < 0
            x0, z0, x1, z1 = areas[k].bounds if not areas[k].is_empty else (1.0, 1.0, 0.0, 0.0)
            open_ &= (places[:, 0] >= x0) & (places[:, 0] <= x1)
            open_ &= (places[:, 1] >= z0) & (places[:, 1] <= z1)
            if open_.any():
                inside = shapely.contains_xy(areas[k], places[open_, 0], places[open_, 1])
                found[np.flatnonzero(open_)[inside]] = k
    return found.tolist()


def with_structure(
    face: WallFace, walls: WallAreas, passages: Sequence[Passage], ceiling_y: Callable[[F64], F64]
) -> WallFace:
    """The face with its free space limited by walls, openings and ceilings."""
    clear = face.clear.copy()
    columns = np.asarray((np.arange(clear.shape[1]) + 0.5) * CELL_M, np.float64)
    ys = face.low_y + (np.arange(clear.shape[0]) + 0.5) * CELL_M
    # Other walls hide the face, or stand before it.
    for n in meeting(walls.bounds, reach_of(face)):
        rows = (ys > walls.bounds[n, 0, 1]) & (ys < walls.bounds[n, 1, 1])
        for out_m in _WALL_BEFORE_M:
            places = face.origin + columns[:, None] * face.along + out_m * face.normal
            within = shapely.contains_xy(walls.areas[n], places[:, 0], places[:, 2])
            if within.any():
                hidden = np.float32(0.0 if out_m <= _WALL_BEFORE_M[0] else out_m)
                block = np.ix_(rows, within)
                clear[block] = np.minimum(clear[block], hidden)
    # Openings take their hole and a margin.
    for passage in passages:
        _cut_passage(clear, face, passage)
    # What is over the room hides what is above it.
    top = np.minimum(*(_top(face, ceiling_y, columns, out_m) for out_m in (0.03, 0.2)))
    clear[ys[:, None] > (top - _UNDER_CEILING_M)[None, :]] = 0.0
    return replace(face, clear=clear)


def with_things(face: WallFace, hidden: Sequence[Hidden | None]) -> WallFace:
    """The face with its free space limited by things: what each of them hides, None = nothing."""
    if not hidden:
        return face
    clear = face.clear.copy()
    for thing in hidden:
        if thing is not None:
            thing.limit(clear)
    return replace(face, clear=clear)


def reach_of(face: WallFace) -> F64:
    """(2, 3) bounds of the space before the face in which things limit it."""
    ends = [face.point(s, y, out) for s in (0.0, face.length) for y in (face.low_y, face.high_y)
            for out in (-0.03, FAR_M)]  # fmt: skip
    return np.array([np.min(ends, 0), np.max(ends, 0)])


def meeting(bounds: F64, reach: F64) -> list[int]:
    """Numbers of the boxes (I, 2, 3) that meet the box reach (2, 3); NaN meets nothing."""
    meets = boxes_meeting(bounds[:, 0], bounds[:, 1], reach[0], reach[1])
    return [int(n) for n in np.flatnonzero(meets)]


def _cut_passage(clear: F32, face: WallFace, passage: Passage) -> None:
    # Only openings in this very wall count: parallel to the face, and within its depth.
    if abs(float(passage.normal @ face.normal)) < 0.9:
        return
    if not -_OPENING_WALL_M < float(face.out_of(passage.centre[None])[0]) < 0.1:
        return
    # Columns j run along the face (s), rows i up from low_y; both in cells of CELL_M.
    middle = float(face.s_of(passage.centre[None])[0])
    half = passage.width / 2 + _BY_OPENING_M
    j0, j1 = (int(np.clip((middle + s * half) / CELL_M, 0, clear.shape[1])) for s in (-1, 1))
    i0, i1 = (
        int(np.clip((y - face.low_y) / CELL_M, 0, clear.shape[0]))
        for y in (passage.bottom_y - _BY_OPENING_M, passage.top_y + _BY_OPENING_M)
    )
    clear[i0:i1, j0:j1] = 0.0


def _top(face: WallFace, ceiling_y: Callable[[F64], F64], columns: F64, out_m: float) -> F64:
    # The ceiling over every fourth column, carried to its neighbours.
    some = columns[::4]
    places = face.origin + some[:, None] * face.along + out_m * face.normal
    heights = ceiling_y(places[:, [0, 2]])
    return np.repeat(heights, 4)[: len(columns)]


# The space of a home being dressed.


_ABOVE_FLOOR_M = 0.5  # structure lower than this above a floor is no ceiling
_CHEST_M = 1.2  # above the floor, where walls are cut for their plan
_INSIDE_SHARE = 0.34  # of a thing's points, in its room
_STRUCTURE = (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND)


@dataclass(frozen=True, slots=True, eq=False)
class RoomSpace:
    """A room, what is in it and round it."""

    room: Room
    kind: RoomKind
    area: BaseGeometry  # its polygon, valid, plan (x, z)
    faces: tuple[WallFace, ...]
    doors: tuple[Passage, ...]  # and archways
    windows: tuple[Passage, ...]
    items: tuple[int, ...]  # numbers in Draft.items of what stands or hangs in it
    walls: BaseGeometry  # plan area of the walls at the height of a man's chest
    above: F64  # (F, 3, 3) triangles of ceilings and of what else is over it

    def ceiling_y(self, places: F64) -> F64:
        """(N,) y of the lowest structure above the floor at plan places (N, 2), else the nominal one."""
        return _ceiling(self.above, self.room)(places)


@dataclass(frozen=True, slots=True, eq=False)
class HouseSpace:
    """The home's rooms in its order, its doors and windows, and points on every item's surface."""

    rooms: tuple[RoomSpace, ...]
    passages: tuple[Passage, ...]
    points: tuple[F64, ...]  # (N, 3) by number of Draft.items; empty for structure
    bounds: F64  # (I, 2, 3) of those points; NaN where there are none

    def room(self, room_id: str) -> RoomSpace:
        """The room of that id; KeyError if there is none."""
        for room in self.rooms:
            if room.room.id == room_id:
                return room
        raise KeyError(room_id)

    def is_free(self, low: F64, high: F64, *, without: Collection[int] = ()) -> bool:
        """Whether no item but structure has a point in the box low..high (3,) of the world.

        without: numbers of items that do not count.
        """
        for n in meeting(self.bounds, np.array([low, high])):
            if (
                n not in without
                and ((self.points[n] >= low) & (self.points[n] <= high)).all(1).any()
            ):
                return False
        return True


@dataclass(frozen=True, slots=True, eq=False)
class _EmptyRoom:
    # What no dressing moves: the room, and its walls with nothing before them.
    room: Room
    area: BaseGeometry
    faces: tuple[WallFace, ...]
    walls: BaseGeometry
    above: F64


@dataclass(slots=True)
class _KeptSpaces:
    # What stays as long as the items it came from stay the same objects. Items are held with
    # their points, so ids stay theirs.
    rooms: tuple[_EmptyRoom, ...]
    passages: tuple[Passage, ...]
    items: dict[int, tuple[Item, F64, F64]]  # with points on it and their bounds
    faces: dict[int, tuple[tuple[int, ...], WallFace]]  # by the empty face, with the things near it
    space: tuple[tuple[int, ...], HouseSpace] | None = None
    reach: dict[int, F64] = field(default_factory=dict)  # by the empty face: see reach_of
    hidden: dict[tuple[int, int], Hidden | None] = field(default_factory=dict)  # by face and item
    inside: dict[tuple[str, int], bool] = field(default_factory=dict)  # by room and item


def house_space(draft: Draft) -> HouseSpace:
    """The space of the draft as it is now; what did not change since the last call is kept."""
    kept = draft.kept.get("space")
    if not isinstance(kept, _KeptSpaces):
        kept = draft.kept["space"] = _empty_house(draft)
    key = tuple(id(item) for item in draft.items)
    if kept.space is None or kept.space[0] != key:
        # Spread points over new items; keep those of the others.
        for item in draft.items:
            if id(item) not in kept.items:
                kept.items[id(item)] = _with_points(item)
        kept.space = key, _house_space(draft.items, kept)
    return kept.space[1]


def floor_space(draft: Draft) -> HouseSpace:
    """As house_space, without the faces of walls: doors, windows, floors and points cost less."""
    kept = draft.kept.get("space")
    if not isinstance(kept, _KeptSpaces):
        kept = draft.kept["space"] = _empty_house(draft)
    kept.items |= {id(i): _with_points(i) for i in draft.items if id(i) not in kept.items}
    bare = replace(kept, rooms=tuple(replace(room, faces=()) for room in kept.rooms))
    return _house_space(draft.items, bare)


def _with_points(item: Item) -> tuple[Item, F64, F64]:
    if item.kind in _STRUCTURE:
        return item, np.zeros((0, 3)), np.full((2, 3), np.nan)
    points = surface_points(item_triangles(item))
    bounds = np.array(points_bounds(points)) if len(points) else np.full((2, 3), np.nan)
    return item, points, bounds


def _empty_house(draft: Draft) -> _KeptSpaces:
    house = draft.source
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
        above = _near(overhead, areas[k])
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


def _near(triangles: F64, area: BaseGeometry) -> F64:
    if area.is_empty or not len(triangles):
        return triangles[:0]
    x0, z0, x1, z1 = area.bounds
    low, high = triangle_bounds(triangles)
    meets = (high[:, 0] > x0) & (low[:, 0] < x1) & (high[:, 2] > z0) & (low[:, 2] < z1)
    return np.asarray(triangles[meets])


def _ceiling(above: F64, room: Room) -> Callable[[F64], F64]:
    def ceiling_y(places: F64) -> F64:
        found = lowest_above(places, above, room.floor_y + _ABOVE_FLOOR_M)
        return np.where(np.isfinite(found), found, room.ceiling_y)

    return ceiling_y


def _house_space(items: Sequence[Item], kept: _KeptSpaces) -> HouseSpace:
    points = tuple(kept.items[id(i)][1] for i in items)
    bounds = np.array([kept.items[id(i)][2] for i in items]).reshape(-1, 2, 3)
    rooms = []
    for empty in kept.rooms:
        inside = _items_in(items, points, bounds, empty, kept)
        own = [p for p in kept.passages if empty.room.id in p.room_ids]
        faces = [_filled(face, items, points, bounds, kept) for face in empty.faces]
        rooms.append(
            RoomSpace(
                empty.room,
                room_kind(empty.room, [items[n] for n in inside], float(empty.area.area)),
                empty.area,
                tuple(face for face in faces if face.clear.any()),
                tuple(p for p in own if not p.is_window),
                tuple(p for p in own if p.is_window),
                inside,
                empty.walls,
                empty.above,
            )
        )
    return HouseSpace(tuple(rooms), kept.passages, points, bounds)


def _filled(
    face: WallFace, items: Sequence[Item], points: Sequence[F64], bounds: F64, kept: _KeptSpaces
) -> WallFace:
    """The empty face with what stands or hangs before it now; rugs do not count."""
    if id(face) not in kept.reach:
        kept.reach[id(face)] = reach_of(face)
    found = meeting(bounds, kept.reach[id(face)])
    near = [n for n in found if items[n].nyu40 != FLOOR_MAT]
    key = tuple(id(items[n]) for n in near)
    known = kept.faces.get(id(face))
    if known is None or known[0] != key:
        hidden = [_hidden_by(face, items[n], points[n], kept) for n in near]
        known = kept.faces[id(face)] = key, with_things(face, hidden)
    return known[1]


def _hidden_by(face: WallFace, item: Item, points: F64, kept: _KeptSpaces) -> Hidden | None:
    key = id(face), id(item)
    if key not in kept.hidden:
        kept.hidden[key] = hidden_cells(face, points)
    return kept.hidden[key]


def _items_in(
    items: Sequence[Item], points: Sequence[F64], bounds: F64, empty: _EmptyRoom, kept: _KeptSpaces
) -> tuple[int, ...]:
    """Numbers of the items of which a good part is in the room; neighbours' poke through outlines."""
    room, area = empty.room, empty.area
    if area.is_empty:
        return ()
    x0, z0, x1, z1 = area.bounds
    shapely.prepare(area)
    found = []
    reach = np.array([[x0, room.floor_y - 0.05, z0], [x1, room.ceiling_y, z1]])
    for number in meeting(bounds, reach):
        if items[number].kind in (ItemKind.DOOR, ItemKind.WINDOW):
            continue
        key = room.id, id(items[number])
        if key not in kept.inside:
            some = points[number][:: max(1, len(points[number]) // 200)]
            share = shapely.contains_xy(area, some[:, 0], some[:, 2]).mean()
            kept.inside[key] = bool(share > _INSIDE_SHARE)
        if kept.inside[key]:
            found.append(number)
    return tuple(found)
