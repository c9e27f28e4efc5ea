"""Doors, windows and the balcony of a plan; no effects."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
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
    Point,
    Rect,
    RoomType,
)
from pbrs_farm.generate.layout import Layout
from pbrs_farm.generate.plan_families import PlanFamily
from pbrs_farm.generate.plan_walls import OUTER_M, OUTSIDE, PARAPET_M, WallRun, balcony, open_pairs
from pbrs_farm.generate.slicing import STEP_M

# A plan while its openings are drawn: walls, what is taken of them, what leaves sweep.


_LEAVES_M: Final = 0.1  # that the squares of two leaves may share


@dataclass(slots=True)
class WallDrawing:
    """What doors and windows are added to."""

    layout: Layout
    runs: list[WallRun]
    walls: list[PlanWall]
    rooms: list[PlanRoom]
    rng: np.random.Generator
    openings: list[PlanOpening] = field(default_factory=list)
    rims: list[Point] = field(default_factory=list)  # where parapets meet the wall
    swings: list[tuple[int, Rect]] = field(default_factory=list)  # room, what a leaf sweeps there

    @property
    def types(self) -> list[RoomType]:
        """Of each room."""
        return [room.type for room in self.rooms]

    @property
    def family(self) -> PlanFamily:
        """Whose habits it follows."""
        return self.layout.programme.family

    def wall_of(self, run: WallRun, at: float) -> tuple[int, float]:
        """(number, metres from its start) of the wall that holds the coordinate `at` of a run."""
        x, z = run.point(at / STEP_M)
        for number, wall in enumerate(self.walls):
            (x0, z0), (x1, z1) = wall.start, wall.end
            if run.is_vertical and x0 == x1 and abs(x - x0) < 1e-6 and z0 <= z <= z1:
                return number, z - z0
            if not run.is_vertical and z0 == z1 and abs(z - z0) < 1e-6 and x0 <= x <= x1:
                return number, x - x0
        raise AssertionError("each run that is not open has a wall")

    def free(self, run: WallRun) -> tuple[float, float]:
        """(low, high) metres on the run's axis between the faces of the walls at its ends."""
        low, high = (self._margin(run, end) for end in (run.low, run.high))
        return run.low * STEP_M + low, run.high * STEP_M - high

    def _margin(self, run: WallRun, end: int) -> float:
        x, z = run.point(end)
        margin = 0.0
        for wall in self.walls:
            (x0, z0), (x1, z1) = wall.start, wall.end
            crosses = (x0 == x1) != run.is_vertical
            touches = x0 - 1e-6 <= x <= x1 + 1e-6 and z0 - 1e-6 <= z <= z1 + 1e-6
            if crosses and touches:
                margin = max(margin, wall.thickness / 2)
        return margin

    def taken(self, run: WallRun) -> list[tuple[float, float]]:
        """What openings already take of a run's axis."""
        spans = []
        for opening in self.openings:
            wall = self.walls[opening.wall]
            x, z = wall.at(opening.along)
            here, along = (x, z) if run.is_vertical else (z, x)
            if (wall.start[0] == wall.end[0]) == run.is_vertical and (
                abs(here - run.line * STEP_M) < 1e-6
            ):
                spans.append((along - opening.width / 2, along + opening.width / 2))
        # Nothing opens where a parapet meets the wall.
        half = PARAPET_M / 2
        for x, z in self.rims:
            here, along = (x, z) if run.is_vertical else (z, x)
            if abs(here - run.line * STEP_M) < OUTER_M:
                spans.append((along - half, along + half))
        return spans

    def gaps(self, run: WallRun) -> list[tuple[float, float]]:
        """What openings leave of a run between its corners, the longest first."""
        low, high = self.free(run)
        found = []
        for a, b in sorted(self.taken(run)):
            if a < high and b > low:
                found.append((low, a))
                low = b
        return sorted([*found, (low, high)], key=lambda g: (g[0] - g[1], g[0]))

    def swing(self, run: WallRun, at: float, width: float, room: int) -> Rect:
        """The square in a room that a door's leaf can sweep."""
        side = 1 if run.after == room else -1
        line = run.line * STEP_M
        across, along = sorted((line, line + side * width)), (at - width / 2, at + width / 2)
        (x0, x1), (z0, z1) = (across, along) if run.is_vertical else (along, across)
        return x0, z0, x1, z1

    def meets_swing(self, room: int, rect: Rect) -> bool:
        """Whether a leaf would hit another one of the room."""
        return any(
            other == room
            and min(rect[2], r[2]) - max(rect[0], r[0]) > _LEAVES_M
            and min(rect[3], r[3]) - max(rect[1], r[1]) > _LEAVES_M
            for other, r in self.swings
        )


def numbers(types: list[RoomType], *wanted: RoomType) -> list[int]:
    """The rooms of the wanted types."""
    return [i for i, t in enumerate(types) if t in wanted]


# What an unfurnished plan must have: daylight where people live, a way to every room.


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


# The windows and the balcony of a plan.


_WIDEST_M: Final = 2.4
_FRENCH_SILL_M: Final = 0.1
_BALCONY_M: Final = 4.5
_CLEAR_M: Final = 0.35  # between a window and a corner or another window


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
    living = numbers(drawing.types, RoomType.LIVING, RoomType.STUDIO)[0]
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
    here, usual = drawing.rooms[room], drawing.family.window
    runs = [r for r in drawing.runs if r.rooms == {room, OUTSIDE} and is_lit(r, drawing.layout)]
    runs.sort(key=lambda r: (-r.length, r.line, r.low))
    if here.type in (RoomType.BATHROOM, RoomType.WC):
        if runs and drawing.rng.random() < 0.75:
            _add_window(drawing, runs[0], room, (0.6, 0.6, 1.5))
        return
    if not here.type.is_habitable and here.type is not RoomType.HALL:
        return
    if here.type is RoomType.HALL:
        # A hall has a window where its outer wall is long.
        if runs and runs[0].length > 2.6 and drawing.rng.random() < 0.5:
            _add_window(drawing, runs[0], room, (0.8, usual.height, usual.sill))
        return
    is_living = here.type in (RoomType.LIVING, RoomType.STUDIO)
    height, sill = usual.height, usual.sill
    if is_living and drawing.rng.random() < drawing.family.french:
        height, sill = drawing.family.french_height, _FRENCH_SILL_M
    glass = sum(o.width * o.height for o in drawing.openings if _is_window_of(o, room))
    wanted = here.area * GLASS_SHARE * float(drawing.rng.uniform(*drawing.family.glass))
    # Fill the longest wall first, with two windows at most; make them wider where it is short.
    for run in runs:
        missing = wanted - glass
        if missing <= 0:
            break
        for gap in drawing.gaps(run):
            n = min(max(math.ceil(missing / (usual.width * height)), 1), 3)
            added = _add_row(drawing, run, gap, room, (n, missing, height, sill))
            glass, missing = glass + added, missing - added
            if missing <= 0:
                break
    if wanted - glass > 0.05 * wanted:
        _widen(drawing, room, here.area * GLASS_SHARE)


def _is_window_of(opening: PlanOpening, room: int) -> bool:
    is_window = opening.kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)
    return is_window and room == opening.room


def _add_row(
    drawing: WallDrawing, run: WallRun, gap: tuple[float, float], room: int,
    wish: tuple[int, float, float, float],
) -> float:  # fmt: skip
    """Windows of one size spread over a gap of a run; gives their glass in square metres.

    wish: how many, their glass, height and sill.
    """
    (low, high), (n, missing, height, sill) = gap, wish
    for count in range(n, 0, -1):
        room_each = (high - low - _CLEAR_M * (count + 1)) / count
        width = min(max(missing / count / height, 0.8), _WIDEST_M, room_each)
        if width < 0.6:
            continue
        # Round to the sizes that windows come in.
        width = math.floor(width * 10 + 0.999) / 10 if width + 0.1 <= room_each else width
        apart = (high - low - count * width) / (count + 1)
        glass = 0.0
        for k in range(count):
            middle = low + apart * (k + 1) + width * (k + 0.5)
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
    """A window (width, height, sill) in a run, in its middle if not told; gives its glass."""
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


def _widen(drawing: WallDrawing, room: int, wanted: float) -> None:
    """Make a room's windows French ones where plain ones give too little light."""
    own = [i for i, o in enumerate(drawing.openings) if _is_window_of(o, room)]
    for i in own:
        glass = sum(drawing.openings[j].width * drawing.openings[j].height for j in own)
        old = drawing.openings[i]
        if glass >= wanted:
            return
        drawing.openings[i] = PlanOpening(
            OpeningKind.FRENCH_WINDOW, old.wall, old.along, old.width,
            drawing.family.french_height, _FRENCH_SILL_M, old.room, old.other,
        )  # fmt: skip


# Doors, windows and the balcony of a plan.


_PASSAGES_M: Final = (1.5, 1.2)  # the wider one where it fits
_DOOR_M, _WET_DOOR_M, _ENTRANCE_M = 0.9, 0.8, 0.95
_FROM_CORNER_M: Final = 0.10  # of a door's frame
_LEAST_CORNER_M: Final = 0.03
_OPENS_OUT: Final = (RoomType.WC, RoomType.STORE)


def openings_of(
    layout: Layout,
    runs: list[WallRun],
    walls: tuple[PlanWall, ...],
    rooms: tuple[PlanRoom, ...],
    rng: np.random.Generator,
) -> tuple[tuple[PlanRoom, ...], tuple[PlanWall, ...], tuple[PlanOpening, ...]]:
    """Rooms and walls with the balcony's added, and every door and window."""
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
    for others in _doors_to(drawing, type_):
        # Two leaves that hit each other are the last choice.
        if any(
            _add_door(drawing, run, room, OpeningKind.DOOR, width, may_meet=may_meet)
            for may_meet in (False, True)
            for run in _runs_between(drawing, room, others)
        ):
            break
    # A closed kitchen often has a second door, to the living room; a bedroom of some families.
    if type_ is RoomType.KITCHEN and not drawing.layout.programme.open_kitchen:
        _add_second_door(drawing, room, 0.6)
    elif type_ is RoomType.BEDROOM and drawing.family.enfilade:
        _add_second_door(drawing, room, drawing.family.enfilade)


def _add_second_door(drawing: WallDrawing, room: int, chance: float) -> None:
    """A door to the living room beside, where none is; chance: how often."""
    living = numbers(drawing.types, RoomType.LIVING, RoomType.STUDIO)
    between = [r for r in drawing.runs if room in r.rooms and r.rooms & set(living)]
    joined = any({o.room, o.other} == {room, *living} for o in drawing.openings)
    if between and not joined and drawing.rng.random() < chance:
        longest = max(between, key=lambda r: (r.length, r.line, r.low))
        _add_door(drawing, longest, room, OpeningKind.DOOR, _DOOR_M, may_meet=False)


def _add_passage(drawing: WallDrawing, room: int) -> bool:
    """A wide hole to the hall without a leaf; False where there is no room."""
    halls = numbers(drawing.types, RoomType.HALL)
    return any(
        _add_door(drawing, run, room, OpeningKind.PASSAGE, width)
        for width in _PASSAGES_M
        for run in _runs_between(drawing, room, halls)
    )


def _runs_between(drawing: WallDrawing, room: int, others: Iterable[int]) -> list[WallRun]:
    """The walls between a room and others, the longest first."""
    runs = [r for r in drawing.runs if room in r.rooms and r.rooms & set(others)]
    runs = [r for r in runs if r.rooms not in open_pairs(drawing.layout)]
    return sorted(runs, key=lambda r: (-r.length, r.line, r.low))


def _add_doors_of_en_suite(drawing: WallDrawing, room: int, bedrooms: tuple[int, ...]) -> None:
    """A bathroom's door to its bedroom; the home's only one has another to the hall if it fits."""
    wanted: list[tuple[Iterable[int], bool]] = [(bedrooms, True)]
    if drawing.types.count(RoomType.BATHROOM) == 1:
        wanted.append((numbers(drawing.types, RoomType.HALL), False))
    for others, may_meet in wanted:
        for run in _runs_between(drawing, room, others):
            if _add_door(drawing, run, room, OpeningKind.DOOR, _WET_DOOR_M, may_meet=may_meet):
                break


def _doors_to(drawing: WallDrawing, type_: RoomType) -> Iterable[list[int]]:
    types = drawing.types
    halls = numbers(types, RoomType.HALL)
    if type_ is RoomType.KITCHEN:
        return halls, numbers(types, RoomType.LIVING, RoomType.STUDIO)
    if type_ is RoomType.WARDROBE:
        return numbers(types, RoomType.BEDROOM), halls
    if type_ is RoomType.STORE:
        return halls, numbers(types, RoomType.KITCHEN)
    if type_ is RoomType.BATHROOM:
        return halls, numbers(types, RoomType.BEDROOM)
    return [numbers(types, one) for one in drawing.layout.programme.entered_from(type_)]


def _add_door(
    drawing: WallDrawing,
    run: WallRun,
    room: int,
    kind: OpeningKind,
    width: float,
    *,
    may_meet: bool = True,
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
        if kind is not OpeningKind.PASSAGE:
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
                drawing.family.door_height,
                0.0,
                into,
                None if behind == OUTSIDE else behind,
                hinge_at_start,
            )
        )
        return True
    return False
