"""What an unfurnished plan must have: daylight where people live, a way to every room; no effects."""

from __future__ import annotations

from itertools import combinations
from typing import Final

from shapely.geometry import Polygon

from pbrs_farm.generate.floor_plan import OpeningKind, Plan, PlanOpening, RoomType

GLASS_SHARE: Final = 1 / 8  # of the floor of a room to live in
_TOLERANCE: Final = 0.97  # sizes of windows are whole centimetres
_OPEN_M: Final = 0.7  # the least width of an open side that one walks through


def plan_faults(plan: Plan) -> list[str]:
    """What is wrong with a plan, a line each."""
    return [*_dark_rooms(plan), *_unreached_rooms(plan)]


def _dark_rooms(plan: Plan) -> list[str]:
    found = []
    for number, room in enumerate(plan.rooms):
        glass = sum(o.width * o.height for o in plan.openings_of(number) if _is_window(o))
        wanted = room.area * GLASS_SHARE
        if room.type.is_habitable and glass < _TOLERANCE * wanted:
            found.append(f"{room.name}: {glass:.2f} m2 of glass, {wanted:.2f} wanted")
    return found


def _unreached_rooms(plan: Plan) -> list[str]:
    """Rooms that no row of doors and open sides joins with the hall."""
    joined = [
        {o.room, o.other}
        for o in plan.openings
        if o.other is not None and (not _is_window(o) or _leads_out(plan, o))
    ]
    shapes = [Polygon(room.polygon) for room in plan.rooms]
    for a, b in combinations(range(len(shapes)), 2):
        if shapes[a].distance(shapes[b]) < 1e-3:
            shared = shapes[a].buffer(2e-3).intersection(shapes[b]).area
            joined += [{a, b}] * (shared > _OPEN_M * 2e-3)
    # Go on from the hall until nothing is added.
    reached = {i for i, room in enumerate(plan.rooms) if room.type is RoomType.HALL}
    for _ in plan.rooms:
        reached |= {i for pair in joined if pair & reached for i in pair if i is not None}
    return [f"{r.name}: not reached" for i, r in enumerate(plan.rooms) if i not in reached]


def _is_window(opening: PlanOpening) -> bool:
    return opening.kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)


def _leads_out(plan: Plan, opening: PlanOpening) -> bool:
    return opening.other is not None and plan.rooms[opening.other].type is RoomType.BALCONY
