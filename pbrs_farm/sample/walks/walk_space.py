"""The free space of a storey that a person walks in, and its doors, open or shut; no effects."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.house import House, Item, ItemKind, Opening, Room
from pbrs_farm.core.walkable import (
    CELL_M,
    HEAD_M,
    STEP_M,
    WALK_M,
    FloorGrid,
    clearance_m,
    connected_ways,
)
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.geometry.surface_points import item_triangles, surface_points

LEAST_WAY_M2: Final = 0.05  # of places for a person's middle; less is no region to walk in
_DOOR_DEPTH_M: Final = 0.35  # from a door's middle plane to where its rooms have begun
_DOOR_SIDE_M: Final = 0.75  # distance from a door's middle plane to the place in front of it
_SPACING_M: Final = 0.03  # of points on surfaces: two fall into every cell that a surface crosses
_LEAST_DOOR_M: Final = 1.6  # an opening lower than this is a hatch, not a door
_NO_ROOM: Final = -1
_OUTDOORS: Final = 0.01  # of a room without a ceiling


@dataclass(frozen=True, slots=True)
class DoorWay:
    """A door or archway of a storey."""

    name: str
    is_open: bool  # one way leads from its one side to the other


@dataclass(frozen=True)
class WalkSpace:
    """One storey in cells of 5 cm."""

    level_id: str
    grid: FloorGrid
    room: NDArray[np.int32]  # (H, W) index of the room in House.rooms, -1 = none
    floor_y: F64  # (H, W) world y of the floor, NaN without floor
    clearance: F64  # (H, W) metres to the nearest cell that is not free
    ways: NDArray[np.int32]  # (H, W) number of the connected way, 0 = none
    doors: tuple[DoorWay, ...]
    way: int = 0  # number of the walked region, 0 if none is large enough
    interest: float = 0.0  # of that way: the larger, the more there is to see

    @cached_property
    def region(self) -> Bools:
        """(H, W) the walked region; empty if none is large enough."""
        return np.asarray((self.ways == self.way) & (self.way > 0))


def walk_spaces(house: House) -> tuple[WalkSpace, ...]:
    """The storeys that have rooms with an area, in order, as new rasters in plan."""
    spaces = []
    for level in house.levels:
        rooms = [(k, r) for k, r in enumerate(house.rooms) if r.level_id == level.id]
        rooms = [(k, r) for k, r in rooms if not shapely.is_empty(room_shape(r))]
        if rooms:
            openings = [o for o in house.openings if o.level_id == level.id]
            spaces.append(_walk_space(house, level.id, rooms, openings))
    return tuple(spaces)


def _walk_space(
    house: House, level_id: str, rooms: list[tuple[int, Room]], openings: list[Opening]
) -> WalkSpace:
    # Lay the grid over the storey; a place in two rooms belongs to the smaller.
    x0, z0, x1, z1 = shapely.total_bounds([room_shape(r) for _k, r in rooms])
    grid = FloorGrid.over(float(x0), float(z0), float(x1), float(z1))
    xx, zz = grid.middles
    room = np.full(grid.shape, _NO_ROOM, np.int32)
    floor_y = np.full(grid.shape, np.nan)
    for k, home_room in sorted(rooms, key=lambda pair: -shapely.area(room_shape(pair[1]))):
        inside = shapely.contains_xy(room_shape(home_room), xx, zz)
        room[inside], floor_y[inside] = k, home_room.floor_y
    # Carry the floors through the holes of doors, whose walls belong to no room.
    doors = [o for o in openings if _is_door(o)]
    strips = np.zeros(grid.shape, bool)
    for door in doors:
        strips |= _strip_before(grid, door)
    strips &= room == _NO_ROOM
    _, nearest = ndimage.distance_transform_edt(room == _NO_ROOM, return_indices=True)
    floor_y[strips] = floor_y[tuple(nearest)][strips]
    # Mark cells with obstacles between step and head height, and cells with floor.
    occupied, has_floor = _marks(house, grid, floor_y)
    free = np.isfinite(floor_y) & ~occupied & (has_floor | strips)
    ways = connected_ways(free)
    return WalkSpace(
        level_id,
        grid,
        room,
        floor_y,
        clearance_m(free),
        ways,
        tuple(DoorWay(_name_of_room(house, door), _joins(grid, ways, door)) for door in doors),
        *_most_interesting(house, level_id, grid, room, ways),
    )


def _things_by_room(
    house: House, level_id: str, grid: FloorGrid, room: NDArray[np.int32]
) -> Counter[int]:
    """Room index -> number of the storey's items with their centre in it."""
    level_items = [i for i in house.items if i.level_id == level_id and i.n_faces]
    things = [i for i in level_items if not (i.kind.is_structure or is_door_item(i))]
    middles = np.array([i.bounds.mean(0)[[0, 2]] for i in things]).reshape(-1, 2)
    cells = grid.cells(middles)
    return Counter(room[tuple(cells[grid.holds(cells)].T)].tolist())


def _most_interesting(
    house: House, level_id: str, grid: FloorGrid, room: NDArray[np.int32], ways: NDArray[np.int32]
) -> tuple[int, float]:
    """(number, interest) of the region with the most indoor floor and items; (0, 0) = none."""
    best = (0, 0.0)
    things = _things_by_room(house, level_id, grid, room)
    walkable = Counter(room[ways > 0].tolist())
    for number in range(1, int(ways.max(initial=0)) + 1):
        way_rooms = room[ways == number]
        if len(way_rooms) * CELL_M**2 < LEAST_WAY_M2:
            continue
        # A terrace counts, but little: a walk is one through rooms.
        rooms = [
            (int(k), int((way_rooms == k).sum())) for k in np.unique(way_rooms[way_rooms >= 0])
        ]
        indoors = {k for k, _n in rooms if house.rooms[k].has_ceiling}
        cells = sum(n if k in indoors else _OUTDOORS * n for k, n in rooms)
        # A room's items count in proportion to its floor in this region.
        n_things = sum(things[k] * n / walkable[k] for k, n in rooms if k in indoors)
        interest = ((cells + 1) * CELL_M**2) ** 0.5 * (1 + n_things)
        if interest > best[1]:
            best = number, interest
    return best


def _marks(house: House, grid: FloorGrid, floor_y: F64) -> tuple[Bools, Bools]:
    """(H, W) cells where something is between a step and a head; cells that have a floor."""
    occupied, floor = np.zeros(grid.shape, bool), np.zeros(grid.shape, bool)
    levels = floor_y[np.isfinite(floor_y)]
    low, high = float(levels.min()) - STEP_M, float(levels.max()) + HEAD_M
    for item in house.items:
        points = _points_between(item, low, high)
        cells = grid.cells(points[:, [0, 2]])
        inside = grid.holds(cells)
        cells, y = cells[inside], points[inside, 1]
        # Heights count from each cell's own floor.
        with np.errstate(invalid="ignore"):
            above = y - floor_y[tuple(cells.T)]
            body, ground = (above > STEP_M) & (above < HEAD_M), np.abs(above) <= STEP_M
        occupied[tuple(cells[body].T)] = True
        floor[tuple(cells[ground].T)] = True
    # Close cracks between floors that abut.
    return occupied, np.asarray(
        ndimage.binary_closing(np.pad(floor, 2), np.ones((3, 3), bool))[2:-2, 2:-2]
    )


def _points_between(item: Item, low: float, high: float) -> F64:
    corners = item_triangles(item)
    y = corners[:, :, 1]
    corners = corners[(y.max(1) >= low) & (y.min(1) <= high)]
    return surface_points(corners, _SPACING_M)


def _is_door(opening: Opening) -> bool:
    quad = np.asarray(opening.quad)
    is_upright = np.isfinite(quad).all() and abs(float(opening.normal[1])) < 0.5
    is_high = float(np.ptp(quad[:, 1])) >= _LEAST_DOOR_M
    return bool(not opening.is_window and is_upright and is_high)


def _frame_of_opening(door: Opening) -> tuple[F64, F64, float]:
    """The hole's middle and the unit normal across the wall, in plan, and half its width."""
    normal = np.asarray(door.normal)[[0, 2]] / np.linalg.norm(np.asarray(door.normal)[[0, 2]])
    plan = np.asarray(door.quad)[:, [0, 2]]
    middle = (plan.min(0) + plan.max(0)) / 2
    along = (plan - middle) @ np.array([normal[1], -normal[0]])
    return middle, normal, float(np.abs(along).max())


def _strip_before(grid: FloorGrid, door: Opening) -> Bools:
    """(H, W) the cells of the hole through the wall."""
    middle, normal, half = _frame_of_opening(door)
    xx, zz = grid.middles
    dx, dz = xx - middle[0], zz - middle[1]
    across, along = dx * normal[0] + dz * normal[1], dx * normal[1] - dz * normal[0]
    return np.asarray((np.abs(across) <= _DOOR_DEPTH_M) & (np.abs(along) <= half))


def _joins(grid: FloorGrid, ways: NDArray[np.int32], door: Opening) -> bool:
    """Whether one way passes through the hole: it reaches both sides and the middle plane."""
    middle, normal, half = _frame_of_opening(door)
    reached = [_ways_near(grid, ways, middle, CELL_M + half - WALK_M / 2)]
    reached += [
        _ways_near(grid, ways, middle + s * normal * _DOOR_SIDE_M, WALK_M / 2) for s in (-1, 1)
    ]
    return bool(set.intersection(*reached))


def _ways_near(grid: FloorGrid, ways: NDArray[np.int32], place: F64, reach_m: float) -> set[int]:
    cell: I64 = grid.cells(place[None])[0]
    r = max(int(np.ceil(reach_m / CELL_M)), 1)
    rows, columns = (slice(max(int(c) - r, 0), max(int(c) + r + 1, 0)) for c in cell)
    return {int(way) for way in np.unique(ways[rows, columns])} - {0}


def _name_of_room(house: House, door: Opening) -> str:
    item = next((i for i in house.items if i.id == door.item_id), None)
    return f"{item.name} ({item.id})" if item is not None and item.name != item.id else door.id


def shut_doors(space: WalkSpace) -> list[str]:
    """The names of the storey's doors that no way passes."""
    return [door.name for door in space.doors if not door.is_open]


def is_door_item(item: Item) -> bool:
    """Whether an item is a door or window: nothing that a person looks at."""
    return item.kind in (ItemKind.DOOR, ItemKind.WINDOW)
