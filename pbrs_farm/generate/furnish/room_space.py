"""Free space of a room for furniture: its walls, and the areas of doors and windows; no effects."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import shapely
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from pbrs_farm.core.arrays import F64
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, PlanOpening, Point, Rect, RoomType
from pbrs_farm.generate.furnish.template import WallFrame

BEFORE_DOOR_M: Final = 0.8
BEFORE_FRENCH_M: Final = 0.6
_BEFORE_WINDOW_M: Final = 0.4
_TALL_BEFORE_WINDOW_M: Final = 0.65  # for furniture that hides much of a window
_ABOVE_SILL_M: Final = 0.08  # furniture up to so far above a sill is not before its window
_TALL_ABOVE_SILL_M: Final = 0.5
_SPARE_M: Final = 0.03  # behind an open leaf
_BESIDE_DOOR_M: Final = 0.01  # more than two rectangles may overlap unseen (places.py)
_OPEN_M: Final = 0.9  # kept free along the middle of a side without a wall
_EPSILON: Final = 1e-3
_BESIDE_WALL_M: Final = 0.6  # what doors need free within this of a wall takes some of it


@dataclass(frozen=True, slots=True)
class RoomWall:
    """A straight stretch of wall from its left end, seen from the room."""

    frame: WallFrame
    length: float
    is_left_corner: bool  # whether another wall meets it there, inside the room
    is_right_corner: bool


@dataclass(frozen=True, slots=True)
class Window:
    """A window of a room, with the strips in front of it to keep clear."""

    zone: Rect
    tall_zone: Rect  # for furniture that hides much of it
    sill: float
    middle: Point
    wall: int  # index into RoomSpace.walls; -1 = none
    low: float  # along that wall
    high: float

    @property
    def clear_above(self) -> tuple[tuple[Rect, float], ...]:
        """Strips, each with the height above the floor from which it is kept clear."""
        return (
            (self.zone, self.sill + _ABOVE_SILL_M),
            (self.tall_zone, self.sill + _TALL_ABOVE_SILL_M),
        )


@dataclass(frozen=True, slots=True, eq=False)
class FurnishSpace:
    """One room of a plan, or a part of it."""

    number: int
    polygon: Polygon
    walk_polygon: BaseGeometry  # with the rooms that no wall parts from it
    walls: tuple[RoomWall, ...]
    outside: F64  # (N, 4) rectangles around the polygon
    doors: F64  # (D, 4) rectangles before doors, on either side, swings included
    ways: tuple[Rect, ...]  # what a way must join: before each door and open side
    windows: tuple[Window, ...]
    height: float

    @property
    def bounds(self) -> Rect:
        """Around the polygon."""
        x0, z0, x1, z1 = self.polygon.bounds
        return x0, z0, x1, z1

    @property
    def area(self) -> float:
        """Square metres."""
        return float(self.polygon.area)


def room_space(plan: Plan, number: int) -> FurnishSpace:
    """The space of a room with openings and their areas to keep free, without furniture (`with_bodies`)."""
    room = plan.rooms[number]
    polygon = Polygon(room.polygon)
    neighbours = _open_neighbours(plan, number)
    near = [n for _, n in neighbours]
    walls = _walls_of_room(room.polygon, near)
    doors, ways, windows = [], [], []
    for opening in plan.openings_of(number):
        frame = _seen_from(plan, opening, polygon)
        if frame is None:
            continue
        half = opening.width / 2
        if opening.kind is OpeningKind.WINDOW:
            windows.append(_window_of_opening(opening, frame, walls, _BEFORE_WINDOW_M))
            continue
        is_french = opening.kind is OpeningKind.FRENCH_WINDOW
        # As far as a leaf reaches, also where it swings to the other side.
        depth = max(BEFORE_DOOR_M, opening.width) + _SPARE_M
        if is_french:
            windows.append(_window_of_opening(opening, frame, walls, BEFORE_FRENCH_M))
            depth = BEFORE_FRENCH_M
        side = half + _BESIDE_DOOR_M
        doors.append(frame.rect((-side, 0.0, side, depth)))
        if not is_french or opening.other is not None:
            ways.append(frame.rect((-half + 0.15, 0.2, half - 0.15, 0.75)))
    # Keep the whole area in front of stairs free; nobody walks across them.
    stairs = [n for i, n in neighbours if plan.rooms[i].type is RoomType.STAIRS]
    floors = [n for n in near if n not in stairs]
    for open_to, width in ((floors, _OPEN_M), (stairs, math.inf)):
        for way, free in _open_sides(room.polygon, open_to, width):
            ways.append(way)
            doors.append(free)
    return FurnishSpace(
        number,
        polygon,
        unary_union([polygon, *(n.buffer(_EPSILON) for n in floors)]),
        walls,
        outside_of(polygon),
        np.array(doors).reshape(-1, 4),
        tuple(ways),
        tuple(windows),
        plan.height,
    )


def with_bodies(space: FurnishSpace, bodies: Sequence[Rect]) -> FurnishSpace:
    """The space with existing furniture subtracted."""
    if not bodies:
        return space
    return replace(space, outside=np.concatenate([space.outside, np.array(bodies)]))


def free_stretches(space: FurnishSpace, least: float) -> tuple[float, ...]:
    """Metres of each stretch of wall, of least or more, without doors and windows; the longest first."""
    lengths = set()
    for number, wall in enumerate(space.walls):
        f = wall.frame
        taken = [(w.low, w.high) for w in space.windows if w.wall == number]
        for x0, z0, x1, z1 in space.doors.tolist():
            # A door's ground in the wall's frame: along it, and out of it.
            ends = [
                ((x - f.x) * f.dx + (z - f.z) * f.dz, (z - f.z) * f.dx - (x - f.x) * f.dz)
                for x, z in ((x0, z0), (x1, z1))
            ]
            (a, b), out = sorted(u for u, _v in ends), min(v for _u, v in ends)
            if -_BESIDE_WALL_M < out < _BESIDE_WALL_M and b > 0 and a < wall.length:
                taken.append((a, b))
        start = 0.0
        for a, b in [*sorted(taken), (wall.length, wall.length)]:
            if a - start >= least:
                lengths.add(round(a - start, 3))
            start = max(start, b)
    return tuple(sorted(lengths, reverse=True))


def outside_of(polygon: Polygon) -> F64:
    """(N, 4) rectangles outside a polygon within its bounds and a rim of 3 m, cells of slanted sides included."""
    x0, z0, x1, z1 = polygon.bounds
    far = 3.0
    rects = [
        (x0 - far, z0 - far, x0, z1 + far),
        (x1, z0 - far, x1 + far, z1 + far),
        (x0 - far, z0 - far, x1 + far, z0),
        (x0 - far, z1, x1 + far, z1 + far),
    ]
    # Cut the bounds at every corner; keep cells whose centre is outside.
    points = list(polygon.exterior.coords)
    xs, zs = sorted({p[0] for p in points}), sorted({p[1] for p in points})
    for xa, xb in pairwise(xs):
        for za, zb in pairwise(zs):
            cell = box(xa, za, xb, zb)
            if polygon.intersection(cell).area < 0.999 * cell.area:
                rects.append((xa, za, xb, zb))
    return np.array(rects)


def _open_neighbours(plan: Plan, number: int) -> list[tuple[int, Polygon]]:
    """Adjacent rooms without a wall between."""
    outline = Polygon(plan.rooms[number].polygon)
    neighbours = []
    for neighbour, room in enumerate(plan.rooms):
        polygon = Polygon(room.polygon)
        if neighbour != number and outline.distance(polygon) < _EPSILON:
            common = outline.buffer(2 * _EPSILON).intersection(polygon)
            if common.area > 0.5 * 2 * _EPSILON:
                neighbours.append((neighbour, polygon))
    return neighbours


def _walls_of_room(corners: tuple[Point, ...], open_to: Iterable[Polygon]) -> tuple[RoomWall, ...]:
    """The sides of a room, cut where it is open."""
    near = unary_union([p.buffer(2 * _EPSILON) for p in open_to])
    n, walls = len(corners), []
    for i, a in enumerate(corners):
        b, before, after = corners[(i + 1) % n], corners[i - 1], corners[(i + 2) % n]
        length = math.dist(a, b)
        if length < 0.3 or min(abs(b[0] - a[0]), abs(b[1] - a[1])) > 0.02:
            continue
        dx, dz = round((b[0] - a[0]) / length), round((b[1] - a[1]) / length)
        frame = WallFrame(a[0], a[1], dx, dz)
        # An inner corner turns left, since the outline is anticlockwise.
        is_left_corner = _turn(before, a, b) > 0
        right = _turn(a, b, after) > 0
        for low, high in _solid(frame, length, near):
            start = WallFrame(*frame.point(low, 0.0), dx, dz)
            walls.append(
                RoomWall(
                    start, high - low, is_left_corner and low < 0.01, right and high > length - 0.01
                )
            )
    return tuple(walls)


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _solid(frame: WallFrame, length: float, near: BaseGeometry) -> list[tuple[float, float]]:
    """Stretches of a side that are not open, by samples every 2.5 cm."""
    if near.is_empty:
        return [(0.0, length)]
    n = max(int(length / 0.025), 2)
    samples = np.linspace(0, length, n + 1)
    middles = (samples[1:] + samples[:-1]) / 2
    shapely.prepare(near)
    is_open = shapely.contains_xy(near, frame.x + middles * frame.dx, frame.z + middles * frame.dz)
    stretches, start = [], None
    for k, opened in enumerate([*is_open.tolist(), True]):
        if not opened and start is None:
            start = float(samples[k])
        if opened and start is not None:
            if float(samples[k]) - start >= 0.3:
                stretches.append((start, float(samples[k])))
            start = None
    return stretches


def _rect_around_point(point: Point) -> Rect:
    return point[0] - 1e-4, point[1] - 1e-4, point[0] + 1e-4, point[1] + 1e-4


def _open_sides(
    corners: tuple[Point, ...], open_to: Iterable[Polygon], width: float
) -> list[tuple[Rect, Rect]]:
    """(what a way must reach, what stays free: at most so wide) for each open side."""
    near = unary_union([p.buffer(2 * _EPSILON) for p in open_to])
    sides = []
    if near.is_empty:
        return []
    for i, a in enumerate(corners):
        b = corners[(i + 1) % len(corners)]
        length = math.dist(a, b)
        if length < 0.3:
            continue
        frame = WallFrame(a[0], a[1], (b[0] - a[0]) / length, (b[1] - a[1]) / length)
        walls = _solid(frame, length, near)
        if walls == [(0.0, length)]:
            continue
        # The longest gap between its walls is the way through.
        ends = [0.0, *(x for pair in walls for x in pair), length]
        gaps = sorted(
            ((ends[k], ends[k + 1]) for k in range(0, len(ends), 2)), key=lambda g: g[0] - g[1]
        )
        low, high = gaps[0]
        if high - low < 0.7:
            continue
        middle = (low + high) / 2
        half = min(width, high - low) / 2
        reach = frame.rect((low + 0.1, 0.0, high - 0.1, 0.5))
        sides.append((reach, frame.rect((middle - half, 0.0, middle + half, BEFORE_DOOR_M))))
    return sides


def _seen_from(plan: Plan, opening: PlanOpening, polygon: Polygon) -> WallFrame | None:
    """The frame in the middle of an opening on the wall's face, v into the room."""
    wall = plan.walls[opening.wall]
    x, z = wall.at(opening.along)
    half = wall.thickness / 2
    is_vertical = abs(wall.end[0] - wall.start[0]) < abs(wall.end[1] - wall.start[1])
    for side in (1.0, -1.0):
        nx, nz = (side, 0.0) if is_vertical else (0.0, side)
        inner = box(*_rect_around_point((x + nx * (half + 0.05), z + nz * (half + 0.05))))
        if polygon.intersects(inner):
            # v is the normal: u = (nz, -nx).
            return WallFrame(x + nx * half, z + nz * half, nz, -nx)
    return None


def _window_of_opening(
    opening: PlanOpening, frame: WallFrame, walls: tuple[RoomWall, ...], depth: float
) -> Window:
    half = opening.width / 2
    number, low, high = -1, 0.0, 0.0
    for k, wall in enumerate(walls):
        f = wall.frame
        if (round(f.dx), round(f.dz)) != (round(frame.dx), round(frame.dz)):
            continue
        along = (frame.x - f.x) * f.dx + (frame.z - f.z) * f.dz
        across = -(frame.x - f.x) * f.dz + (frame.z - f.z) * f.dx
        if abs(across) < 0.05 and -half < along < wall.length + half:
            number, low, high = k, along - half, along + half
            break
    zone, tall_zone = (
        frame.rect((-half, 0.0, half, d)) for d in (depth, max(depth, _TALL_BEFORE_WINDOW_M))
    )
    return Window(zone, tall_zone, opening.sill, (frame.x, frame.z), number, low, high)
