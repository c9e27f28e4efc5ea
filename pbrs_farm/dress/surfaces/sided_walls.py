"""Which room each part of a wall's surface faces: a wall has two sides, a long one many rooms; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, Room
from pbrs_farm.core.mesh import area_vectors, edges_are_paired
from pbrs_farm.dress.surfaces.cut_triangles import Ints

_STEP_M = 0.04  # spacing of the places along a side at which a room is looked for
_BEFORE_M = (0.03, 0.08, 0.15)  # distances before the side at which a room is looked for
_SAME_PLANE_M = 0.003
_LEAST_RUN_M = 0.03
_LEAST_HEIGHT_M = 0.1  # least overlap in height of a room and a side


@dataclass(frozen=True, slots=True)
class SideRun:
    """A stretch of a side before one room."""

    room: int | None  # index into House.rooms, None = outdoors or inside another wall
    start: float  # metres along the side
    end: float


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """The triangles of a wall that lie in one upright plane and look one way."""

    along: F64  # (3,) unit, to the right of who looks at it
    normal: F64  # (3,) unit, horizontal
    offset: float  # of the plane along its normal
    low_y: float
    high_y: float
    runs: tuple[SideRun, ...]

    @property
    def area(self) -> float:
        """Of its bounds, m2."""
        return (self.high_y - self.low_y) * sum(r.end - r.start for r in self.runs)


@dataclass(frozen=True, slots=True, eq=False)
class SidedWall:
    """A wall as triangles that know their surface and side."""

    rows: F64  # (F, 3, 8) corners: metres, normals or zeros, uv or zeros
    surface: Ints  # (F,) index into Item.surfaces
    side: Ints  # (F,) index into sides, -1 = horizontal
    sides: tuple[Side, ...]
    is_closed: bool


@dataclass(frozen=True, slots=True, eq=False)
class RoomFinder:
    """Rooms by place; where two overlap the smaller one counts."""

    rooms: Sequence[Room]
    areas: Sequence[BaseGeometry]
    order: list[int] = field(init=False)

    def __post_init__(self) -> None:
        order = sorted(range(len(self.rooms)), key=lambda k: (self.areas[k].area, k))
        object.__setattr__(self, "order", order)
        for area in self.areas:
            shapely.prepare(area)

    def at(self, places: F64, low_y: float, high_y: float) -> Ints:
        """(N,) index of the room at plan places (N, 2) that shares heights low_y..high_y; -1 none."""
        room_index = np.full(len(places), -1, np.int64)
        for k in self.order:
            room = self.rooms[k]
            shared = min(high_y, room.ceiling_y) - max(low_y, room.floor_y)
            if shared < min(_LEAST_HEIGHT_M, 0.5 * (high_y - low_y)):
                continue
            if not (room_index < 0).any():
                break
            inside = shapely.contains_xy(self.areas[k], places[:, 0], places[:, 1])
            room_index[(room_index < 0) & inside] = k
        return room_index


def sided_wall(wall: Item, finder: RoomFinder) -> SidedWall:
    """The wall's triangles with their sides and the rooms that the sides face."""
    rows, surface = _rows_of_wall(wall)
    vectors = area_vectors(rows[..., :3])
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, 1e-12)[:, None]
    side = np.full(len(rows), -1, np.int64)
    sides: list[Side] = []
    # Start each plane with the largest unassigned triangle.
    for first in np.argsort(-areas, kind="stable"):
        if side[first] >= 0 or areas[first] < 1e-6 or abs(normals[first, 1]) > 0.05:
            continue
        normal = normals[first] * [1, 0, 1]
        normal = normal / np.linalg.norm(normal)
        offset = float(rows[first, 0, :3] @ normal)
        off = np.abs(rows[..., :3] @ normal - offset).max(1)
        members = (side < 0) & (off < _SAME_PLANE_M) & (normals @ normal > 0.995)
        members[first] = True
        side[members] = len(sides)
        sides.append(_side_of_plane(rows[members][..., :3], normal, offset, finder))
    _, places = np.unique(rows[..., :3].reshape(-1, 3), axis=0, return_inverse=True)
    is_closed = edges_are_paired(np.ravel(places).reshape(-1, 3)) if len(rows) else False
    return SidedWall(rows, surface, side, tuple(sides), is_closed)


def _rows_of_wall(wall: Item) -> tuple[F64, Ints]:
    parts, numbers = [np.zeros((0, 3, 8))], [np.zeros(0, np.int64)]
    for k, s in enumerate(wall.surfaces):
        normals = np.zeros_like(s.positions) if s.normals is None else s.normals
        uvs = np.zeros((len(s.positions), 2)) if s.uvs is None else s.uvs
        rows = np.concatenate([s.positions, normals, uvs], 1).astype(np.float64)[s.faces]
        parts.append(rows)
        numbers.append(np.full(len(rows), k, np.int64))
    return np.concatenate(parts), np.concatenate(numbers)


def _side_of_plane(corners: F64, normal: F64, offset: float, finder: RoomFinder) -> Side:
    along = np.array([normal[2], 0.0, -normal[0]])
    s, y = corners @ along, corners[..., 1]
    low, high = float(s.min()), float(s.max())
    low_y, high_y = float(y.min()), float(y.max())
    # Look for rooms before the middle of each step.
    n = max(1, round((high - low) / _STEP_M))
    middles = low + (np.arange(n) + 0.5) * (high - low) / n
    room_index = np.full(n, -1, np.int64)
    for out_m in _BEFORE_M:
        points = middles[:, None] * along + (offset + out_m) * normal
        rooms_here = finder.at(points[:, [0, 2]], low_y, high_y)
        room_index = np.where(room_index < 0, rooms_here, room_index)
    return Side(along, normal, offset, low_y, high_y, _runs_of_rooms(room_index, low, high))


def _runs_of_rooms(found: Ints, low: float, high: float) -> tuple[SideRun, ...]:
    """Runs of one room; stretches between or beside rooms are divided between them."""
    if (found < 0).all():
        return (SideRun(None, low, high),)
    step = (high - low) / len(found)
    indices = np.flatnonzero(found >= 0)
    # Give each step the nearest step's room; a long stretch outdoors stays outdoors.
    nearest = indices[np.abs(np.arange(len(found))[:, None] - indices[None]).argmin(1)]
    far = np.abs(np.arange(len(found)) - nearest) * step > 0.6
    rooms = np.where(far, -1, found[nearest])
    edges = [0, *(np.flatnonzero(np.diff(rooms)) + 1).tolist(), len(rooms)]
    runs: list[SideRun] = []
    for a, b in pairwise(edges):
        run = SideRun(None if rooms[a] < 0 else int(rooms[a]), low + a * step, low + b * step)
        # Leave slivers to the run before.
        if runs and run.end - run.start < _LEAST_RUN_M:
            runs[-1] = SideRun(runs[-1].room, runs[-1].start, run.end)
        else:
            runs.append(run)
    return tuple(runs)
