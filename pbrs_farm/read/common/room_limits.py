"""Limits on the number of rooms of a house and on their overlaps. No effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import Points2
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Room

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
