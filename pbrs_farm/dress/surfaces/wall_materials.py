"""Each room's material on the walls it sees: walls cut where rooms meet, uv in metres; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Item, Room, Surface
from pbrs_farm.core.mesh import area_vectors, edges_are_paired, unit_normals
from pbrs_farm.dress.textures.families import PatternMaterial

# Triangles cut by planes, so that a mesh stays closed: equal edges are cut at equal points.


_ON_PLANE_M = 1e-4  # corners nearer than this lie on the plane

_INTS = NDArray[np.int64]


def cut_triangles(rows: F64, normal: F64, offset: float) -> tuple[F64, _INTS]:
    """Triangles none of which crosses the plane x . normal = offset, and the parent of each.

    rows: (F, 3, K) corners whose first three columns are metres and the rest goes along. New
    points are float32 values, the same for both triangles of an edge. Order is kept.
    """
    d = rows[..., :3] @ normal - offset
    side = np.where(np.abs(d) < _ON_PLANE_M, 0, np.sign(d)).astype(int)
    crosses = (side.min(1) < 0) & (side.max(1) > 0)
    parts: list[F64] = []
    parents: list[int] = []
    for f in range(len(rows)):
        pieces = _cut(rows[f], side[f], d[f]) if crosses[f] else [rows[f]]
        parts += pieces
        parents += [f] * len(pieces)
    if not parts:
        return rows, np.zeros(0, np.int64)
    return np.stack(parts), np.array(parents, np.int64)


def _cut(triangle: F64, side: NDArray[np.int_], d: F64) -> list[F64]:
    # Walk round the triangle, add the points where it crosses, and keep either side as a fan.
    ring: list[tuple[F64, int]] = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        ring.append((triangle[a], int(side[a])))
        if side[a] * side[b] < 0:
            ring.append((_between(triangle[a], triangle[b], float(d[a]), float(d[b])), 0))
    pieces = []
    for keep in (1, -1):
        corners = [p for p, s in ring if s in (keep, 0)]
        pieces += [np.stack([corners[0], corners[k], corners[k + 1]]) for k in range(1, len(corners) - 1)]  # fmt: skip
    return pieces


def _between(a: F64, b: F64, da: float, db: float) -> F64:
    # Begin at the same end whichever triangle asks.
    if tuple(a[:3]) > tuple(b[:3]):
        a, b, da, db = b, a, db, da
    point = a + (b - a) * (da / (da - db))
    return np.concatenate([point[:3].astype(np.float32).astype(np.float64), point[3:]])


# Which room each part of a wall's surface faces: a wall has two sides, a long one many rooms.


_STEP_M = 0.04  # between the places along a side where a room is looked for
_BEFORE_M = (0.03, 0.08, 0.15)  # how far in front of the side
_SAME_PLANE_M = 0.003
_LEAST_RUN_M = 0.03
_LEAST_HEIGHT_M = 0.1  # that a room and a side must share


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
    surface: _INTS  # (F,) index into Item.surfaces
    side: _INTS  # (F,) index into sides, -1 = lies flat
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

    def at(self, places: F64, low_y: float, high_y: float) -> _INTS:
        """(N,) index of the room at plan places (N, 2) that shares heights low_y..high_y; -1 none."""
        found = np.full(len(places), -1, np.int64)
        for k in self.order:
            room = self.rooms[k]
            shared = min(high_y, room.ceiling_y) - max(low_y, room.floor_y)
            if shared < min(_LEAST_HEIGHT_M, 0.5 * (high_y - low_y)):
                continue
            if not (found < 0).any():
                break
            inside = shapely.contains_xy(self.areas[k], places[:, 0], places[:, 1])
            found[(found < 0) & inside] = k
        return found


def sided_wall(wall: Item, finder: RoomFinder) -> SidedWall:
    """The wall's triangles with their sides and the rooms that the sides face."""
    rows, surface = _rows(wall)
    vectors = area_vectors(rows[..., :3])
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, 1e-12)[:, None]
    side = np.full(len(rows), -1, np.int64)
    sides: list[Side] = []
    # Begin each plane with the largest triangle that has none.
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
        sides.append(_side(rows[members][..., :3], normal, offset, finder))
    _, places = np.unique(rows[..., :3].reshape(-1, 3), axis=0, return_inverse=True)
    is_closed = edges_are_paired(np.ravel(places).reshape(-1, 3)) if len(rows) else False
    return SidedWall(rows, surface, side, tuple(sides), is_closed)


def _rows(wall: Item) -> tuple[F64, _INTS]:
    parts, numbers = [np.zeros((0, 3, 8))], [np.zeros(0, np.int64)]
    for k, s in enumerate(wall.surfaces):
        normals = np.zeros_like(s.positions) if s.normals is None else s.normals
        uvs = np.zeros((len(s.positions), 2)) if s.uvs is None else s.uvs
        rows = np.concatenate([s.positions, normals, uvs], 1).astype(np.float64)[s.faces]
        parts.append(rows)
        numbers.append(np.full(len(rows), k, np.int64))
    return np.concatenate(parts), np.concatenate(numbers)


def _side(corners: F64, normal: F64, offset: float, finder: RoomFinder) -> Side:
    along = np.array([normal[2], 0.0, -normal[0]])
    s, y = corners @ along, corners[..., 1]
    low, high = float(s.min()), float(s.max())
    low_y, high_y = float(y.min()), float(y.max())
    # Look for rooms before the middle of each step.
    n = max(1, round((high - low) / _STEP_M))
    middles = low + (np.arange(n) + 0.5) * (high - low) / n
    found = np.full(n, -1, np.int64)
    for out_m in _BEFORE_M:
        points = middles[:, None] * along + (offset + out_m) * normal
        there = finder.at(points[:, [0, 2]], low_y, high_y)
        found = np.where(found < 0, there, found)
    return Side(along, normal, offset, low_y, high_y, _runs(found, low, high))


def _runs(found: _INTS, low: float, high: float) -> tuple[SideRun, ...]:
    """Runs of one room; what faces no room, but lies between or beside rooms, is shared out."""
    if (found < 0).all():
        return (SideRun(None, low, high),)
    step = (high - low) / len(found)
    known = np.flatnonzero(found >= 0)
    # Give each step the nearest step's room; a long stretch outdoors stays outdoors.
    nearest = known[np.abs(np.arange(len(found))[:, None] - known[None]).argmin(1)]
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


# Each room's material on the walls it sees.


REVEAL = "reveal"
"""Name of the faces by whose material repair paints the sides of openings."""

_LEVEL = 0.9  # |cosine| to the vertical of what lies flat
_LEAST_CUT_M = 0.02  # cuts nearer to a side's end than this are left out


@dataclass(frozen=True, slots=True)
class RoomWalls:
    """The materials of a stretch of wall that a room sees."""

    main: PatternMaterial
    floor_y: float  # where v begins
    low: PatternMaterial | None = None  # below low_y
    low_y: float = 0.0


@dataclass(frozen=True, slots=True)
class RestOfWall:
    """Numbers of the materials of what no room sees."""

    foot: int  # of faces that look down, which carry the name that repair paints reveals by
    flat: int  # of other level faces: tops of low walls


LooksOf = Mapping[tuple[int, int], RoomWalls]
"""What a wall's runs show, by side and run."""


@dataclass(frozen=True, slots=True, eq=False)
class _SidePart:
    # Triangles of one stretch that show one material.
    members: Bools  # (F,)
    material: PatternMaterial
    side: Side
    start: float  # u begins here
    floor_y: float  # and v here


def painted_wall(item: Item, wall: SidedWall, looks: LooksOf, rest: RestOfWall) -> Item:
    """The wall with the materials of its rooms; upright faces without a look keep their own and their uv."""
    rows, surface, side = wall.rows, wall.surface, wall.side
    # Cut the whole wall, so that it stays closed; what is no solid is painted by whole triangles.
    for normal, offset in _cuts(wall, looks) if wall.is_closed else ():
        rows, parents = cut_triangles(rows, normal, offset)
        surface, side = surface[parents], side[parents]
    found: list[Surface] = []
    left = np.ones(len(rows), bool)
    for part in _parts(rows, side, wall, looks):
        left &= ~part.members
        for n in np.unique(surface[part.members]).tolist():
            mine = rows[part.members & (surface == n)]
            found.append(_surface(item.surfaces[n].name, part.material.number, _in_metres(mine, part)))  # fmt: skip
    # Level faces are of plaster; what else is left stays as it is.
    height = unit_normals(rows[..., :3])[:, 1]
    for mine, name, material in (
        (left & (height < -_LEVEL), REVEAL, rest.foot),
        (left & (height > _LEVEL), "top", rest.flat),
    ):
        left &= ~mine
        if mine.any():
            found.append(_surface(name, material, rows[mine]))
    for n, source in enumerate(item.surfaces):
        mine = left & (surface == n)
        if mine.any():
            found.append(_surface(source.name, source.material, rows[mine]))
    return replace(item, surfaces=tuple(found))


def _cuts(wall: SidedWall, looks: LooksOf) -> Iterator[tuple[F64, float]]:
    """Normal and offset of the planes between runs, and level ones where the low material ends."""
    levels: list[float] = []
    for k, side in enumerate(wall.sides):
        for r, run in enumerate(side.runs):
            look = looks.get((k, r))
            if look is not None and look.low is not None:
                levels.append(look.low_y)
            other = looks.get((k, r - 1)) if r else look
            ends = side.runs[0].start + _LEAST_CUT_M, side.runs[-1].end - _LEAST_CUT_M
            if r and other != look and ends[0] < run.start < ends[1]:
                yield side.along, run.start
    for y in sorted(set(levels)):
        yield np.array([0.0, 1.0, 0.0]), y


def _parts(rows: F64, side: np.ndarray, wall: SidedWall, looks: LooksOf) -> Iterator[_SidePart]:
    middles = rows[..., :3].mean(1)
    for k, plane in enumerate(wall.sides):
        here = side == k
        s = middles @ plane.along
        last = len(plane.runs) - 1
        for r, run in enumerate(plane.runs):
            look = looks.get((k, r))
            if look is None:
                continue
            # The first and the last run reach to the ends, however rounded.
            mine = here & ((s >= run.start) | (r == 0)) & ((s < run.end) | (r == last))
            below = mine & (middles[:, 1] < look.low_y) & (look.low is not None)
            if look.low is not None and below.any():
                yield _SidePart(below, look.low, plane, run.start, look.floor_y)
            if (mine & ~below).any():
                yield _SidePart(mine & ~below, look.main, plane, run.start, look.floor_y)


def _in_metres(rows: F64, part: _SidePart) -> F64:
    # u to the right along the side, v up from the floor, in repeats of the material.
    size_u, size_v = part.material.size_m
    out = rows.copy()
    out[..., 6] = (rows[..., :3] @ part.side.along - part.start) / size_u
    out[..., 7] = (rows[..., 1] - part.floor_y) / size_v
    return out


def _surface(name: str, material: int, rows: F64) -> Surface:
    flat = rows.reshape(-1, 8)
    normals = flat[:, 3:6].astype(np.float32)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return Surface(
        name,
        flat[:, :3].astype(np.float32),
        np.arange(len(flat), dtype=np.int32).reshape(-1, 3),
        material,
        flat[:, 6:8].astype(np.float32),
        normals / length if bool((length > 0.1).all()) else None,
    )
