"""Doors of a plan, then its windows and its balcony; daylight where people live, a way to every room. No effects."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import combinations
from typing import Final

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    RoomType,
)
from pbrs_farm.generate.layout import Layout
from pbrs_farm.generate.open_walls import WallDrawing, rooms_of_types
from pbrs_farm.generate.plan_walls import OUTSIDE, WallRun, balcony, open_pairs

_TOLERANCE: Final = 0.97  # sizes of windows are whole centimetres
_OPEN_M: Final = 0.7  # minimum width of an open side to walk through
_PASSAGES_M: Final = (1.5, 1.2)  # the wider one where it fits
_DOOR_M, _WET_DOOR_M, _ENTRANCE_M = 0.9, 0.8, 0.95
_FROM_CORNER_M: Final = 0.10  # least distance from a door's frame to the corner of the room
_LEAST_CORNER_M: Final = 0.03
_OPENS_OUT: Final = (RoomType.WC, RoomType.STORE)


def plan_faults(plan: Plan) -> list[str]:
    """Rooms without the daylight they need, and unreachable rooms, one line each."""
    return [*_dark_rooms(plan), *_unreached_rooms(plan)]


def _dark_rooms(plan: Plan) -> list[str]:
    faults = []
    for number, room in enumerate(plan.rooms):
        glass = sum(o.width * o.height for o in plan.openings_of(number) if _is_window(o))
        glass_wanted = room.area * GLASS_SHARE
        if room.type.is_habitable and glass < _TOLERANCE * glass_wanted:
            faults.append(f"{room.name}: {glass:.2f} m2 of glass, {glass_wanted:.2f} wanted")
    return faults


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


def openings_of(
    layout: Layout,
    runs: list[WallRun],
    walls: tuple[PlanWall, ...],
    rooms: tuple[PlanRoom, ...],
    rng: np.random.Generator,
) -> tuple[tuple[PlanRoom, ...], tuple[PlanWall, ...], tuple[PlanOpening, ...]]:
    """Rooms and walls with the balcony's added, and every door and window of a plan.

    runs: stretches of wall between two rooms, or a room and outdoors, of which openings are drawn. Every
    room gets a way to the entrance, and those that people live in daylight; raises BadInput where one
    cannot.
    """
    drawing = WallDrawing(layout, runs, list(walls), list(rooms), rng)
    if not layout.programme.is_upper:
        _add_entrance(drawing)
    for room in range(len(rooms)):
        _add_doors(drawing, room)
    if layout.programme.balcony:
        add_balcony(drawing)
    for room in range(len(rooms)):
        add_windows(drawing, room)
    return tuple(drawing.rooms), tuple(drawing.walls), tuple(drawing.openings)


def _add_entrance(drawing: WallDrawing) -> None:
    """The door of the home, in an outer wall of the hall; on a side without daylight first."""
    hall = drawing.types.index(RoomType.HALL)
    outer = [r for r in drawing.runs if r.rooms == {hall, OUTSIDE}]
    outer.sort(key=lambda r: (is_lit(r, drawing.layout), -r.length, r.line, r.low))
    for run in outer:
        if _add_door(drawing, run, hall, OpeningKind.ENTRANCE, _ENTRANCE_M):
            return


def _add_doors(drawing: WallDrawing, room: int) -> None:
    """The door of a room: to the hall, or to the room it belongs to."""
    type_ = drawing.types[room]
    if type_ in (RoomType.HALL, RoomType.STAIRS):
        return
    width = _DOOR_M if type_.is_habitable else _WET_DOOR_M
    bedrooms = drawing.layout.programme.en_suites.get(room)
    if bedrooms is not None:
        _add_doors_of_en_suite(drawing, room, bedrooms)
        return
    is_living = type_ in (RoomType.LIVING, RoomType.STUDIO)
    if is_living and drawing.rng.random() < drawing.family.passage and _add_passage(drawing, room):
        return
    for entries in _doors_to(drawing, type_):
        # Two leaves that hit each other are the last choice.
        if any(
            _add_door(drawing, run, room, OpeningKind.DOOR, width, may_meet=may_meet)
            for may_meet in (False, True)
            for run in _runs_between(drawing, room, entries)
        ):
            break
    # A closed kitchen often has a second door, to the living room; a bedroom of some families.
    if type_ is RoomType.KITCHEN and not drawing.layout.programme.open_kitchen:
        _add_second_door(drawing, room, 0.6)
    elif type_ is RoomType.BEDROOM and drawing.family.enfilade:
        _add_second_door(drawing, room, drawing.family.enfilade)


def _add_second_door(drawing: WallDrawing, room: int, chance: float) -> None:
    """A door to the living room beside, where none is; chance: how often."""
    living = rooms_of_types(drawing.types, RoomType.LIVING, RoomType.STUDIO)
    between = [r for r in drawing.runs if room in r.rooms and r.rooms & set(living)]
    joined = any({o.room, o.other} == {room, *living} for o in drawing.openings)
    if between and not joined and drawing.rng.random() < chance:
        longest = max(between, key=lambda r: (r.length, r.line, r.low))
        _add_door(drawing, longest, room, OpeningKind.DOOR, _DOOR_M, may_meet=False)


def _add_passage(drawing: WallDrawing, room: int) -> bool:
    """A wide hole to the hall without a leaf; False where there is no room."""
    halls = rooms_of_types(drawing.types, RoomType.HALL)
    return any(
        _add_door(drawing, run, room, OpeningKind.PASSAGE, width)
        for width in _PASSAGES_M
        for run in _runs_between(drawing, room, halls)
    )


def _runs_between(drawing: WallDrawing, room: int, targets: Iterable[int]) -> list[WallRun]:
    """The walls between a room and others, the longest first."""
    runs = [r for r in drawing.runs if room in r.rooms and r.rooms & set(targets)]
    runs = [r for r in runs if r.rooms not in open_pairs(drawing.layout)]
    return sorted(runs, key=lambda r: (-r.length, r.line, r.low))


def _add_doors_of_en_suite(drawing: WallDrawing, room: int, bedrooms: tuple[int, ...]) -> None:
    """Add a bathroom's door to its bedroom; the home's only bathroom gets another to the hall if it fits."""
    targets: list[tuple[Iterable[int], bool]] = [(bedrooms, True)]
    if drawing.types.count(RoomType.BATHROOM) == 1:
        targets.append((rooms_of_types(drawing.types, RoomType.HALL), False))
    for entries, may_meet in targets:
        for run in _runs_between(drawing, room, entries):
            if _add_door(drawing, run, room, OpeningKind.DOOR, _WET_DOOR_M, may_meet=may_meet):
                break


def _doors_to(drawing: WallDrawing, type_: RoomType) -> Iterable[list[int]]:
    types = drawing.types
    halls = rooms_of_types(types, RoomType.HALL)
    if type_ is RoomType.KITCHEN:
        return halls, rooms_of_types(types, RoomType.LIVING, RoomType.STUDIO)
    if type_ is RoomType.WARDROBE:
        return rooms_of_types(types, RoomType.BEDROOM), halls
    if type_ is RoomType.STORE:
        return halls, rooms_of_types(types, RoomType.KITCHEN)
    if type_ is RoomType.BATHROOM:
        return halls, rooms_of_types(types, RoomType.BEDROOM)
    return [rooms_of_types(types, t) for t in drawing.layout.programme.entered_from(type_)]


def _add_door(
    drawing: WallDrawing,
    run: WallRun,
    room: int,
    kind: OpeningKind,
    width: float,
    *,
    may_meet: bool = True,
) -> bool:
    """Add a door at one end of a run (its swing may meet another's if may_meet); False without space."""
    low, high = drawing.free(run)
    # Stand nearer to the corner where the wall is short.
    corner = min(_FROM_CORNER_M, (high - low - width) / 2)
    if corner < _LEAST_CORNER_M:
        return False
    at_low, at_high = low + corner + width / 2, high - corner - width / 2
    places = [(at_low, True), (at_high, False)]
    if drawing.rng.random() < 0.5:
        places.reverse()
    neighbour = next((r for r in run.rooms if r != room), OUTSIDE)
    # Doors of small rooms open outwards, since the leaf would fill the room.
    opens_out = neighbour != OUTSIDE and drawing.types[room] in _OPENS_OUT
    into, behind = (neighbour, room) if opens_out else (room, neighbour)
    for middle, hinge_at_start in places:
        span = (middle - width / 2 - 0.02, middle + width / 2 + 0.02)
        if any(a < span[1] and b > span[0] for a, b in drawing.taken(run)):
            continue
        if kind is not OpeningKind.PASSAGE:
            swing = drawing.swing(run, middle, width, into)
            if not may_meet and drawing.meets_swing(into, swing):
                continue
            drawing.swings.append((into, swing))
        wall, along = drawing.wall_of(run, middle)
        drawing.openings.append(
            PlanOpening(
                kind,
                wall,
                round(along, 4),
                width,
                drawing.family.door_height,
                0.0,
                into,
                None if behind == OUTSIDE else behind,
                hinge_at_start,
            )
        )
        return True
    return False


_WIDEST_M: Final = 2.4
_FRENCH_SILL_M: Final = 0.1
_BALCONY_M: Final = 4.5
_CLEAR_M: Final = 0.35  # between a window and a corner or another window
GLASS_SHARE: Final = 1 / 8  # least area of windows by floor area, in rooms to live in


def is_lit(run: WallRun, layout: Layout) -> bool:
    """Whether daylight comes in through an outer run: its side is no neighbour's wall."""
    left, top, right, bottom = layout.lit_sides
    if run.is_vertical:
        if run.line in (0, layout.width):
            return left if run.line == 0 else right
    elif run.line in (0, layout.depth):
        return top if run.line == 0 else bottom
    return True


def add_balcony(drawing: WallDrawing) -> None:
    """A balcony before the longest wall with daylight of the living room, and the way out."""
    living = rooms_of_types(drawing.types, RoomType.LIVING, RoomType.STUDIO)[0]
    lit = [r for r in drawing.runs if r.rooms == {living, OUTSIDE} and is_lit(r, drawing.layout)]
    # Walls of a notch have no room before them.
    ends = (0, drawing.layout.width), (0, drawing.layout.depth)
    lit = [r for r in lit if r.line in ends[not r.is_vertical] and r.length >= 2.8]
    if not lit:
        return
    run = max(lit, key=lambda r: (r.length, r.line, r.low))
    low, high = drawing.free(run)
    high = min(high, low + _BALCONY_M)
    room, parapet = balcony(run, low, high)
    drawing.rooms.append(room)
    drawing.walls.extend(parapet)
    drawing.rims += [parapet[0].start, parapet[-1].end]
    # Its doors light a large room by themselves.
    glass, height = 1.1 * drawing.rooms[living].area * GLASS_SHARE, drawing.family.french_height
    width = round(min(max(glass / height, 1.8), 3.0, high - low - 2 * _CLEAR_M), 2)
    middle = (low + high) / 2
    wall, along = drawing.wall_of(run, middle)
    drawing.openings.append(
        PlanOpening(
            OpeningKind.FRENCH_WINDOW,
            wall,
            round(along, 4),
            width,
            height,
            _FRENCH_SILL_M,
            living,
            len(drawing.rooms) - 1,
        )
    )


def add_windows(drawing: WallDrawing, room: int) -> None:
    """Windows until a room's glass is an eighth of its floor; small ones where water runs."""
    own_room, usual = drawing.rooms[room], drawing.family.window
    runs = [r for r in drawing.runs if r.rooms == {room, OUTSIDE} and is_lit(r, drawing.layout)]
    runs.sort(key=lambda r: (-r.length, r.line, r.low))
    if own_room.type in (RoomType.BATHROOM, RoomType.WC):
        if runs and drawing.rng.random() < 0.75:
            _add_window(drawing, runs[0], room, (0.6, 0.6, 1.5))
        return
    if not own_room.type.is_habitable and own_room.type is not RoomType.HALL:
        return
    if own_room.type is RoomType.HALL:
        # A hall has a window where its outer wall is long.
        if runs and runs[0].length > 2.6 and drawing.rng.random() < 0.5:
            _add_window(drawing, runs[0], room, (0.8, usual.height, usual.sill))
        return
    is_living = own_room.type in (RoomType.LIVING, RoomType.STUDIO)
    height, sill = usual.height, usual.sill
    if is_living and drawing.rng.random() < drawing.family.french:
        height, sill = drawing.family.french_height, _FRENCH_SILL_M
    glass = sum(o.width * o.height for o in drawing.openings if _is_window_of(o, room))
    glass_wanted = own_room.area * GLASS_SHARE * float(drawing.rng.uniform(*drawing.family.glass))
    # Fill the longest wall first, with two windows at most; make them wider where it is short.
    for run in runs:
        missing = glass_wanted - glass
        if missing <= 0:
            break
        for gap in drawing.gaps(run):
            n = min(max(math.ceil(missing / (usual.width * height)), 1), 3)
            added = _add_row(drawing, run, gap, room, (n, missing, height, sill))
            glass, missing = glass + added, missing - added
            if missing <= 0:
                break
    if glass_wanted - glass > 0.05 * glass_wanted:
        _widen(drawing, room, own_room.area * GLASS_SHARE)


def _is_window_of(opening: PlanOpening, room: int) -> bool:
    is_window = opening.kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)
    return is_window and room == opening.room


def _add_row(
    drawing: WallDrawing,
    run: WallRun,
    gap: tuple[float, float],
    room: int,
    wish: tuple[int, float, float, float],
) -> float:
    """Spread the wished windows over a gap of a run; their glass in square metres."""
    (low, high), (n, missing, height, sill) = gap, wish
    for count in range(n, 0, -1):
        room_each = (high - low - _CLEAR_M * (count + 1)) / count
        width = min(max(missing / count / height, 0.8), _WIDEST_M, room_each)
        if width < 0.6:
            continue
        # Round to the sizes that windows come in.
        width = math.floor(width * 10 + 0.999) / 10 if width + 0.1 <= room_each else width
        spacing = (high - low - count * width) / (count + 1)
        glass = 0.0
        for k in range(count):
            middle = low + spacing * (k + 1) + width * (k + 0.5)
            glass += _add_window(drawing, run, room, (width, height, sill), middle)
        if glass:
            return glass
    return 0.0


def _add_window(
    drawing: WallDrawing,
    run: WallRun,
    room: int,
    size: tuple[float, float, float],
    middle: float | None = None,
) -> float:
    """A window (width, height, sill) in a run, in its middle if not given; gives its glass."""
    width, height, sill = size
    low, high = drawing.free(run)
    middle = (low + high) / 2 if middle is None else middle
    span = (middle - width / 2, middle + width / 2)
    if span[0] < low + 0.15 or span[1] > high - 0.15:
        return 0.0
    if any(a < span[1] + 0.2 and b > span[0] - 0.2 for a, b in drawing.taken(run)):
        return 0.0
    kind = OpeningKind.FRENCH_WINDOW if sill < 0.3 else OpeningKind.WINDOW
    wall, along = drawing.wall_of(run, middle)
    drawing.openings.append(
        PlanOpening(kind, wall, round(along, 4), round(width, 2), height, sill, room)
    )
    return width * height


def _widen(drawing: WallDrawing, room: int, target: float) -> None:
    """Make a room's windows French ones where plain ones give too little light."""
    window_numbers = [i for i, o in enumerate(drawing.openings) if _is_window_of(o, room)]
    for i in window_numbers:
        glass = sum(drawing.openings[j].width * drawing.openings[j].height for j in window_numbers)
        old = drawing.openings[i]
        if glass >= target:
            return
        drawing.openings[i] = PlanOpening(
            OpeningKind.FRENCH_WINDOW,
            old.wall,
            old.along,
            old.width,
            drawing.family.french_height,
            _FRENCH_SILL_M,
            old.room,
            old.other,
        )
