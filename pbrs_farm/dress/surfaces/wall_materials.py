"""Each room's material on the walls it sees: walls cut where rooms meet, uv in metres; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Item, Surface
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.dress.patterns import PatternMaterial
from pbrs_farm.dress.surfaces.cut_triangles import cut_triangles
from pbrs_farm.dress.surfaces.sided_walls import Side, SidedWall

REVEAL = "reveal"
"""Name of the faces by whose material repair paints the sides of openings."""
_LEVEL = 0.9  # minimum |cosine| to the vertical of a horizontal face's normal
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
"""Finishes of a wall's runs, by side and run."""


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
    # Cut the whole wall, so that it stays closed; open walls are painted by whole triangles.
    for normal, offset in _cuts(wall, looks) if wall.is_closed else ():
        rows, parents = cut_triangles(rows, normal, offset)
        surface, side = surface[parents], side[parents]
    surfaces: list[Surface] = []
    unassigned = np.ones(len(rows), bool)
    for part in _parts_by_look(rows, side, wall, looks):
        unassigned &= ~part.members
        for n in np.unique(surface[part.members]).tolist():
            mine = rows[part.members & (surface == n)]
            surfaces.append(
                _surface_of_rows(
                    item.surfaces[n].name, part.material.number, _in_metres(mine, part)
                )
            )
    # Horizontal faces get plaster; the others are unchanged.
    height = unit_normals(rows[..., :3])[:, 1]
    for mine, name, material in (
        (unassigned & (height < -_LEVEL), REVEAL, rest.foot),
        (unassigned & (height > _LEVEL), "top", rest.flat),
    ):
        unassigned &= ~mine
        if mine.any():
            surfaces.append(_surface_of_rows(name, material, rows[mine]))
    for n, source in enumerate(item.surfaces):
        mine = unassigned & (surface == n)
        if mine.any():
            surfaces.append(_surface_of_rows(source.name, source.material, rows[mine]))
    return replace(item, surfaces=tuple(surfaces))


def _cuts(wall: SidedWall, looks: LooksOf) -> Iterator[tuple[F64, float]]:
    """Normal and offset of the planes between runs, and level ones where the low material ends."""
    levels: list[float] = []
    for k, side in enumerate(wall.sides):
        for r, run in enumerate(side.runs):
            look = looks.get((k, r))
            if look is not None and look.low is not None:
                levels.append(look.low_y)
            before = looks.get((k, r - 1)) if r else look
            ends = side.runs[0].start + _LEAST_CUT_M, side.runs[-1].end - _LEAST_CUT_M
            if r and before != look and ends[0] < run.start < ends[1]:
                yield side.along, run.start
    for y in sorted(set(levels)):
        yield np.array([0.0, 1.0, 0.0]), y


def _parts_by_look(
    rows: F64, side: np.ndarray, wall: SidedWall, looks: LooksOf
) -> Iterator[_SidePart]:
    middles = rows[..., :3].mean(1)
    for k, plane in enumerate(wall.sides):
        on_side = side == k
        s = middles @ plane.along
        last = len(plane.runs) - 1
        for r, run in enumerate(plane.runs):
            look = looks.get((k, r))
            if look is None:
                continue
            # The first and the last run reach to the ends, however rounded.
            mine = on_side & ((s >= run.start) | (r == 0)) & ((s < run.end) | (r == last))
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


def _surface_of_rows(name: str, material: int, rows: F64) -> Surface:
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
