"""Rooms and levels of a scene: from given polygons, else from its floors; limits of rooms. No effects.

Polygons are JSON, metres, in the plan (x, z) of the world:

    {"rooms": [{"polygon": [[x, z], ...], "floor_y": 0.0, "ceiling_y": 2.5, "name": "Kitchen"}]}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Final

import numpy as np
import shapely
from pydantic import BaseModel, Field

from pbrs_farm.core.arrays import F64, Points2
from pbrs_farm.core.checked_json import Finite, checked, exactly, json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Item, ItemKind, Level, Room, Surface
from pbrs_farm.geometry.doorways import door_line, ground_between
from pbrs_farm.read.common.room_floors import (
    ceiling_height,
    covered_share,
    floor_height,
    floor_polygons,
    foot_of_wall,
    polygon_of,
)

MAX_ROOMS: Final = 500
MAX_OVERLAPS: Final = 500
"""Pairs of rooms of a level that share some floor; a home has a few."""

HINT: Final = "remove duplicate rooms, hide levels, or split the home"
_MIN_SHARED_M2: Final = 0.05


def check_rooms(rooms: Sequence[Room], file: str) -> None:
    """Raise BadHouse for too many rooms, or too many overlapping ones, which take long to take apart."""
    by_level: dict[str, list[Points2]] = {}
    for room in rooms:
        by_level.setdefault(room.level_id, []).append(room.polygon)
    check_outlines(by_level, file)


def check_outlines(by_level: Mapping[str, Sequence[Points2]], file: str) -> None:
    """The same for outlines (N, 2) in plan, a list for each level."""
    check_number(sum(map(len, by_level.values())), file)
    n_overlaps = sum(map(_count_overlaps, by_level.values()))
    if n_overlaps > MAX_OVERLAPS:
        text = f"{n_overlaps} pairs of rooms overlap; the maximum is {MAX_OVERLAPS}"
        raise BadHouse(file, "rooms", text, hint=HINT)


_SMALL_M, _LARGE_M = 0.6, 500.0  # the rooms of a home together are wider, and less wide
_LOW_M, _HIGH_M = 1.0, 40.0  # a room's height


def check_unit(rooms: Sequence[Room], file: str, place: str, hint: str) -> None:
    """Raise BadHouse unless the rooms together are 0.6 to 500 m wide and in the middle 1 to 40 m high."""
    plan = np.concatenate([room.polygon for room in rooms])
    wide = float(np.ptp(plan, axis=0).max())
    high = float(np.median([room.ceiling_y - room.floor_y for room in rooms]))
    looks = ""
    if wide > _LARGE_M or high > _HIGH_M:
        looks = "millimetres" if max(wide / 8_000, high / 1_000) > 1 else "centimetres"
    elif wide < _SMALL_M or high < _LOW_M:
        looks = "another unit than metres"
    if looks:
        text = f"the rooms are {wide:.3g} m wide and {high:.3g} m high: looks like {looks}"
        raise BadHouse(file, place, text, hint=hint)


def check_number(n_rooms: int, file: str) -> None:
    """Raise BadHouse for more than MAX_ROOMS."""
    if n_rooms > MAX_ROOMS:
        raise BadHouse(file, "", f"{n_rooms} rooms, at most {MAX_ROOMS} are read", hint=HINT)


def _count_overlaps(outlines: Sequence[Points2]) -> int:
    polygons = [shapely.make_valid(shapely.Polygon(p)) for p in outlines if len(p) > 2]
    areas = np.array(polygons, object)
    first, second = shapely.STRtree(polygons).query(areas, predicate="intersects")
    is_pair = first < second
    shared = shapely.area(shapely.intersection(areas[first[is_pair]], areas[second[is_pair]]))
    return int((shared > _MIN_SHARED_M2).sum())


MIN_ROOM_M2: Final = 1.0  # smaller pieces of floor are gaps under doors and walls
LEAST_WALL_M: Final = 1.8  # lower walls enclose no room
MIN_ROOM_WIDTH_M: Final = 0.5
_STOREY_M: Final = 2.5  # default height of a room, metres
_SAME_LEVEL_M: Final = 0.5  # floors nearer in height than this are one level
_SLACK_M: Final = 0.3  # maximum distance of an item outside its room's polygon or height, metres
_EDGE_M: Final = 0.1  # maximum distance of a wall beside the floor, metres
# A ceiling that covers less of a room than this share is the next room's.
_NEXT_ROOM: Final = 0.05


def rooms_from_json(data: bytes, file: str, items: Sequence[Item]) -> list[Room]:
    """The rooms of a polygon file, as rooms_from_value; BadHouse, naming the invalid room."""
    return rooms_from_value(json_from_bytes(data, file), file, items)


def rooms_from_value(value: Any, file: str, items: Sequence[Item]) -> list[Room]:
    """The rooms of the JSON value of a polygon file, or of a scene's extras.

    items: of the scene; missing heights are those of the floors and ceilings over the polygon. Raises
    BadHouse, naming the invalid room, as rooms_from_json.
    """
    hint = '{"rooms": [{"polygon": [[x, z], ...]}, ...]}'
    rows = checked(_RoomFile, value, file, error=BadHouse, hint=hint).rooms
    check_number(len(rows), file)
    return [_room_of_row(row, file, f"rooms[{i}]", items) for i, row in enumerate(rows)]


_Metres = Annotated[Finite, Field(gt=-1e6, lt=1e6)]


class _GivenRoom(BaseModel):
    polygon: list[Annotated[tuple[_Metres, _Metres], exactly(2)]] = Field(
        min_length=3, max_length=10_000, fail_fast=True
    )
    floor_y: _Metres | None = None
    ceiling_y: _Metres | None = None
    name: Any = ""
    types: Any = None


class _RoomFile(BaseModel):
    rooms: list[_GivenRoom] = Field(min_length=1, fail_fast=True)


def _room_of_row(row: _GivenRoom, file: str, place: str, items: Sequence[Item]) -> Room:
    area = shapely.Polygon(row.polygon)
    polygon = polygon_of(area) if area.is_valid else None
    if polygon is None:
        raise BadHouse(file, f"{place}.polygon", "crosses itself or has no area")
    heights = {"floor_y": row.floor_y, "ceiling_y": row.ceiling_y}
    words = tuple(str(t)[:60] for t in row.types) if isinstance(row.types, list) else ()
    return _with_heights(polygon, str(row.name)[:60], words, heights, items)


def rooms_from_floors(items: Sequence[Item]) -> list[Room]:
    """A room for every piece of floor separated by walls.

    items: of the whole scene. Walls count if they reach 1 m above the floor; pieces below 1 m2 or
    0.5 m wide are gaps under doors and walls. The rooms have no id, name or level yet: levels_of adds
    them.
    """
    walls = _surfaces_of_kind(items, ItemKind.WALL)
    doors = [i for i in items if i.kind is ItemKind.DOOR and i.n_faces]
    rooms: list[Room] = []
    for item in items:
        height = floor_height(item.surfaces) if item.kind is ItemKind.FLOOR else None
        if height is None or len(rooms) > MAX_ROOMS:  # check_rooms refuses them
            continue
        # Divide the floor by walls that reach 1 m above it.
        standing = [w for w in walls if w.positions[:, 1].max() > height + 1.0]
        standing = [w for w in standing if w.positions[:, 1].min() < height + 1.0]
        low, high = item.bounds[:, [0, 2]]
        standing = _surfaces_within(standing, low - _EDGE_M, high + _EDGE_M)
        pieces = floor_polygons(
            item.surfaces,
            standing,
            min_area_m2=MIN_ROOM_M2,
            min_width_m=MIN_ROOM_WIDTH_M,
            doors=[d.bounds for d in doors if abs(d.bounds[0, 1] - height) < _SLACK_M],
        )
        heights = {"floor_y": height, "ceiling_y": None}
        rooms += [_with_heights(p, "", (), heights, items) for p in pieces]
    return rooms


def rooms_from_walls(items: Sequence[Item]) -> list[Room]:
    """Rooms enclosed by walls above parapet height where no floor is drawn, as those of rooms_from_floors."""
    walls = [i for i in items if i.kind is ItemKind.WALL and np.ptp(i.bounds[:, 1]) >= LEAST_WALL_M]
    doors = [i.box for i in items if i.kind is ItemKind.DOOR and i.box is not None]
    rooms: list[Room] = []
    storeys: list[list[Item]] = []
    for wall in sorted(walls, key=lambda w: float(w.bounds[0, 1])):
        if not storeys or wall.bounds[0, 1] > storeys[-1][0].bounds[0, 1] + _SAME_LEVEL_M:
            storeys.append([])
        storeys[-1].append(wall)
    for storey in storeys:
        foot = float(np.median([w.bounds[0, 1] for w in storey]))
        lines = [
            door_line(box.centre[[0, 2]], box.axes[[0, 2], 0], 2 * float(box.half[0]))
            for box in doors
            if abs(box.corners[:, 1].min() - foot) < _SAME_LEVEL_M
        ]
        heights = {"floor_y": foot, "ceiling_y": None}
        pieces = ground_between([foot_of_wall(w.surfaces) for w in storey], lines)
        polygons = [polygon_of(p) for p in pieces if p.area >= MIN_ROOM_M2]
        rooms += [_with_heights(p, "", (), heights, items) for p in polygons if p is not None]
    return rooms


def _with_heights(
    polygon: F64,
    name: str,
    types: tuple[str, ...],
    heights: dict[str, float | None],
    items: Sequence[Item],
) -> Room:
    """The room with heights of the floor and ceiling that lie over its polygon."""
    # Take the floor's height as given, as the floor below has it, or 0.
    floors = _over(items, ItemKind.FLOOR, polygon)
    floor_y = heights["floor_y"]
    low = floor_height(floors) if floor_y is None else floor_y
    low = 0.0 if low is None else low
    # Leave out ceilings that belong to the next room.
    above = [s for s in _over(items, ItemKind.CEILING, polygon) if s.positions[:, 1].min() > low]
    shares = [covered_share(s, polygon) for s in above]
    above = [s for s, share in zip(above, shares, strict=True) if share > _NEXT_ROOM]
    ceiling = ceiling_height(above)
    if ceiling is None and above:
        ceiling = min(float(s.positions[:, 1].min()) for s in above)  # planar, looking up
    # Without a ceiling the room is as high as its walls, or a storey.
    walls = [float(s.positions[:, 1].max()) for s in _over(items, ItemKind.WALL, polygon, _EDGE_M)]
    nominal = max((y for y in walls if low + 1.0 < y < low + 10.0), default=low + _STOREY_M)
    high = heights["ceiling_y"] or ceiling or nominal
    return Room(
        id="",
        name=name,
        level_id="",
        polygon=polygon,
        floor_y=low,
        ceiling_y=high if high > low + 0.5 else low + _STOREY_M,
        types=types,
        has_floor=bool(floors),
        has_ceiling=sum(shares) > 0.5,
    )


def _surfaces_of_kind(items: Sequence[Item], kind: ItemKind) -> list[Surface]:
    return [s for item in items if item.kind is kind for s in item.surfaces]


def _over(
    items: Sequence[Item], kind: ItemKind, polygon: F64, slack_m: float = 0.0
) -> list[Surface]:
    """The surfaces of a kind whose bounds meet the polygon's in plan."""
    low, high = polygon.min(0) - slack_m, polygon.max(0) + slack_m
    return _surfaces_within(_surfaces_of_kind(items, kind), low, high)


def _surfaces_within(surfaces: Sequence[Surface], low: F64, high: F64) -> list[Surface]:
    """The surfaces whose plan bounds meet low..high."""
    plans = [(s, s.positions[:, [0, 2]]) for s in surfaces]
    return [s for s, p in plans if (p.max(0) > low).all() and (p.min(0) < high).all()]


def levels_of(rooms: Sequence[Room]) -> tuple[tuple[Level, ...], tuple[Room, ...]]:
    """(levels by floor height, from below; the rooms with their ids `<level>_<room>`).

    rooms: with floor_y and ceiling_y; ids, levels and empty names are replaced. Rooms keep their
    order. Split levels within half a metre are one.
    """
    # Floors within half a metre are one level.
    heights: list[float] = []
    for y in sorted(r.floor_y for r in rooms):
        if not heights or y > heights[-1] + _SAME_LEVEL_M:
            heights.append(y)
    # Number the rooms of each level from 0.
    numbered: list[Room] = []
    count = [0] * len(heights)
    for room in rooms:
        level = int(np.searchsorted(heights, room.floor_y, "right")) - 1
        room_id = f"{level}_{count[level]}"
        count[level] += 1
        name = room.name or f"Room {room_id}"
        numbered.append(replace(room, id=room_id, name=name, level_id=str(level)))
    # A level is as high as its rooms are in the middle.
    levels = []
    for k, height in enumerate(heights):
        ceiling_heights = [r.ceiling_y - r.floor_y for r in numbered if r.level_id == str(k)]
        levels.append(Level(str(k), f"Level {k}", height, float(np.median(ceiling_heights))))
    return tuple(levels), tuple(numbered)


def level_of(levels: Sequence[Level], y: float) -> str:
    """The id of the highest level at or below y (world, metres; half a metre of slack), else of the lowest."""
    below = [x.id for x in levels if x.elevation <= y + _SAME_LEVEL_M]
    return below[-1] if below else levels[0].id


def room_at(rooms: Sequence[Room], point: F64) -> str | None:
    """The room that holds a point (3,) of the world; of a point in a wall, that on its other side; or None."""
    x, y, z = point
    rooms_at_height = [r for r in rooms if r.floor_y - _SLACK_M <= y <= r.ceiling_y + _SLACK_M]
    if not rooms_at_height:
        return None
    place: Any = shapely.Point(x, z)
    # Measure to each room's polygon: 0 inside it.
    distance = [float(shapely.Polygon(r.polygon).distance(place)) for r in rooms_at_height]
    nearest = int(np.argmin(distance))
    return rooms_at_height[nearest].id if distance[nearest] <= _SLACK_M else None
