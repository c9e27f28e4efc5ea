"""Doors and windows as rooms see them: the two rooms, the space before them; no effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, ItemKind, Opening, Room

WallsAt = Callable[[float], BaseGeometry]

BEFORE_DOOR_M = 0.8  # that must be free in front of a door
_REACH_M = (0.1, 0.25, 0.4, 0.6, 0.8)  # from the wall's middle, where a room is looked for
_MOST_HALF_WALL_M = 0.6
_HALF_WALL_M = 0.05  # where no wall is found
_LEAST_DOOR_M = 1.6  # a lower hole is a hatch


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """A door, an archway or a window, in the middle plane of its wall."""

    id: str  # of the opening, or of the item that has none
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
        """The plan rectangle in front of the hole on that side, as wide as the hole."""
        face, out = self.face_point(side)[[0, 2]], self.inward(side)[[0, 2]] * depth_m
        half = self.along[[0, 2]] * self.width / 2
        return shapely.Polygon([face - half, face + half, face + half + out, face - half + out])

    @property
    def clear_m(self) -> float:
        """How far before the hole nothing may stand: 0.8 m, or as far as a leaf of a wider door swings."""
        return max(BEFORE_DOOR_M, min(self.width, 1.0))

    def swing(self, side: int) -> BaseGeometry:
        """The plan area a leaf of the hole's width sweeps, hung on either end (which is unknown)."""
        middle, half = self.face_point(side)[[0, 2]], self.along[[0, 2]] * self.width / 2
        discs = [shapely.Point(middle + s * half).buffer(self.width) for s in (-1, 1)]
        return shapely.intersection(shapely.union_all(discs), self.before(side, self.width))


def passages_of(
    items: Sequence[Item],
    openings: Sequence[Opening],
    rooms: Sequence[tuple[Room, BaseGeometry]],
    walls_at: WallsAt,
) -> tuple[Passage, ...]:
    """Every door, archway and window, in the house's order; walls_at: plan area of walls at a height.

    Doors and windows that cut no hole count by their own boxes.
    """
    by_id = {item.id: item for item in items}
    found = [_from_opening(o, rooms, walls_at) for o in openings]
    with_hole = {o.item_id for o in openings}
    loose = [
        i
        for i in by_id.values()
        if i.kind in (ItemKind.DOOR, ItemKind.WINDOW) and i.id not in with_hole and i.n_faces
    ]
    found += [_from_item(i, rooms, walls_at) for i in loose]
    return tuple(p for p in found if p is not None)


def _from_opening(
    opening: Opening, rooms: Sequence[tuple[Room, BaseGeometry]], walls_at: WallsAt
) -> Passage | None:
    quad = np.asarray(opening.quad, np.float64)
    normal = np.asarray(opening.normal, np.float64)
    if not np.isfinite(quad).all() or np.linalg.norm(normal[[0, 2]]) < 0.5:
        return None  # a hole in a roof has no wall
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


def _from_item(
    item: Item, rooms: Sequence[tuple[Room, BaseGeometry]], walls_at: WallsAt
) -> Passage | None:
    box = item.oriented_box
    corners = np.asarray(box.corners, np.float64)
    # Across the wall is the thinner of the box's level axes.
    level = [k for k in range(3) if abs(box.axes[1, k]) < 0.5]
    if not np.isfinite(corners).all() or len(level) != 2:
        return None
    normal = box.axes[:, min(level, key=lambda k: float(box.half[k]))]
    is_window = item.kind is ItemKind.WINDOW
    return _passage(item.id, item.id, item.level_id, is_window, corners, normal, rooms, walls_at)


def _passage(
    name: str, item_id: str | None, level_id: str, is_window: bool, points: F64, normal: F64,
    rooms: Sequence[tuple[Room, BaseGeometry]], walls_at: WallsAt,
) -> Passage | None:  # fmt: skip
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
        name, item_id, level_id, is_window, centre, along, normal, width,
        float(y.min()), float(y.max()), (sides[0], sides[1]), (half[0], half[1]),
    )  # fmt: skip


def _room_at(
    centre: F64, out: F64, rooms: Sequence[tuple[Room, BaseGeometry]], low: float, high: float
) -> str | None:
    # The first room that is met when going through the wall.
    for reach in _REACH_M:
        x, _, z = centre + out * reach
        for room, area in rooms:
            if low < room.ceiling_y and high > room.floor_y and shapely.contains_xy(area, x, z):
                return room.id
    return None


def _half_wall(centre: F64, out: F64, along: F64, width: float, walls: BaseGeometry) -> float:
    # Go out from the middle plane through the wall: in the hole, and beside it where it is cut.
    found = []
    for beside in (0.0, width / 2 + 0.05, -width / 2 - 0.05):
        start = (centre + along * beside)[[0, 2]]
        way = shapely.LineString([start, start + out[[0, 2]] * _MOST_HALF_WALL_M])
        for part in shapely.get_parts(shapely.intersection(way, walls)):
            if shapely.distance(part, shapely.Point(start)) < 1e-6 and part.length > 0.005:
                found.append(float(part.length))
        if found and beside == 0.0:
            break
    return min(found, default=_HALF_WALL_M)
