"""Build the walls between and around room polygons; no effects.

Rooms may touch or leave space for walls: a shared side gets a wall of INNER_M, a gap a wall of its
width, the outside one of OUTER_M. A wall stub inside a room keeps its drawn thickness. A balcony
gets parapets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.ops import unary_union

from pbrs_farm.generate.floor_plan import PlanRoom, PlanWall, Point, RoomType
from pbrs_farm.generate.plan_walls import INNER_M, OUTER_M, PARAPET_HEIGHT_M, PARAPET_M, corners

_TOUCH_M: Final = 0.02  # rooms nearer than this share a side
_THICKEST_M: Final = 0.6  # thickest wall between two rooms
_PARALLEL: Final = 0.999  # cosine between two sides that face each other


class DrawnRoom(NamedTuple):
    """A room before walls are built."""

    place: str  # where the file has it: "room 3"
    type: RoomType
    name: str
    shape: Polygon  # as PlanRoom has it


def walled(drawn: Sequence[DrawnRoom]) -> tuple[tuple[PlanWall, ...], tuple[PlanRoom, ...]]:
    """Walls between and around rooms, and the rooms, in order, without the walls' ground."""
    shapes = [room.shape for room in drawn]
    rings = [_Ring(shape) for shape in shapes]
    near = shapely.STRtree(shapes)
    walls: list[PlanWall] = []
    for number, room in enumerate(drawn):
        nearby = [int(k) for k in near.query(room.shape.buffer(_THICKEST_M)) if k != number]
        is_open_air = room.type is RoomType.BALCONY
        walls += _walls_of(number, room.shape, rings, sorted(nearby), is_open_air=is_open_air)
    ground = unary_union([_wall_polygon(wall) for wall in walls])
    rooms = [PlanRoom(r.type, r.name, corners(r.shape.difference(ground))) for r in drawn]
    return tuple(walls), tuple(rooms)


def _wall_polygon(wall: PlanWall) -> Polygon:
    line = LineString([wall.start, wall.end])
    return line.buffer(wall.thickness / 2, cap_style="flat")


class _Ring:
    """The sides of a room as arrays."""

    def __init__(self, shape: Polygon) -> None:
        ring = shapely.get_coordinates(shape.exterior)
        self.from_, self.to = ring[:-1], ring[1:]
        way = self.to - self.from_
        self.ways = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)


def _walls_of(
    number: int, shape: Polygon, rings: list[_Ring], neighbours: list[int], *, is_open_air: bool
) -> list[PlanWall]:
    """The walls that a room adds: to rooms of higher number, and outer ones (a balcony: parapets)."""
    outer, height = (PARAPET_M, PARAPET_HEIGHT_M) if is_open_air else (OUTER_M, None)
    ring: list[Point] = [(x, z) for x, z, *_ in shape.exterior.coords[:-1]]
    walls = []
    for k, a in enumerate(ring):
        b, before, after = ring[(k + 1) % len(ring)], ring[k - 1], ring[(k + 2) % len(ring)]
        side = _Side(a, b)
        free = [(0.0, side.length)]
        for neighbour in neighbours:
            for low, high, gap in side.shared(rings[neighbour]):
                free = _without(free, low, high)
                if neighbour > number:
                    walls.append(side.wall(low, high, max(gap, INNER_M), gap / 2))
        # Of the two sides of a thin stub the first has the wall: outer ones would be thicker than it.
        for low, high, gap, j in side.shared_sides(rings[number]):
            if gap < outer:
                free = _without(free, low, high)
                if j > k:
                    walls.append(side.stub(low, high, max(gap, INNER_M), gap / 2))
        for low, high in free:
            if high - low < _TOUCH_M:
                continue
            # Draw an outer wall out to where the next one's outer face is.
            start = outer * _mitre(before, a, b) if low == 0.0 else INNER_M / 2
            end = outer * _mitre(a, b, after) if high == side.length else INNER_M / 2
            wall = side.wall(low - start, high + end, outer, outer / 2, is_outer=True)
            walls.append(replace(wall, height=height))
    return walls


def _mitre(a: Point, b: Point, c: Point) -> float:
    """Extension of an outer wall a..b beyond b, in thicknesses: 0 at an inward corner."""
    turn = math.atan2(c[1] - b[1], c[0] - b[0]) - math.atan2(b[1] - a[1], b[0] - a[0])
    turn = (turn + math.pi) % (2 * math.pi) - math.pi
    return min(math.tan(turn / 2), 2.0) if turn > 0 else 0.0


def _without(
    spans: list[tuple[float, float]], low: float, high: float
) -> list[tuple[float, float]]:
    remaining = [(a, min(b, low)) for a, b in spans] + [(max(a, high), b) for a, b in spans]
    return sorted({(a, b) for a, b in remaining if b - a > 1e-6})


class _Side:
    """A side of a room: its direction and the normal that looks out of the room."""

    def __init__(self, a: Point, b: Point) -> None:
        self.start = np.array(a)
        self.length = math.dist(a, b)
        self.along = (np.array(b) - self.start) / self.length
        self.out = np.array([self.along[1], -self.along[0]])

    def shared(self, ring: _Ring) -> list[tuple[float, float, float]]:
        """(from, to, gap) where a side of another room faces this one, metres along it."""
        return [row[:3] for row in self.shared_sides(ring)]

    def shared_sides(self, ring: _Ring) -> list[tuple[float, float, float, int]]:
        """(from, to, gap, number of the side) of each side of a ring that faces this one."""
        gaps = ((ring.from_ + ring.to) / 2 - self.start) @ self.out
        faces = (ring.ways @ self.along <= -_PARALLEL) & (gaps >= -_TOUCH_M) & (gaps <= _THICKEST_M)
        sides = []
        for k in np.flatnonzero(faces).tolist():
            ends = (np.stack([ring.from_[k], ring.to[k]]) - self.start) @ self.along
            low, high = max(float(ends.min()), 0.0), min(float(ends.max()), self.length)
            if high - low > 0.05:
                gap = float(gaps[k])
                sides.append((low, high, gap if gap > _TOUCH_M else 0.0, k))
        return sides

    def wall(
        self, low: float, high: float, thickness: float, out: float, *, is_outer: bool = False
    ) -> PlanWall:
        """The wall along low..high of this side, its middle line that far out."""
        if not is_outer:
            # Reach into the walls at its ends.
            low, high = low - OUTER_M / 4, high + OUTER_M / 4
        return self._wall_between(low, high, thickness, out, is_outer=is_outer)

    def stub(self, low: float, high: float, thickness: float, out: float) -> PlanWall:
        """A wall surrounded by a room on both sides and at its end, with its drawn length."""
        return self._wall_between(low, high, thickness, out, is_outer=False)

    def _wall_between(
        self, low: float, high: float, thickness: float, out: float, *, is_outer: bool
    ) -> PlanWall:
        ends = [self.start + self.along * t + self.out * out for t in (low, high)]
        a, b = ((round(float(x), 4), round(float(z), 4)) for x, z in ends)
        return PlanWall(a, b, round(thickness, 4), is_outer)
