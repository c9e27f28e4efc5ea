"""Rectangles become walls and room polygons; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, groupby, pairwise, product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon, box
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from pbrs_farm.generate.floor_plan import PlanRoom, PlanWall, Point, Rect, RoomType
from pbrs_farm.generate.layout import Layout
from pbrs_farm.generate.slicing_goals import STEP_M

OUTSIDE: Final = -1
OUTER_M, WET_M, INNER_M, PARAPET_M = 0.26, 0.16, 0.075, 0.10  # thickness, as people draw them
PARAPET_HEIGHT_M: Final = 1.0
BALCONY_DEPTH_M: Final = 1.5


@dataclass(frozen=True, slots=True)
class WallRun:
    """A straight stretch between the same two neighbours, on a line of the grid; in steps."""

    is_vertical: bool
    line: int  # x of a vertical run, z of the others
    low: int
    high: int
    before: int  # room on the side of smaller x or z, OUTSIDE for none
    after: int

    @property
    def rooms(self) -> frozenset[int]:
        """Both neighbours."""
        return frozenset((self.before, self.after))

    @property
    def length(self) -> float:
        """Metres."""
        return (self.high - self.low) * STEP_M

    def point(self, along: float) -> Point:
        """The point `along` steps on the grid's axis."""
        across, lengthwise = self.line * STEP_M, along * STEP_M
        return (across, lengthwise) if self.is_vertical else (lengthwise, across)


def runs_of(layout: Layout) -> list[WallRun]:
    """Every stretch between the same two neighbours, outside included, in a fixed order for the draws."""
    # Paint the owners on the grid, with a rim of outside.
    owner = np.full((layout.depth + 2, layout.width + 2), OUTSIDE, np.int32)
    for number, parts in enumerate(layout.parts):
        for x0, z0, x1, z1 in parts:
            owner[z0 + 1 : z1 + 1, x0 + 1 : x1 + 1] = number
    runs = []
    for is_vertical, cells in ((True, owner.T), (False, owner)):
        for line in range(len(cells) - 1):
            runs += _runs_on_line(cells[line], cells[line + 1], line, is_vertical)
    return runs


def _runs_on_line(
    before: NDArray[np.int32], after: NDArray[np.int32], line: int, is_vertical: bool
) -> list[WallRun]:
    # The rim shifts cells by one: cell k is between the coordinates k - 1 and k.
    runs, start = [], 0
    for (a, b), group in groupby(zip(before.tolist(), after.tolist(), strict=True)):
        stop = start + len(list(group))
        if a != b:
            runs.append(WallRun(is_vertical, line, start - 1, stop - 1, a, b))
        start = stop
    return runs


def thickness(run: WallRun, types: list[RoomType]) -> float:
    """Of the wall on a run, metres."""
    if OUTSIDE in run.rooms:
        return OUTER_M
    return WET_M if any(types[r].is_wet for r in run.rooms) else INNER_M


def walls_of(layout: Layout, runs: list[WallRun]) -> tuple[PlanWall, ...]:
    """Merge collinear runs of equal thickness into walls; open sides get none."""
    types = [wish.type for wish in layout.programme.rooms]
    is_open = open_pairs(layout)
    standing = [(r, thickness(r, types)) for r in runs if r.rooms not in is_open]
    standing.sort(key=lambda item: (item[0].is_vertical, item[0].line, item[1], item[0].low))
    # Join what continues in a line.
    walls: list[PlanWall] = []
    last: WallRun | None = None
    for run, thick in standing:
        start, end = run.point(run.low), run.point(run.high)
        continues = last is not None and (last.is_vertical, last.line, last.high) == (
            run.is_vertical,
            run.line,
            run.low,
        )
        if continues and walls[-1].thickness == thick:
            start = walls.pop().start
        walls.append(PlanWall(start, end, thick, OUTSIDE in run.rooms))
        last = run
    return tuple(walls)


def open_pairs(layout: Layout) -> frozenset[frozenset[int]]:
    """Each two rooms without a wall between: an open kitchen, stairs and their hall."""
    types = [wish.type for wish in layout.programme.rooms]
    pairs = []
    if layout.programme.open_kitchen and RoomType.KITCHEN in types:
        living = next(i for i, t in enumerate(types) if t in (RoomType.LIVING, RoomType.STUDIO))
        pairs.append(frozenset((living, types.index(RoomType.KITCHEN))))
    if RoomType.STAIRS in types:
        pairs.append(frozenset((types.index(RoomType.HALL), types.index(RoomType.STAIRS))))
    return frozenset(pairs)


def rooms_of(layout: Layout, walls: tuple[PlanWall, ...]) -> tuple[PlanRoom, ...]:
    """The rooms: their rectangles minus the walls' ground, the largest part of each."""
    ground = unary_union([Polygon(wall.corners()) for wall in walls])
    count: dict[RoomType, int] = {}
    types = [wish.type for wish in layout.programme.rooms]
    rooms = []
    for wish, parts in zip(layout.programme.rooms, layout.parts, strict=True):
        rects = [
            box(x0 * STEP_M, z0 * STEP_M, x1 * STEP_M, z1 * STEP_M) for x0, z0, x1, z1 in parts
        ]
        polygon = unary_union(rects).difference(ground)
        # Number unnamed rooms of one type: "bedroom 2".
        count[wish.type] = count.get(wish.type, 0) + 1
        name = wish.name or wish.type.label
        if not wish.name and types.count(wish.type) > 1:
            name = f"{name} {count[wish.type]}"
        rooms.append(PlanRoom(wish.type, name, corners(polygon)))
    return tuple(rooms)


def corners(shape: BaseGeometry) -> tuple[Point, ...]:
    """Corners of a shape's largest part, anticlockwise, to a tenth of a millimetre, without holes; or ()."""
    if isinstance(shape, MultiPolygon):
        shape = max(shape.geoms, key=lambda part: part.area)
    simple = shape.simplify(1e-6)
    if not isinstance(simple, Polygon) or simple.is_empty:
        return ()
    ring = list(simple.exterior.normalize().coords)[:-1]
    points = [(round(x, 4), round(z, 4)) for x, z in ring]
    # Leave out all but one of those at one place: beside itself no corner turns, and it would go.
    points = [p for i, p in enumerate(points) if p != points[i - 1]]
    # Drop collinear points.
    bends = [
        p
        for i, p in enumerate(points)
        if abs(_turn(points[i - 1], p, points[(i + 1) % len(points)])) > 1e-6
    ]
    # The shoelace sum is positive for a ring that runs anticlockwise.
    area = sum(_turn((0.0, 0.0), a, b) for a, b in zip(bends, bends[1:] + bends[:1], strict=True))
    return tuple(bends if area > 0 else bends[::-1])


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def largest_rectangle(polygon: Polygon) -> Rect:
    """The largest axis-aligned rectangle inside a rectilinear polygon of few corners, else its bounds."""
    points = list(polygon.exterior.coords)
    xs, zs = sorted({p[0] for p in points}), sorted({p[1] for p in points})
    x0, z0, x1, z1 = polygon.bounds
    best, largest = (x0, z0, x1, z1), 0.0
    inside = polygon.buffer(1e-6)
    # Its sides lie on lines through corners: try all pairs of them.
    for (xa, xb), (za, zb) in product(combinations(xs, 2), combinations(zs, 2)):
        area = (xb - xa) * (zb - za)
        if area > largest and inside.contains(box(xa, za, xb, zb)):
            largest, best = area, (xa, za, xb, zb)
    return best


def balcony(run: WallRun, low: float, high: float) -> tuple[PlanRoom, tuple[PlanWall, ...]]:
    """A balcony's room and parapet before the outer run, between low and high on its axis, metres."""
    outwards = -1.0 if run.before == OUTSIDE else 1.0
    face = run.line * STEP_M + outwards * OUTER_M / 2
    rim = face + outwards * BALCONY_DEPTH_M

    def point(across: float, along: float) -> Point:
        return (across, along) if run.is_vertical else (along, across)

    half = PARAPET_M / 2
    # The parapet: out, along and back, its ends in the wall's face.
    ends = [
        point(face, low + half),
        point(rim - outwards * half, low + half),
        point(rim - outwards * half, high - half),
        point(face, high - half),
    ]
    parapet = tuple(
        PlanWall(a, b, PARAPET_M, is_outer=True, height=PARAPET_HEIGHT_M) for a, b in pairwise(ends)
    )
    xs, zs = zip(
        point(face, low + PARAPET_M),
        point(rim - outwards * PARAPET_M, high - PARAPET_M),
        strict=True,
    )
    floor = box(min(xs), min(zs), max(xs), max(zs))
    return PlanRoom(RoomType.BALCONY, RoomType.BALCONY.label, corners(floor)), parapet
