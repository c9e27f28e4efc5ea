"""Candidate walls for a kitchen run: one wall, or two that meet in a corner. No effects."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pbrs_farm.generate.floor_plan import Rect
from pbrs_farm.generate.furnish.room_space import FurnishSpace, RoomWall

DEPTH_M: Final = 0.62
WORKTOP_M: Final = 0.608  # of a unit without what opens it
MODULE_M: Final = 0.60
PULL_M: Final = 0.03  # that what opens a front sticks out of it
CORNER_M: Final = DEPTH_M + PULL_M + 0.02  # of the main arm's end, which no front opens
FILLER_M: Final = 0.06  # of the side arm's beginning, likewise
_SIDE_LOW_M: Final = 0.615  # from the corner: where the main arm's worktop ends
_BESIDE_WALL_M: Final = 0.03  # a strip between a unit and the wall at the run's end
_LONGEST_ARM_M: Final = 3.9
_LEAST_M: Final = 1.75  # fridge, sink and cooker


@dataclass(frozen=True, slots=True)
class Arm:
    """A stretch of wall for kitchen units, from `low` to `high`."""

    wall: RoomWall
    low: float
    high: float
    turns: int  # of its pieces against those of the main arm
    corner: float  # u of the main arm's corner that it starts from

    @property
    def length(self) -> float:
        """Metres."""
        return self.high - self.low


def run_shapes(space: FurnishSpace) -> Iterator[tuple[Arm, ...]]:
    """One arm, two that meet in a corner, or three; the first is the main one."""
    free = [_free(space, wall) for wall in space.walls]
    for k, wall in enumerate(space.walls):
        for low, high in free[k]:
            for a, b in _cuts(_off_wall(low, wall), _off_wall(high, wall), wall):
                yield (Arm(wall, a, b, 0, 0.0),)
        right = _next(space, k)
        if right is None:
            continue
        for low, high in free[k]:
            if high < wall.length - 0.01 or high - low < 1.2:
                continue
            for s_low, s_high in free[right]:
                if s_low > 0.01 or s_high < DEPTH_M + 0.9:
                    continue
                far = _off_wall(s_high, space.walls[right])
                for a in _starts(_off_wall(low, wall), high, CORNER_M):
                    for b in _starts(-far, -_SIDE_LOW_M, FILLER_M):
                        main = Arm(wall, a, wall.length, 0, 0.0)
                        side = Arm(space.walls[right], _SIDE_LOW_M, -b, 1, wall.length)
                        yield main, side


def _next(space: FurnishSpace, k: int) -> int | None:
    """The wall that meets wall k at its right end."""
    wall = space.walls[k]
    if not wall.is_right_corner:
        return None
    end = wall.frame.point(wall.length, 0.0)
    for n, next_wall in enumerate(space.walls):
        if abs(next_wall.frame.x - end[0]) + abs(next_wall.frame.z - end[1]) < 0.02:
            return n
    return None


def _off_wall(at: float, wall: RoomWall) -> float:
    """Where units end that would end at a place along a wall: a strip before the wall that meets it."""
    if wall.is_left_corner:
        at = max(at, _BESIDE_WALL_M)
    return min(at, wall.length - _BESIDE_WALL_M) if wall.is_right_corner else at


def _starts(low: float, high: float, corner: float) -> list[float]:
    # Whole stretches first, then shorter ones that keep their far end in the corner.
    cuts = [low] if high - low <= _LONGEST_ARM_M else []
    ends = [high - corner - n * MODULE_M for n in (1, 2, 3, 4, 5)]
    return cuts + [end for end in ends if low < end - 0.01]


def _cuts(low: float, high: float, wall: RoomWall) -> list[tuple[float, float]]:
    if high - low < _LEAST_M:
        return []
    cuts = [(low, high)] if high - low <= _LONGEST_ARM_M + 0.5 else []
    for n in (4, 5, 6, 7):
        length = n * MODULE_M
        if length < high - low - 0.01:
            cuts += [(low, low + length), (high - length, high)]
    return cuts


def _free(space: FurnishSpace, wall: RoomWall) -> list[tuple[float, float]]:
    """Stretches of a wall with room for units in front."""
    # Intervals of the strip blocked by door swings and low windows.
    taken = []
    strip = wall.frame.rect((0.0, 0.0, wall.length, DEPTH_M + 0.02))
    low_windows = [w.zone for w in space.windows if w.sill < 0.8]
    for rect in [*(tuple(r) for r in space.doors.tolist()), *low_windows]:
        along = _span_along_wall(rect, strip, wall)
        if along is not None:
            taken.append(along)
    # Sweep along the wall; a unit needs 0.6 m.
    stretches, start = [], 0.0
    for low, high in sorted(taken):
        if low - start > 0.6:
            stretches.append((start, low))
        start = max(start, high)
    if wall.length - start > 0.6:
        stretches.append((start, wall.length))
    return stretches


def _span_along_wall(rect: Rect, strip: Rect, wall: RoomWall) -> tuple[float, float] | None:
    """(from, to) along a wall, metres, that a rectangle takes of the strip along it; or None."""
    if min(rect[2], strip[2]) - max(rect[0], strip[0]) < 0.01:
        return None
    if min(rect[3], strip[3]) - max(rect[1], strip[1]) < 0.01:
        return None
    f = wall.frame
    along = [(x - f.x) * f.dx + (z - f.z) * f.dz for x, z in (rect[:2], rect[2:])]
    return max(min(along), 0.0), min(max(along), wall.length)
