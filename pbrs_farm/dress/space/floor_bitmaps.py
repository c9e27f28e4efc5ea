"""A room's floor as a bitmap: occupied cells, walkable ways, connections between doors."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.walkable import CELL_M, HEAD_M, STEP_M, WALK_M, FloorGrid, connected_ways
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace

_DOOR_REACH_M = 0.15  # maximum distance between a way and the standing area of a door, metres


@dataclass(frozen=True, slots=True, eq=False)
class FloorBitmap:
    """Cells of 5 cm over a room: row i at z = origin[1] + i * CELL_M, column j at x likewise."""

    origin: tuple[float, float]  # x, z of the first cell's corner
    inside: Bools  # (H, W) in the room and in no wall
    occupied: Bools  # (H, W) inside the room and occupied below head height
    ways: NDArray[np.int32]  # (H, W) number of the connected walkable way; 0 = none

    def cells(self, places: F64) -> NDArray[np.int64]:
        """(N, 2) row and column, maybe outside, of plan places (N, 2)."""
        return FloorGrid(self.origin, self.inside.shape).cells(places)


class FloorCells:
    """A room's floor in cells of 5 cm, and the cells below each item between 8 cm and 1.8 m."""

    def __init__(self, space: HouseSpace, room: RoomSpace) -> None:
        x0, z0, x1, z1 = room.area.bounds if not room.area.is_empty else (0.0, 0.0, CELL_M, CELL_M)
        self._grid = FloorGrid.over(x0, z0, x1, z1)
        xx, zz = self._grid.middles
        inside = shapely.contains_xy(room.area, xx, zz)
        self._inside = np.asarray(inside & ~shapely.contains_xy(room.walls, xx, zz))
        self._below: dict[int, Bools] = {}  # cells by the item's index
        low, high = room.room.floor_y + STEP_M, room.room.floor_y + HEAD_M
        for number in room.items:
            points = space.points[number]
            body = points[(points[:, 1] > low) & (points[:, 1] < high)]
            self._below[number] = self._grid.marked(body[:, [0, 2]])

    def bitmap(self, without: Collection[int] = ()) -> FloorBitmap:
        """The floor with ways 0.6 m wide between its items; without: indices of items to ignore."""
        occupied = np.zeros(self._grid.shape, bool)
        for number, cells in self._below.items():
            if number not in without:
                occupied |= cells
        occupied &= self._inside
        ways = connected_ways(self._inside & ~occupied)
        return FloorBitmap(self._grid.origin, self._inside, occupied, ways)


def with_body(bitmap: FloorBitmap, body: Bools, width_m: float = WALK_M) -> FloorBitmap:
    """The floor with an additional body (H, W) and ways of width_m; slow, so test the cells first."""
    occupied = bitmap.occupied | body
    ways = connected_ways(bitmap.inside & ~occupied, width_m)
    return replace(bitmap, occupied=occupied, ways=ways)


def doors_are_joined(bitmap: FloorBitmap, room: RoomSpace) -> bool:
    """True if one way connects all doors of the room; compare before and after `with_body`."""
    common: set[int] | None = None
    doors = [(d, s) for d in room.doors if (s := d.side_of(room.room.id)) is not None]
    if len(doors) < 2:
        return True
    for door, side in doors:
        # Find the ways near the standing area of the door.
        middle = door.face_point(side) + door.inward(side) * (WALK_M / 2 + _DOOR_REACH_M / 2)
        row, column = bitmap.cells(middle[None, [0, 2]])[0]
        r = int(np.ceil((_DOOR_REACH_M + CELL_M) / CELL_M))
        part = bitmap.ways[
            max(row - r, 0) : max(row + r + 1, 0), max(column - r, 0) : max(column + r + 1, 0)
        ]
        near = {int(way) for way in np.unique(part)} - {0}
        common = near if common is None else common & near
    return bool(common)
