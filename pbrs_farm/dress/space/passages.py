"""Doors and windows as rooms see them: the two rooms, the space before them; no effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Item, ItemKind, Opening, Room
from pbrs_farm.core.mesh import triangle_corners
from pbrs_farm.dress.space.footprints import plan_area

WallsAt = Callable[[float], BaseGeometry]

BEFORE_DOOR_M = 0.8  # depth that must be free before a door
# Distances from the wall's middle at which a room is looked for.
_REACH_M = (0.1, 0.25, 0.4, 0.6, 0.8)
_MOST_HALF_WALL_M = 0.6
_HALF_WALL_M = 0.05  # half thickness assumed where no wall is found
_LEAST_DOOR_M = 1.6  # a lower hole is a hatch
_STEP_M = 0.004  # sampling step across walls: half of a wall without thickness
_CELL_M = 0.01  # along a wall
_BESIDE_M = 0.4  # distance beside a leaf within which its jambs are looked for
_DOORWAY_M = (0.5, 2.6)  # least and greatest width
_OFF_M = 0.01  # an opening nearer to its wall's middle plane stays there
_SAME_WALL_M = 0.1  # walls this near to one another have one hole
# A line along the hole is in the wall if walls cover this share of the most covered line.
_COVERED = 0.8
_LEAST_COVERED = 0.3  # least share of the hole's width that walls must cover


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """A door, an archway or a window, in the middle plane of its wall."""

    id: str  # of the opening, or of an item without one
    item_id: str | None
    level_id: str
    is_window: bool
    centre: F64  # (3,) of the hole, in the wall's middle plane
    along: F64  # (3,) unit, horizontal, in the wall
    normal: F64  # (3,) unit, horizontal, across the wall: from side 0 to side 1 is -normal
    width: float
    bottom_y: float
    top_y: float
    room_ids: tuple[str | None, str | None]  # on the normal's side, on the other
    half_wall: tuple[float, float]  # from the middle plane to the wall's face on each side

    def side_of(self, room_id: str) -> int | None:
        """0 for the room on the normal's side, 1 for the one behind, None for another."""
        return self.room_ids.index(room_id) if room_id in self.room_ids else None

    def inward(self, side: int) -> F64:
        """(3,) unit vector from the wall into the room of that side."""
        return self.normal if side == 0 else -self.normal

    def face_point(self, side: int) -> F64:
        """(3,) the hole's middle on the wall's face of that side."""
        return np.asarray(self.centre + self.inward(side) * self.half_wall[side])

    def before(self, side: int, depth_m: float = BEFORE_DOOR_M) -> BaseGeometry:
        """The plan rectangle, depth_m deep, in front of the hole on a side (0 or 1)."""
        face, out = self.face_point(side)[[0, 2]], self.inward(side)[[0, 2]] * depth_m
        half = self.along[[0, 2]] * self.width / 2
        return shapely.Polygon([face - half, face + half, face + half + out, face - half + out])

    @property
    def clear_m(self) -> float:
        """Depth in front of the hole to keep free: 0.8 m, or the swing of a wider leaf."""
        return max(BEFORE_DOOR_M, min(self.width, 1.0))

    def swing(self, side: int) -> BaseGeometry:
        """The plan area that leaves as wide as the hole, hung on either end, sweep on a side."""
        middle, half = self.face_point(side)[[0, 2]], self.along[[0, 2]] * self.width / 2
        discs = [shapely.Point(middle + s * half).buffer(self.width) for s in (-1, 1)]
        return shapely.intersection(shapely.union_all(discs), self.before(side, self.width))


def passages_of(
    items: Sequence[Item],
    openings: Sequence[Opening],
    rooms: Sequence[tuple[Room, BaseGeometry]],
    walls_at: WallsAt,
) -> tuple[Passage, ...]:
    """Doors and windows in order, at the walls' hole, or, without one, in the wall at their box."""
    by_id = {item.id: item for item in items}
    passages = [_from_opening(o, rooms, walls_at) for o in openings]
    with_hole = {o.item_id for o in openings}
    loose = [
        i
        for i in by_id.values()
        if i.kind in (ItemKind.DOOR, ItemKind.WINDOW) and i.id not in with_hole and i.n_faces
    ]
    passages += [_from_item(i, rooms, walls_at) for i in loose]
    return tuple(p for p in passages if p is not None)


def _from_opening(
    opening: Opening, rooms: Sequence[tuple[Room, BaseGeometry]], walls_at: WallsAt
) -> Passage | None:
    quad = np.asarray(opening.quad, np.float64)
    normal = np.asarray(opening.normal, np.float64)
    if not np.isfinite(quad).all() or np.linalg.norm(normal[[0, 2]]) < 0.5:
        return None  # a hole in a roof has no wall
    normal = normal * [1, 0, 1] / np.linalg.norm(normal[[0, 2]])
    # The quad's plane may be off the wall: halfway of all that the door's box touches.
    middle = (quad.min(0) + quad.max(0)) / 2
    cutter = opening.cutter
    walls = walls_at(float(middle[1]))
    span = None
    if not opening.is_cut:
        corners = triangle_corners(cutter.positions, cutter.faces).astype(np.float64)
        span = _depth_of_walls(plan_area(corners, upright=False), walls, normal)
    if span is not None:
        off = sum(span) / 2 - float(middle @ normal)
        quad = quad + normal * (off if abs(off) > _OFF_M else 0.0)
    return _passage(
        opening.id,
        opening.item_id,
        opening.level_id,
        opening.is_window,
        quad,
        normal,
        rooms,
        walls_at,
    )


def _depth_of_walls(
    area: BaseGeometry, walls: BaseGeometry, normal: F64
) -> tuple[float, float] | None:
    """Interval along a normal of the wall that fills most of an area's width; None without a wall."""
    if area.is_empty:
        return None
    across, along = normal[[0, 2]], np.array([normal[2], -normal[0]])
    plan = shapely.get_coordinates(area)
    (s0, s1), (t0, t1) = ((float(v.min()), float(v.max())) for v in (plan @ along, plan @ across))
    offsets = np.arange(t0 + _STEP_M / 2, t1, _STEP_M)
    if not len(offsets) or s1 - s0 < _STEP_M:
        return None
    lines = shapely.linestrings(
        np.stack([offsets[:, None] * across + s * along for s in (s0, s1)], axis=1)
    )
    near = shapely.intersection(walls, area)
    lengths = np.asarray(shapely.length(shapely.intersection(lines, near)))
    most = float(lengths.max())
    if most < _LEAST_COVERED * (s1 - s0):
        return None
    runs = _runs_of_true(lengths >= _COVERED * most, round(_SAME_WALL_M / _STEP_M))
    first, last = max(runs, key=lambda r: float(lengths[r[0] : r[1]].sum()))
    # The wall's faces themselves, not the lines that met it.
    low, high = float(offsets[first]) - _STEP_M, float(offsets[last - 1]) + _STEP_M
    corners = [s * along + t * across for s, t in ((s0, low), (s1, low), (s1, high), (s0, high))]
    depths = shapely.get_coordinates(shapely.intersection(shapely.Polygon(corners), near)) @ across
    return float(depths.min()), float(depths.max())


def _runs_of_true(mask: Bools, gap: int) -> list[tuple[int, int]]:
    """(first, end) of each stretch of True, those with at most so many False between joined."""
    runs: list[tuple[int, int]] = []
    for k in np.flatnonzero(mask).tolist():
        if runs and k - runs[-1][1] <= gap:
            runs[-1] = (runs[-1][0], k + 1)
        else:
            runs.append((k, k + 1))
    return runs


def _from_item(
    item: Item, rooms: Sequence[tuple[Room, BaseGeometry]], walls_at: WallsAt
) -> Passage | None:
    box = item.oriented_box
    corners = np.asarray(box.corners, np.float64)
    # Across the wall is the thinner of the box's level axes.
    level = [k for k in range(3) if abs(box.axes[1, k]) < 0.5]
    if not np.isfinite(corners).all() or len(level) != 2:
        return None
    is_window = item.kind is ItemKind.WINDOW
    level.sort(key=lambda k: float(box.half[k]))
    normal = box.axes[:, level[0]]
    if not is_window:
        walls = walls_at(float(box.centre[1]))
        for k in level:
            doorway = _doorway(corners, box.axes[:, k] * [1, 0, 1], walls)
            if doorway is not None:
                corners, normal = doorway, box.axes[:, k]
                break
    return _passage(item.id, item.id, item.level_id, is_window, corners, normal, rooms, walls_at)


def _doorway(corners: F64, normal: F64, walls: BaseGeometry) -> F64 | None:
    """(4, 3) hole in a wall across a normal, else the wall at the box (8, 3); None without a wall."""
    across = normal[[0, 2]] / np.linalg.norm(normal[[0, 2]])
    along = np.array([across[1], -across[0]])
    plan = corners[:, [0, 2]]
    (s0, s1), (t0, t1) = ((float(v.min()), float(v.max())) for v in (plan @ along, plan @ across))
    box = shapely.Polygon(
        [s * along + t * across for s, t in ((s0, t0), (s1, t0), (s1, t1), (s0, t1))]
    )
    low, high = float(corners[:, 1].min()), float(corners[:, 1].max())
    hole = None
    if s1 - s0 >= _DOORWAY_M[0]:
        span = _depth_of_walls(box, walls, np.array([across[0], 0.0, across[1]]))
        hole = (s0, s1, *span) if span is not None else None
    hole = hole or _hole_between((s0, s1), (t0, t1), along, across, walls)
    if hole is None:
        return None
    s0, s1, t0, t1 = hole
    t = (t0 + t1) / 2
    return np.array(
        [[*(s * along + t * across), y] for s, y in ((s0, low), (s1, low), (s1, high), (s0, high))]
    )[:, [0, 2, 1]]


def _hole_between(
    s: tuple[float, float], t: tuple[float, float], along: F64, across: F64, walls: BaseGeometry
) -> tuple[float, float, float, float] | None:
    """(s0, s1, t0, t1) of the narrowest gap of a wall at a box s, t along and across it; None = none."""
    reach = _BESIDE_M + max(s[1] - s[0], t[1] - t[0])
    ss = np.arange(s[0] - reach, s[1] + reach, _CELL_M)
    tt = np.arange(t[0] - _BESIDE_M / 2, t[1] + _BESIDE_M / 2, _STEP_M)
    places = ss[None, :, None] * along + tt[:, None, None] * across
    solid = shapely.contains_xy(walls, places[..., 0], places[..., 1])
    gaps: dict[tuple[int, int], list[int]] = {}
    for row in range(len(tt)):
        for first, end in _runs_of_true(~solid[row], 0):
            # The gap is between two jambs, and the box overlaps it.
            is_closed = first > 0 and end < len(ss)
            is_met = ss[first] < s[1] and ss[end - 1] > s[0]
            if is_closed and is_met and _DOORWAY_M[0] <= (end - first) * _CELL_M <= _DOORWAY_M[1]:
                gaps.setdefault((first, end), []).append(row)
    if not gaps:
        return None
    # A corridor's walls are farther apart than its door's jambs.
    first, end = min(gaps, key=lambda g: (g[1] - g[0], -len(gaps[g])))
    rows = gaps[first, end]
    s_half, t_half = _CELL_M / 2, _STEP_M / 2
    return ss[first] - s_half, ss[end - 1] + s_half, tt[rows[0]] - t_half, tt[rows[-1]] + t_half


def _passage(
    name: str,
    item_id: str | None,
    level_id: str,
    is_window: bool,
    points: F64,
    normal: F64,
    rooms: Sequence[tuple[Room, BaseGeometry]],
    walls_at: WallsAt,
) -> Passage | None:
    normal = normal * [1, 0, 1]
    normal = normal / np.linalg.norm(normal)
    along = np.array([normal[2], 0.0, -normal[0]])
    # Measure the hole in its own plane.
    s, y = points @ along, points[:, 1]
    middle = (points.min(0) + points.max(0)) / 2
    centre = middle + along * ((s.min() + s.max()) / 2 - middle @ along)
    centre[1] = (y.min() + y.max()) / 2
    width = float(s.max() - s.min())
    if width < 0.1 or y.max() - y.min() < 0.1:
        return None
    # A hole that begins at a man's height above the floor lets nobody through.
    is_window = is_window or y.max() - y.min() < _LEAST_DOOR_M
    sides = [_room_at(centre, out, rooms, y.min(), y.max()) for out in (normal, -normal)]
    walls = walls_at(float(centre[1]))
    half = [_half_wall(centre, out, along, width, walls) for out in (normal, -normal)]
    return Passage(
        name,
        item_id,
        level_id,
        is_window,
        centre,
        along,
        normal,
        width,
        float(y.min()),
        float(y.max()),
        (sides[0], sides[1]),
        (half[0], half[1]),
    )


def _room_at(
    centre: F64, out: F64, rooms: Sequence[tuple[Room, BaseGeometry]], low: float, high: float
) -> str | None:
    # The first room behind the wall.
    for reach in _REACH_M:
        x, _, z = centre + out * reach
        for room, area in rooms:
            if low < room.ceiling_y and high > room.floor_y and shapely.contains_xy(area, x, z):
                return room.id
    return None


def _half_wall(centre: F64, out: F64, along: F64, width: float, walls: BaseGeometry) -> float:
    # Go out from the middle plane through the wall: in the hole, and beside it where it is cut.
    lengths = []
    for beside in (0.0, width / 2 + 0.05, -width / 2 - 0.05):
        start = (centre + along * beside)[[0, 2]]
        way = shapely.LineString([start, start + out[[0, 2]] * _MOST_HALF_WALL_M])
        for part in shapely.get_parts(shapely.intersection(way, walls)):
            if shapely.distance(part, shapely.Point(start)) < 1e-6 and part.length > 0.005:
                lengths.append(float(part.length))
        if lengths and beside == 0.0:
            break
    return min(lengths, default=_HALF_WALL_M)
