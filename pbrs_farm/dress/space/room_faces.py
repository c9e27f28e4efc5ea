"""Wall faces cut to rooms, and their areas free of structure and items; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.house import Room
from pbrs_farm.core.mesh import boxes_meeting
from pbrs_farm.dress.space.footprints import areal
from pbrs_farm.dress.space.passages import Passage
from pbrs_farm.dress.space.wall_faces import CELL_M, FAR_M, Hidden, WallFace, WallPlane, runs

_IN_FRONT_M = (0.1, 0.3, 0.02)  # distances before a wall's face at which its room is looked for
# Distances before a face at which another wall is looked for.
_WALL_BEFORE_M = (0.02, 0.1, 0.2, 0.35, 0.5, 0.8)
_BY_OPENING_M = 0.1  # margin of wall around an opening that stays free
_OPENING_WALL_M = 0.45  # greatest distance from a wall's face to the middle plane of its openings
_UNDER_CEILING_M = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class WallAreas:
    """Plan areas and (I, 2, 3) bounds of walls."""

    areas: tuple[BaseGeometry, ...]
    bounds: F64
    _joined: dict[bytes, BaseGeometry] = field(default_factory=dict, init=False)

    def at(self, y: float) -> BaseGeometry:
        """The plan area of all walls that cross the height y."""
        crosses = (self.bounds[:, 0, 1] < y) & (self.bounds[:, 1, 1] > y)
        key = crosses.tobytes()
        if key not in self._joined:
            parts = [self.areas[n] for n in np.flatnonzero(crosses)]
            self._joined[key] = areal(shapely.union_all(parts))
        return self._joined[key]


def room_faces(
    planes: Iterable[WallPlane], rooms: Sequence[Room], areas: Sequence[BaseGeometry]
) -> dict[int, list[WallFace]]:
    """The wall faces of each room (by index), cut to the room, ignoring obstacles.

    A face is a rectangle of cells in the plane of a wall, with FAR_M free in front of wall cells and 0
    elsewhere. Of overlapping rooms the smaller one gets the face. Limit it by `with_structure` and
    `with_things`.
    """
    order = sorted(range(len(areas)), key=lambda k: (areas[k].area, k))
    faces: dict[int, list[WallFace]] = {}
    for plane in planes:
        s, y = plane.corners[:, :, 0], plane.corners[:, :, 1]
        s0, n = float(s.min()), max(int((s.max() - s.min()) / CELL_M), 1)
        columns = np.asarray(s0 + (np.arange(n) + 0.5) * CELL_M, np.float64)
        # Ask on each storey which room is in front of each column.
        tried = [k for k in order if rooms[k].floor_y < y.max() and rooms[k].ceiling_y > y.min()]
        for level in dict.fromkeys(rooms[k].level_id for k in tried):
            on_level = [k for k in tried if rooms[k].level_id == level]
            for k, start, end in runs(_rooms_before(plane, columns, on_level, areas)):
                room = rooms[k]
                low_y = max(room.floor_y, float(y.min()))
                n_rows = int((max(room.ceiling_y, float(y.max())) - low_y) / CELL_M)
                first = s0 + start * CELL_M
                covered = plane.covered(first, low_y, (n_rows, end - start))
                if not covered.any():
                    continue
                origin = plane.point + plane.along * first + [0.0, low_y, 0.0]
                clear = np.where(covered, np.float32(FAR_M), np.float32(0))
                face = WallFace(
                    plane.wall_id,
                    room.id,
                    room.level_id,
                    origin,
                    plane.along,
                    plane.normal,
                    clear,
                    plane.recess(first, end - start),
                )
                faces.setdefault(k, []).append(face)
    return faces


def _rooms_before(
    plane: WallPlane, columns: F64, rooms: Sequence[int], areas: Sequence[BaseGeometry]
) -> list[int]:
    rooms_found = np.full(len(columns), -1)
    for out_m in _IN_FRONT_M:
        places = plane.world(columns, out_m)
        for k in rooms:
            open_ = rooms_found < 0
            x0, z0, x1, z1 = areas[k].bounds if not areas[k].is_empty else (1.0, 1.0, 0.0, 0.0)
            open_ &= (places[:, 0] >= x0) & (places[:, 0] <= x1)
            open_ &= (places[:, 1] >= z0) & (places[:, 1] <= z1)
            if open_.any():
                inside = shapely.contains_xy(areas[k], places[open_, 0], places[open_, 1])
                rooms_found[np.flatnonzero(open_)[inside]] = k
    return rooms_found.tolist()


def with_structure(
    face: WallFace, walls: WallAreas, passages: Sequence[Passage], ceiling_y: Callable[[F64], F64]
) -> WallFace:
    """A copy limited by walls, openings and ceiling_y over plan places (N, 2); not by items."""
    clear = face.clear.copy()
    columns = np.asarray((np.arange(clear.shape[1]) + 0.5) * CELL_M, np.float64)
    ys = face.low_y + (np.arange(clear.shape[0]) + 0.5) * CELL_M
    # Other walls cover the face, or obstruct it.
    for n in meeting(walls.bounds, reach_of(face)):
        rows = (ys > walls.bounds[n, 0, 1]) & (ys < walls.bounds[n, 1, 1])
        for out_m in _WALL_BEFORE_M:
            places = face.origin + columns[:, None] * face.along + out_m * face.normal
            within = shapely.contains_xy(walls.areas[n], places[:, 0], places[:, 2])
            if within.any():
                hidden = np.float32(0.0 if out_m <= _WALL_BEFORE_M[0] else out_m)
                block = np.ix_(rows, within)
                clear[block] = np.minimum(clear[block], hidden)
    # Openings take their hole and a margin.
    for passage in passages:
        _cut_passage(clear, face, passage)
    # The ceiling hides the part of the wall above it.
    top = np.minimum(*(_ceiling_over(face, ceiling_y, columns, out_m) for out_m in (0.03, 0.2)))
    clear[ys[:, None] > (top - _UNDER_CEILING_M)[None, :]] = 0.0
    return replace(face, clear=clear)


def with_things(face: WallFace, hidden: Sequence[Hidden | None]) -> WallFace:
    """The face with its free space limited by items; hidden: the area of each, None = nothing."""
    if not hidden:
        return face
    clear = face.clear.copy()
    for thing in hidden:
        if thing is not None:
            thing.limit(clear)
    return replace(face, clear=clear)


def reach_of(face: WallFace) -> F64:
    """(2, 3) bounds of the space before the face in which items limit it, world metres."""
    ends = [
        face.point(s, y, out)
        for s in (0.0, face.length)
        for y in (face.low_y, face.high_y)
        for out in (-0.03, FAR_M)
    ]
    return np.array([np.min(ends, 0), np.max(ends, 0)])


def meeting(bounds: F64, reach: F64) -> list[int]:
    """Numbers of the boxes (I, 2, 3) that meet the box reach (2, 3); NaN meets nothing."""
    meets = boxes_meeting(bounds[:, 0], bounds[:, 1], reach[0], reach[1])
    return [int(n) for n in np.flatnonzero(meets)]


def _cut_passage(clear: F32, face: WallFace, passage: Passage) -> None:
    # Only openings in this very wall count: parallel to the face, and within its depth.
    if abs(float(passage.normal @ face.normal)) < 0.9:
        return
    if not -_OPENING_WALL_M < float(face.out_of(passage.centre[None])[0]) < 0.1:
        return
    # Columns j run along the face (s), rows i up from low_y; both in cells of CELL_M.
    middle = float(face.s_of(passage.centre[None])[0])
    half = passage.width / 2 + _BY_OPENING_M
    j0, j1 = (int(np.clip((middle + s * half) / CELL_M, 0, clear.shape[1])) for s in (-1, 1))
    i0, i1 = (
        int(np.clip((y - face.low_y) / CELL_M, 0, clear.shape[0]))
        for y in (passage.bottom_y - _BY_OPENING_M, passage.top_y + _BY_OPENING_M)
    )
    clear[i0:i1, j0:j1] = 0.0


def _ceiling_over(
    face: WallFace, ceiling_y: Callable[[F64], F64], columns: F64, out_m: float
) -> F64:
    # The ceiling over every fourth column, carried to its neighbours.
    some = columns[::4]
    places = face.origin + some[:, None] * face.along + out_m * face.normal
    heights = ceiling_y(places[:, [0, 2]])
    return np.repeat(heights, 4)[: len(columns)]
