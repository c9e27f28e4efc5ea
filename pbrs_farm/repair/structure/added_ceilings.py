"""Ceilings over rooms that have walls and none, and undersides of floors as ceilings; no effects.

A roofless storey is closed at the height of its walls: level, or sloped as their tops are. Rooms
outdoors, rooms whose edge is mostly free, stairs that lead on, and voids whose ceiling is a storey
higher stay open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Bools, Points2
from pbrs_farm.core.classes import CEILING
from pbrs_farm.core.house import House, Item, ItemKind, Material, Room, Surface, corners_of_surfaces
from pbrs_farm.geometry.plan_surfaces import counter_clockwise
from pbrs_farm.geometry.roofs import level_or_sloped
from pbrs_farm.home.room_use import is_outdoors
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.prisms import polygons_of

ADDED_CEILING: Final = "added-ceiling"
"""Tag of ceilings that repair adds."""

MIN_WALL_HEIGHT_M: Final = 1.8  # a lower wall is a parapet: it bounds no room
_BESIDE_M: Final = 0.3  # a wall farther from a room's edge does not bound it
_WALLED: Final = 0.75  # a room is closed only where this share of its edge has walls or other rooms
_STEP_M: Final = 0.25  # spacing of the samples of a room's edge
_TIE_M: Final = 0.01  # distances that differ by less are equal
_FLAT_M: Final = 0.05  # wall tops that differ by less count as one height
_BEND_M: Final = 0.01  # smaller bends of a sloped ceiling are left out
MIN_HOLE_M2: Final = 0.05  # a smaller hole is a gap in the drawing
MAX_STOREY_GAP_M: Final = 0.8  # thickest floor between two storeys
_OVERLAP: Final = 0.1  # share of a room that a floor above must cover to lower its ceiling
_SLAB_M: Final = 0.12  # below a floor without thickness: its slab, and a little
_APART_M: Final = 0.005  # below a floor that is a solid
_MOST_EDGES: Final = 20_000  # of the walls around a room; of more the tallest count
MAX_UNDERSIDE_NORMAL_Y: Final = -0.7  # y of the normal of an underside, at most


class _Cover(NamedTuple):
    """A floor or ceiling over some rooms."""

    area: plan.Shape
    low_y: float
    is_ceiling: bool
    is_sheet: bool  # repair makes a slab of it, downwards of a floor

    @property
    def under_y(self) -> float:
        """Where a ceiling below it may lie."""
        return self.low_y - (_SLAB_M if self.is_sheet else _APART_M)


def with_ceilings(house: House) -> House:
    """Add a ceiling, tagged ADDED_CEILING, over the open area of every walled room without one."""
    if all(room.has_ceiling for room in house.rooms):
        return house
    covers = [
        cover_of_surfaces(i) for i in house.items if i.kind in (ItemKind.FLOOR, ItemKind.CEILING)
    ]
    ceilings: list[Item] = []
    closed: dict[str, Room] = {}
    # From the top storey down: a ceiling just added also covers rooms below it.
    for room in sorted(house.rooms, key=lambda r: -r.floor_y):
        ceiling = None if room.has_ceiling or is_outdoors(room) else _closed(room, house, covers)
        if ceiling is None:
            continue
        surface, closed[room.id] = ceiling
        ceilings.append(
            Item(
                id=f"added_ceiling_{room.id}",
                name=f"Ceiling of {room.name or 'room ' + room.id}",
                kind=ItemKind.CEILING,
                level_id=room.level_id,
                surfaces=(surface,),
                nyu40=CEILING,
                source_class="ceiling",
                room_id=room.id,
                tags=(ADDED_CEILING,),
            )
        )
        covers.append(cover_of_surfaces(ceilings[-1]))
    if not ceilings:
        return house
    return replace(
        house,
        rooms=tuple(closed.get(r.id, r) for r in house.rooms),
        items=(*house.items, *reversed(ceilings)),
        materials=(*house.materials, Material("added ceiling", diffuse=(0.93, 0.93, 0.93))),
    )


def rooms_with_added_ceilings(house: House) -> tuple[str, ...]:
    """Ids of the rooms that with_ceilings closed."""
    return tuple(i.room_id or "" for i in house.items if ADDED_CEILING in i.tags)


def cover_of_surfaces(item: Item) -> _Cover:
    shapes = [plan.polygon_of_triangles(s.positions.astype(float), s.faces) for s in item.surfaces]
    low_y, high_y = item.bounds[:, 1].tolist()  # NaN of an item without vertices
    is_ceiling = item.kind is ItemKind.CEILING
    return _Cover(plan.union(shapes), low_y, is_ceiling, is_sheet=high_y - low_y < _APART_M)


def _closed(room: Room, house: House, covers: Sequence[_Cover]) -> tuple[Surface, Room] | None:
    """The ceiling that a room lacks, and the room with it; None where it needs none."""
    area = plan.polygon_of_room(room.polygon)
    walls = _WallTops(room, house.items)
    ring = np.concatenate([_stepped(p)[0] for p in polygons_of(area)] or [np.zeros((0, 2))])
    tops = walls.at(ring)
    has_wall = np.isfinite(tops)
    if not has_wall.any() or (has_wall | _beside_rooms(ring, room, house.rooms)).mean() < _WALLED:
        return None
    is_below = any(r.floor_y > room.floor_y + MIN_WALL_HEIGHT_M for r in house.rooms)
    level_y = min(float(np.median(tops[has_wall])), _under_floors(area, room, covers))
    is_level = is_below or float(np.ptp(tops[has_wall])) < _FLAT_M
    bare = plan.opened(_bare(area, room, level_y, house, covers, is_below=is_below), _STEP_M / 2)
    parts, heights = [], []
    for polygon in polygons_of(bare, min_area_m2=MIN_HOLE_M2):
        rings = [np.asarray(r.coords)[:-1] for r in (polygon.exterior, *polygon.interiors)]
        if is_level:
            bent = [(counter_clockwise(r), np.full(len(r), level_y)) for r in rings]
        else:
            bent = [_bent(r, walls, level_y) for r in rings]
        parts.append([points for points, _y in bent])
        heights.append(np.concatenate([y for _points, y in bent]))
    if not parts:
        return None
    surface = level_or_sloped("ceiling", parts, heights, len(house.materials))
    top_y = float(np.concatenate(heights).max())
    return surface, replace(room, has_ceiling=True, ceiling_y=top_y)


def _under_floors(area: plan.Shape, room: Room, covers: Sequence[_Cover]) -> float:
    """y below the floors of the storey above; inf without any."""
    floors = [c for c in covers if not c.is_ceiling and c.low_y > room.floor_y + MIN_WALL_HEIGHT_M]
    near = [c for c in floors if plan.common(area, c.area).area > _OVERLAP * area.area]
    return min((c.under_y for c in near), default=np.inf)


def _bare(
    area: plan.Shape,
    room: Room,
    level_y: float,
    house: House,
    covers: Sequence[_Cover],
    *,
    is_below: bool,
) -> plan.Shape:
    """The part of a room without stairs, and without a ceiling or one at the top of a void."""
    above = [c for c in covers if c.low_y > room.floor_y + MIN_WALL_HEIGHT_M / 2]
    ceilings = [c.area for c in above if c.is_ceiling and c.low_y < level_y + MAX_STOREY_GAP_M]
    floors = plan.union(
        c.area for c in above if not c.is_ceiling and c.low_y < level_y + MAX_STOREY_GAP_M
    )
    high = plan.union(c.area for c in above if c.is_ceiling)
    stairs = [
        shapely.box(low[0], low[2], high[0], high[2])
        for low, high in (i.bounds for i in house.items if i.kind is ItemKind.STAIRS)
        if is_below and low[1] < level_y - MIN_WALL_HEIGHT_M / 2 and high[1] > level_y - _BESIDE_M
    ]
    roofs = [_roof(i) for i in house.items if _is_roof(i, room, area)]
    return plan.without(area, *ceilings, plan.without(high, floors), *stairs, *roofs)


def _is_roof(item: Item, room: Room, area: plan.Shape) -> bool:
    """Whether a piece of furniture is drawn as a roof over the whole room."""
    if item.kind is not ItemKind.OBJECT or not item.n_faces:
        return False
    low, high = item.bounds
    is_high = low[1] > room.floor_y + 1.0 and high[1] > room.ceiling_y
    box = shapely.box(low[0], low[2], high[0], high[2])
    return bool(is_high and plan.common(area, box).area > 0.5 * area.area)


def _roof(item: Item) -> plan.Shape:
    return cover_of_surfaces(item).area


def _beside_rooms(points: F64, room: Room, rooms: Sequence[Room]) -> Bools:
    """Whether points (N, 2) lie beside another room of the same storey."""
    is_beside = np.zeros(len(points), np.bool_)
    for neighbour in rooms:
        if neighbour is not room and abs(neighbour.floor_y - room.floor_y) < MIN_WALL_HEIGHT_M / 2:
            near = plan.grown(plan.polygon_of_room(neighbour.polygon), _BESIDE_M)
            is_beside |= shapely.contains_xy(near, points[:, 0], points[:, 1])
    return is_beside


class _WallTops:
    """The upper edges of the walls of a room's storey."""

    def __init__(self, room: Room, items: Sequence[Item]) -> None:
        self._walls: list[F64] = []  # (E, 2, 3) edges of each wall
        low, high = room.polygon.min(0) - 2 * _BESIDE_M, room.polygon.max(0) + 2 * _BESIDE_M
        for item in items:
            if item.kind is not ItemKind.WALL or item.level_id != room.level_id:
                continue
            corners = corners_of_surfaces(item.surfaces)
            edges = corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3)
            ends = edges[:, :, [0, 2]]
            # Keep walls near the room and high enough.
            near = (ends.max(1) > low).all(1) & (ends.min(1) < high).all(1)
            edges = edges[near & (edges[:, :, 1].max(1) > room.floor_y + MIN_WALL_HEIGHT_M)]
            order = np.argsort(-edges[:, :, 1].max(1), kind="stable")[:_MOST_EDGES]
            if len(edges):
                self._walls.append(edges[order])

    def at(self, points: Points2) -> F64:
        """(N,) y of the top of the nearest wall at plan points (N, 2); NaN where none is near."""
        nearest, tops = np.full(len(points), np.inf), np.full(len(points), np.nan)
        for edges in self._walls:
            away, y = _nearest_tops(points, edges)
            # Of walls equally near the lowest counts, so that none ends below the ceiling.
            is_tie = np.abs(away - nearest) < _TIE_M
            tops = np.where(is_tie, np.fmin(tops, y), np.where(away < nearest - _TIE_M, y, tops))
            nearest = np.minimum(nearest, away)
        return np.where(nearest < _BESIDE_M, tops, np.nan)


def _nearest_tops(points: Points2, edges: F64) -> tuple[F64, F64]:
    """Distance from each point to the walls' edges in plan, and the highest of the nearest there."""
    away, tops = np.empty(len(points)), np.empty(len(points))
    a, d = edges[:, 0], edges[:, 1] - edges[:, 0]
    length2 = np.maximum((d[:, [0, 2]] ** 2).sum(1), 1e-18)
    for k, point in enumerate(points):
        t = np.clip(((point - a[:, [0, 2]]) * d[:, [0, 2]]).sum(1) / length2, 0, 1)
        gap = np.linalg.norm(a[:, [0, 2]] + t[:, None] * d[:, [0, 2]] - point, axis=1)
        away[k] = gap.min()
        tops[k] = (a[:, 1] + t * d[:, 1])[gap < away[k] + 1e-3].max()
    return away, tops


def _stepped(polygon: shapely.Polygon) -> tuple[F64, Bools]:
    """Points of a polygon's outline, corners and places between, and which are corners."""
    return _stepped_ring(np.asarray(polygon.exterior.coords)[:-1])


def _stepped_ring(ring: Points2) -> tuple[F64, Bools]:
    points, is_corner = [], []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        n = max(int(np.ceil(np.linalg.norm(b - a) / _STEP_M)), 1)
        points.append(a + np.arange(n)[:, None] / n * (b - a))
        is_corner.append(np.arange(n) == 0)
    return np.concatenate(points), np.concatenate(is_corner)


def _bent(ring: Points2, walls: _WallTops, otherwise: float) -> tuple[Points2, F64]:
    """The ring with the points at which the tops of the walls along it bend, and their heights."""
    points, is_corner = _stepped_ring(counter_clockwise(ring))
    tops = walls.at(points)
    is_known = np.isfinite(tops)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if is_known.any():
        round_ = float(way[-1] + np.linalg.norm(points[0] - points[-1]))
        tops = np.interp(way, way[is_known], tops[is_known], period=round_)
    else:
        tops = np.full(len(points), otherwise)
    # Of the places between two corners keep those that lie off the straight line.
    keep = is_corner.copy()
    corners = [*np.flatnonzero(is_corner).tolist(), len(points)]
    for start, end in pairwise(corners):
        numbers = np.arange(start, end + 1)
        line = np.column_stack([np.arange(len(numbers)) * _STEP_M, tops[numbers % len(points)]])
        bends = shapely.get_coordinates(shapely.simplify(shapely.LineString(line), _BEND_M))
        keep[(start + np.rint(bends[:, 0] / _STEP_M).astype(int)) % len(points)] = True
    return points[keep], tops[keep]
