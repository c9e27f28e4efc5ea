"""What a plan may hold, so that its repair ends within seconds; no effects.

A home has some dozen rooms and walls; what is far beyond it, or drawn over itself a hundred times,
is refused by a line before any of it is built.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeVar

import numpy as np
import shapely

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.sweethome3d.home_file.home_xml import Plan, PlanRoom, PlanWall

MAX_ROOMS: Final = 500
MAX_WALLS: Final = 3_000
MAX_PIECES: Final = 10_000
MAX_CROSSINGS: Final = 500
"""Pairs of walls of a level whose centre lines cross; a home has a dozen."""

MAX_OVERLAPS: Final = 500
"""Pairs of rooms of a level that share some floor; a home has a few."""

_MIN_SHARED_M2: Final = 0.05
_Drawn = TypeVar("_Drawn", PlanRoom, PlanWall)
_HINT: Final = "remove what is drawn over itself, or split the home into several"


def check_plan_bounds(plan: Plan, file: str) -> None:
    """Raise BadHouse, naming the file, for a plan of too many parts, or drawn over itself."""
    for name, n, most in (
        ("rooms", len(plan.rooms), MAX_ROOMS),
        ("walls", len(plan.walls), MAX_WALLS),
        ("pieces", len(plan.pieces), MAX_PIECES),
    ):
        if n > most:
            raise BadHouse(file, "", f"{n} {name}, at most {most} are read", hint=_HINT)
    n_crossings = sum(_crossings(walls) for walls in _by_level(plan.walls).values())
    if n_crossings > MAX_CROSSINGS:
        text = f"walls cross {n_crossings} times, at most {MAX_CROSSINGS} crossings are built"
        raise BadHouse(file, "walls", text, hint=_HINT)
    n_overlaps = sum(_overlaps(rooms) for rooms in _by_level(plan.rooms).values())
    if n_overlaps > MAX_OVERLAPS:
        text = f"{n_overlaps} pairs of rooms overlap, at most {MAX_OVERLAPS} are taken apart"
        raise BadHouse(file, "rooms", text, hint=_HINT)


def _by_level(drawn: Sequence[_Drawn]) -> dict[str, list[_Drawn]]:
    found: dict[str, list[_Drawn]] = {}
    for one in drawn:
        found.setdefault(one.level, []).append(one)
    return found


def _crossings(walls: Sequence[PlanWall]) -> int:
    lines = [shapely.LineString([w.start, w.end]) for w in walls]
    pairs = shapely.STRtree(lines).query(lines, predicate="crosses")
    return int((pairs[0] < pairs[1]).sum())


def _overlaps(rooms: Sequence[PlanRoom]) -> int:
    outlines = [shapely.make_valid(shapely.Polygon(r.points)) for r in rooms if len(r.points) > 2]
    areas = np.array(outlines, object)
    first, second = shapely.STRtree(outlines).query(areas, predicate="intersects")
    is_pair = first < second
    shared = shapely.area(shapely.intersection(areas[first[is_pair]], areas[second[is_pair]]))
    return int((shared > _MIN_SHARED_M2).sum())
