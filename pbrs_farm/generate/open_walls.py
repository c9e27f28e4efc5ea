"""A plan during placement of its openings: walls, occupied stretches, door swings. No effects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pbrs_farm.generate.floor_plan import PlanOpening, PlanRoom, PlanWall, Point, Rect, RoomType
from pbrs_farm.generate.layout import Layout
from pbrs_farm.generate.plan_families import PlanFamily
from pbrs_farm.generate.plan_walls import OUTER_M, PARAPET_M, WallRun
from pbrs_farm.generate.slicing_goals import STEP_M

_LEAVES_M: Final = 0.1  # overlap allowed between the squares that two door leaves sweep


@dataclass(slots=True)
class WallDrawing:
    """The plan to which doors and windows are added."""

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
        """The plan family whose rules apply."""
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
        """Intervals of a run's axis occupied by openings."""
        spans = []
        for opening in self.openings:
            wall = self.walls[opening.wall]
            x, z = wall.at(opening.along)
            across, along = (x, z) if run.is_vertical else (z, x)
            if (wall.start[0] == wall.end[0]) == run.is_vertical and (
                abs(across - run.line * STEP_M) < 1e-6
            ):
                spans.append((along - opening.width / 2, along + opening.width / 2))
        # Nothing opens where a parapet meets the wall.
        half = PARAPET_M / 2
        for x, z in self.rims:
            across, along = (x, z) if run.is_vertical else (z, x)
            if abs(across - run.line * STEP_M) < OUTER_M:
                spans.append((along - half, along + half))
        return spans

    def gaps(self, run: WallRun) -> list[tuple[float, float]]:
        """Free intervals of a run between its corners, the longest first."""
        low, high = self.free(run)
        gaps = []
        for a, b in sorted(self.taken(run)):
            if a < high and b > low:
                gaps.append((low, a))
                low = b
        return sorted([*gaps, (low, high)], key=lambda g: (g[0] - g[1], g[0]))

    def swing(self, run: WallRun, at: float, width: float, room: int) -> Rect:
        """The square x0, z0, x1, z1 of a room (number) that a door's leaf sweeps, its middle `at` along the run."""
        side = 1 if run.after == room else -1
        line = run.line * STEP_M
        across, along = sorted((line, line + side * width)), (at - width / 2, at + width / 2)
        (x0, x1), (z0, z1) = (across, along) if run.is_vertical else (along, across)
        return x0, z0, x1, z1

    def meets_swing(self, room: int, rect: Rect) -> bool:
        """Whether a leaf would hit another one of the room."""
        return any(
            swing_room == room
            and min(rect[2], r[2]) - max(rect[0], r[0]) > _LEAVES_M
            and min(rect[3], r[3]) - max(rect[1], r[1]) > _LEAVES_M
            for swing_room, r in self.swings
        )


def rooms_of_types(types: list[RoomType], *wanted: RoomType) -> list[int]:
    """The rooms of the wanted types."""
    return [i for i, t in enumerate(types) if t in wanted]
