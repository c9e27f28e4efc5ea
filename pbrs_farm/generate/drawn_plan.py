"""A floor plan by seed: programme, layout, walls, openings; some walls at other than right angles. No effects.

A slanted side of the outline and a bay window only add floor outside the drawn plan: no room shrinks, no opening
leaves its wall, and rectangular furnishing areas stay rectangular.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, PlanOpening, PlanWall, Point, RoomType
from pbrs_farm.generate.layout import Layout, layout
from pbrs_farm.generate.openings import openings_of, plan_faults
from pbrs_farm.generate.plan_families import PlanFamily
from pbrs_farm.generate.plan_walls import OUTER_M, rooms_of, runs_of, walls_of
from pbrs_farm.generate.programme import Programme, Wishes, drawn_programme, with_family

_PROGRAMMES: Final = 6  # programmes drawn and tried before the wish is refused


def drawn_plan(
    rng: np.random.Generator, wishes: Wishes | None = None, programme: Programme | None = None
) -> Plan:
    """A floor plan by seed, for a user's programme or drawn within wishes; BadInput if none fits."""
    if programme:
        plans = (wishes and wishes.plans) or programme.plans
        where = layout(replace(programme, plans=plans), rng, is_fixed=True)
        return plan_of_layout(where, drawn_height(where, rng), rng)
    where = _drawn_layout(rng, with_family(wishes or Wishes(), rng))
    plan = plan_of_layout(where, drawn_height(where, rng), rng)
    return with_slants(plan, where.programme.family, rng)


def drawn_height(where: Layout, rng: np.random.Generator) -> float:
    """From floor to ceiling, metres."""
    return float(rng.choice(where.programme.family.heights))


def plan_of_layout(where: Layout, height: float, rng: np.random.Generator) -> Plan:
    """Rooms, walls, doors and windows by seed on a layout's rectangles; a balcony comes on top."""
    runs = runs_of(where)
    walls = walls_of(where, runs)
    rooms = rooms_of(where, walls)
    all_rooms, all_walls, openings = openings_of(where, runs, walls, rooms, rng)
    return Plan(all_rooms, all_walls, openings, height, where.programme.plans)


def _drawn_layout(rng: np.random.Generator, wishes: Wishes) -> Layout:
    """Rectangles for a programme by seed; redraws the programme if it has no solution."""
    for _ in range(_PROGRAMMES):
        try:
            return layout(drawn_programme(rng, wishes), rng)
        except BadInput as error:
            refused = error
    raise refused


_SLANT_RAD: Final = (math.radians(5), math.radians(13))
_MOST_M: Final = 1.7  # maximum offset of a slanted side at its outer end, metres
_LESS: Final = (1.0, 0.75, 0.5)  # of that, tried until every room has its daylight
_BAY_DEPTH_M: Final = (0.5, 0.85)
_BAY_SPREAD: Final = (0.45, 1.0)  # how far a bay's sides spread, by its depth
_BESIDE_PANE_M: Final = 0.14  # of a bay's walls beside their windows
_LEAST_PANE_M: Final = 0.4
_FROM_CORNER_M: Final = 0.25  # from a bay to the end of its room's wall
_APART_M: Final = 0.2  # between openings of a wall
_BAYS: Final = (RoomType.LIVING, RoomType.STUDIO, RoomType.BEDROOM, RoomType.KITCHEN)
_EPSILON: Final = 1e-3


def with_slants(plan: Plan, family: PlanFamily, rng: np.random.Generator) -> Plan:
    """The plan of one storey with a slanted side, a bay, both or neither, as often as its family has them."""
    has_slant, has_bay = rng.random() < family.slanted, rng.random() < family.bay
    if has_slant:
        plan = _with_slanted_side(plan, rng)
    return _with_bay(plan, rng) if has_bay else plan


def _with_slanted_side(plan: Plan, rng: np.random.Generator) -> Plan:
    """Rotate one side of the outline outwards about an end; unchanged if no side is allowed."""
    sides = [(axis, outwards) for axis in (0, 1) for outwards in (-1, 1)]
    angle = float(rng.uniform(*_SLANT_RAD))
    for k in rng.permutation(len(sides)):
        axis, outwards = sides[int(k)]
        grows = bool(rng.random() < 0.5)
        for share in _LESS:
            slanted = _slanted(plan, axis, outwards, math.tan(angle) * share, grows=grows)
            if slanted is not None and not plan_faults(slanted):
                return slanted
    return plan


def _slanted(plan: Plan, axis: int, outwards: int, slope: float, *, grows: bool) -> Plan | None:
    """The plan with the side at an end of axis 0 (x) or 1 (z) slanted; None if a balcony is there."""
    walls = [w for w in plan.walls if w.is_outer and w.height is None]
    across = [p[axis] for w in walls for p in (w.start, w.end)]
    line = max(across) if outwards > 0 else min(across)
    rooms = [p[axis] for room in plan.rooms for p in room.polygon]
    if outwards * ((max(rooms) if outwards > 0 else min(rooms)) - line) > 0:
        return None
    along = [p[1 - axis] for w in walls for p in (w.start, w.end)]
    low, high = min(along), max(along)
    slope = min(slope, _MOST_M / (high - low))
    longer = math.hypot(1.0, slope)

    def moved(point: Point, inwards: float) -> Point:
        """Move a point from a distance `inwards` of the old centre line to the same distance of the new one."""
        if abs(point[axis] - (line - outwards * inwards)) > _EPSILON:
            return point
        far = point[1 - axis] - low if grows else high - point[1 - axis]
        new = round(line + outwards * (slope * far - inwards * longer), 4)
        return (new, point[1]) if axis == 0 else (point[0], new)

    new_walls = [replace(w, start=moved(w.start, 0.0), end=moved(w.end, 0.0)) for w in plan.walls]
    new_rooms = [
        replace(room, polygon=tuple(moved(p, OUTER_M / 2) for p in room.polygon))
        for room in plan.rooms
    ]
    openings = [
        replace(o, along=round(_along(o, plan.walls[o.wall], new_walls[o.wall]), 4))
        for o in plan.openings
    ]
    slanted = replace(
        plan, rooms=tuple(new_rooms), walls=tuple(new_walls), openings=tuple(openings)
    )
    return _relit(plan, slanted)


def _along(opening: PlanOpening, old: PlanWall, new: PlanWall) -> float:
    """Position of an opening on its wall after the wall was turned or extended at its start."""
    (x0, z0), (x1, z1) = new.start, new.end
    if min(abs(x1 - x0), abs(z1 - z0)) > _EPSILON:
        return opening.along * new.length / old.length
    return opening.along + math.dist(old.start, new.start)


def _relit(old: Plan, new: Plan) -> Plan:
    """The new plan with windows as much wider as their rooms are larger, where they may be."""
    openings = list(new.openings)
    for k, o in enumerate(openings):
        if o.kind not in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW):
            continue
        ratio = new.rooms[o.room].area / old.rooms[o.room].area
        wider = replace(o, width=round(math.ceil(o.width * ratio * 100 - 1e-6) / 100, 2))
        other_openings = [p for j, p in enumerate(openings) if j != k and p.wall == o.wall]
        if _fits(new, wider, other_openings):
            openings[k] = wider
    return replace(new, openings=tuple(openings))


def _fits(plan: Plan, opening: PlanOpening, openings: Sequence[PlanOpening]) -> bool:
    """True if an opening is within its room's side, clear of corners and of other openings."""
    wall, room = plan.walls[opening.wall], plan.rooms[opening.room]
    half = opening.width / 2
    if any(abs(p.along - opening.along) < half + p.width / 2 + _APART_M for p in openings):
        return False
    nx, nz = wall.normal
    away = wall.thickness / 2 + 0.02
    ends = [wall.at(opening.along + side * (half + _BESIDE_PANE_M)) for side in (-1, 1)]
    return any(
        all(room.contains((x + by * nx, z + by * nz)) for x, z in ends) for by in (-away, away)
    )


def _with_bay(plan: Plan, rng: np.random.Generator) -> Plan:
    """Add a bay to one window of a living area; unchanged if there is no space."""
    depth = float(rng.uniform(*_BAY_DEPTH_M))
    spread = depth * float(rng.uniform(*_BAY_SPREAD))
    for k in rng.permutation(len(plan.openings)):
        opening = plan.openings[int(k)]
        wall = plan.walls[opening.wall]
        if (
            opening.kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)
            and opening.other is None
            and plan.rooms[opening.room].type in _BAYS
            and wall.is_outer
            and _is_level(wall)
        ):
            with_bay = _bay(plan, int(k), depth, spread)
            if with_bay is not None:
                return with_bay
    return plan


def _is_level(wall: PlanWall) -> bool:
    return wall.start[0] == wall.end[0] or wall.start[1] == wall.end[1]


def _bay(plan: Plan, number: int, depth: float, spread: float) -> Plan | None:
    """The plan with a bay before an opening, its mouth wider than its front by spread; None without room."""
    opening = plan.openings[number]
    wall, room = plan.walls[opening.wall], plan.rooms[opening.room]
    half = opening.width / 2 + _BESIDE_PANE_M + wall.thickness / 2
    low, high = opening.along - half - spread, opening.along + half + spread
    mouth = replace(opening, width=high - low)
    nearby = [o for k, o in enumerate(plan.openings) if k != number and o.wall == opening.wall]
    clear = replace(mouth, width=mouth.width + 2 * (_FROM_CORNER_M - _BESIDE_PANE_M))
    if low < 0 or high > wall.length or not _fits(plan, clear, nearby):
        return None
    # The side of the wall that the room is not on.
    nx, nz = wall.normal
    x, z = wall.at(opening.along)
    away = wall.thickness / 2 + 0.05
    side = -1 if room.contains((x + nx * away, z + nz * away)) else 1

    def out(along: float, by: float) -> Point:
        px, pz = wall.at(along)
        return round(px + side * by * nx, 4), round(pz + side * by * nz, 4)

    ring = [out(low, 0.0), out(low + spread, depth), out(high - spread, depth), out(high, 0.0)]
    ground = Polygon(ring).buffer(wall.thickness, join_style="mitre")
    elsewhere = [r for k, r in enumerate(plan.rooms) if k != opening.room]
    if any(ground.intersects(Polygon(r.polygon)) for r in elsewhere):
        return None
    inner = _inner_faces([wall.start, *ring, wall.end], wall.thickness / 2 * (-side))
    polygon = _with_corners(room.polygon, inner)
    if polygon is None:
        return None
    first = len(plan.walls)
    sides = [PlanWall(a, b, wall.thickness, is_outer=True) for a, b in pairwise(ring)]
    walls = [*plan.walls, replace(wall, start=ring[3]), *sides]
    walls[opening.wall] = replace(wall, end=ring[0])
    openings = [
        replace(o, wall=first, along=round(o.along - high, 4))
        if o.wall == opening.wall and o.along > high
        else o
        for o in plan.openings
    ]
    openings[number] = replace(opening, wall=first + 2, along=round(sides[1].length / 2, 4))
    # Where a pane fits into the bay's sides it has one there, too.
    pane = math.floor((sides[0].length - wall.thickness - 2 * _BESIDE_PANE_M) * 100) / 100
    if pane >= _LEAST_PANE_M:
        openings += [
            replace(opening, wall=first + k, along=round(sides[0].length / 2, 4), width=pane)
            for k in (1, 3)
        ]
    rooms = [
        replace(r, polygon=polygon) if k == opening.room else r for k, r in enumerate(plan.rooms)
    ]
    return replace(plan, rooms=tuple(rooms), walls=tuple(walls), openings=tuple(openings))


def _inner_faces(line: Sequence[Point], by: float) -> list[Point]:
    """The inner corners of a line of points, moved to the right of it by `by` metres, mitred."""
    points = []
    for a, b, c in zip(line, line[1:], line[2:], strict=False):
        (ux, uz), (vx, vz) = _direction(a, b), _direction(b, c)
        # The mitre halves the turn: as long as keeps both faces `by` away.
        mx, mz = -uz - vz, ux + vx
        scale = 2 * by / (mx * mx + mz * mz)
        points.append((round(b[0] + mx * scale, 4), round(b[1] + mz * scale, 4)))
    return points


def _direction(a: Point, b: Point) -> Point:
    length = math.dist(a, b)
    return (b[0] - a[0]) / length, (b[1] - a[1]) / length


def _with_corners(polygon: Sequence[Point], inner: Sequence[Point]) -> tuple[Point, ...] | None:
    """A room's polygon that follows the points instead of the side on which both ends lie; None without one."""
    for k, a in enumerate(polygon):
        b = polygon[(k + 1) % len(polygon)]
        if all(_lies_between(p, a, b) for p in (inner[0], inner[-1])):
            is_along = math.dist(a, inner[0]) < math.dist(a, inner[-1])
            new = inner if is_along else inner[::-1]
            return (*polygon[: k + 1], *new, *polygon[k + 1 :])
    return None


def _lies_between(p: Point, a: Point, b: Point) -> bool:
    return math.dist(a, p) + math.dist(p, b) < math.dist(a, b) + _EPSILON
