"""The windows and the balcony of a plan. No effects."""

from __future__ import annotations

import math
from typing import Final

from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening, RoomType
from pbrs_farm.generate.layout import Layout
from pbrs_farm.generate.open_walls import WallDrawing, rooms_of_types
from pbrs_farm.generate.plan_walls import OUTSIDE, WallRun, balcony

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
