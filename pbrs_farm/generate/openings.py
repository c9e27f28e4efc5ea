"""Doors, windows and the balcony of a plan; no effects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening, PlanRoom, PlanWall, RoomType
from pbrs_farm.generate.layout import Layout
from pbrs_farm.generate.plan_walls import OUTSIDE, Run, open_pairs
from pbrs_farm.generate.wall_drawing import Drawing, numbers
from pbrs_farm.generate.windows import add_balcony, add_windows, is_lit

DOOR_HEIGHT_M: Final = 2.1
_DOOR_M, _WET_DOOR_M, _ENTRANCE_M = 0.9, 0.8, 0.95
_FROM_CORNER_M: Final = 0.10  # of a door's frame
_LEAST_CORNER_M: Final = 0.03
_OPENS_OUT: Final = (RoomType.WC, RoomType.STORE)


def openings_of(
    layout: Layout,
    runs: list[Run],
    walls: tuple[PlanWall, ...],
    rooms: tuple[PlanRoom, ...],
    rng: np.random.Generator,
) -> tuple[tuple[PlanRoom, ...], tuple[PlanWall, ...], tuple[PlanOpening, ...]]:
    """Rooms and walls with the balcony's added, and every door and window."""
    drawing = Drawing(layout, runs, list(walls), list(rooms), rng)
    if not layout.programme.is_upper:
        _add_entrance(drawing)
    for room in range(len(rooms)):
        _add_doors(drawing, room)
    if layout.programme.balcony:
        add_balcony(drawing)
    for room in range(len(rooms)):
        add_windows(drawing, room)
    return tuple(drawing.rooms), tuple(drawing.walls), tuple(drawing.openings)


def _add_entrance(drawing: Drawing) -> None:
    """The door of the home, in an outer wall of the hall; on a side without daylight first."""
    hall = drawing.types.index(RoomType.HALL)
    outer = [r for r in drawing.runs if r.rooms == {hall, OUTSIDE}]
    outer.sort(key=lambda r: (is_lit(r, drawing.layout), -r.length, r.line, r.low))
    for run in outer:
        if _add_door(drawing, run, hall, OpeningKind.ENTRANCE, _ENTRANCE_M):
            return


def _add_doors(drawing: Drawing, room: int) -> None:
    """The door of a room: to the hall, or to the room it belongs to."""
    type_ = drawing.types[room]
    if type_ in (RoomType.HALL, RoomType.STAIRS):
        return
    width = _DOOR_M if type_.is_habitable else _WET_DOOR_M
    bedrooms = drawing.layout.programme.en_suites.get(room)
    if bedrooms is not None:
        _add_doors_of_en_suite(drawing, room, bedrooms)
        return
    for others in _doors_to(drawing.types, type_):
        # Two leaves that hit each other are the last choice.
        if any(
            _add_door(drawing, run, room, OpeningKind.DOOR, width, may_meet=may_meet)
            for may_meet in (False, True)
            for run in _runs_between(drawing, room, others)
        ):
            break
    # A closed kitchen often has a second door, to the living room.
    if type_ is RoomType.KITCHEN and not drawing.layout.programme.open_kitchen:
        living = numbers(drawing.types, RoomType.LIVING, RoomType.STUDIO)
        between = [r for r in drawing.runs if room in r.rooms and r.rooms & set(living)]
        joined = any({o.room, o.other} == {room, *living} for o in drawing.openings)
        if between and not joined and drawing.rng.random() < 0.6:
            longest = max(between, key=lambda r: (r.length, r.line, r.low))
            _add_door(drawing, longest, room, OpeningKind.DOOR, width, may_meet=False)


def _runs_between(drawing: Drawing, room: int, others: Iterable[int]) -> list[Run]:
    """The walls between a room and others, the longest first."""
    runs = [r for r in drawing.runs if room in r.rooms and r.rooms & set(others)]
    runs = [r for r in runs if r.rooms not in open_pairs(drawing.layout)]
    return sorted(runs, key=lambda r: (-r.length, r.line, r.low))


def _add_doors_of_en_suite(drawing: Drawing, room: int, bedrooms: tuple[int, ...]) -> None:
    """A bathroom's door to its bedroom; the home's only one has another to the hall if it fits."""
    wanted: list[tuple[Iterable[int], bool]] = [(bedrooms, True)]
    if drawing.types.count(RoomType.BATHROOM) == 1:
        wanted.append((numbers(drawing.types, RoomType.HALL), False))
    for others, may_meet in wanted:
        for run in _runs_between(drawing, room, others):
            if _add_door(drawing, run, room, OpeningKind.DOOR, _WET_DOOR_M, may_meet=may_meet):
                break


def _doors_to(types: list[RoomType], type_: RoomType) -> Iterable[list[int]]:
    halls = numbers(types, RoomType.HALL)
    if type_ is RoomType.KITCHEN:
        return halls, numbers(types, RoomType.LIVING, RoomType.STUDIO)
    if type_ is RoomType.WARDROBE:
        return numbers(types, RoomType.BEDROOM), halls
    if type_ is RoomType.STORE:
        return halls, numbers(types, RoomType.KITCHEN)
    if type_ is RoomType.BATHROOM:
        return halls, numbers(types, RoomType.BEDROOM)
    return (halls,)


def _add_door(
    drawing: Drawing, run: Run, room: int, kind: OpeningKind, width: float, *, may_meet: bool = True
) -> bool:
    """A door at one end of a run, hinged towards the corner; False where there is no room.

    may_meet: its leaf may swing where another one does.
    """
    low, high = drawing.free(run)
    # Stand nearer to the corner where the wall is short.
    corner = min(_FROM_CORNER_M, (high - low - width) / 2)
    if corner < _LEAST_CORNER_M:
        return False
    at_low, at_high = low + corner + width / 2, high - corner - width / 2
    places = [(at_low, True), (at_high, False)]
    if drawing.rng.random() < 0.5:
        places.reverse()
    other = next((r for r in run.rooms if r != room), OUTSIDE)
    # The leaf of a small room's door would stand in all of it: it opens outwards.
    opens_out = other != OUTSIDE and drawing.types[room] in _OPENS_OUT
    into, behind = (other, room) if opens_out else (room, other)
    for at, hinge_at_start in places:
        span = (at - width / 2 - 0.02, at + width / 2 + 0.02)
        if any(a < span[1] and b > span[0] for a, b in drawing.taken(run)):
            continue
        swing = drawing.swing(run, at, width, into)
        if not may_meet and drawing.meets_swing(into, swing):
            continue
        drawing.swings.append((into, swing))
        wall, along = drawing.wall_of(run, at)
        drawing.openings.append(
            PlanOpening(
                kind,
                wall,
                round(along, 4),
                width,
                DOOR_HEIGHT_M,
                0.0,
                into,
                None if behind == OUTSIDE else behind,
                hinge_at_start,
            )
        )
        return True
    return False
