"""Put items on floors near walls: bins, bags, shoes, baskets, boxes, never in the way. Effects: changes the house."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.classes import CABINET, COUNTER, DRESSER, OTHERFURNITURE, REFRIGERATOR
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.core.walkable import CELL_M
from pbrs_farm.dress.clutter.placing import Placing, separate_pair
from pbrs_farm.dress.clutter.stock import CLUTTER
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.space.flights import flights_of
from pbrs_farm.dress.space.floor_bitmaps import FloorBitmap, FloorCells, doors_are_joined, with_body
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace
from pbrs_farm.dress.supports import faces_around
from pbrs_farm.dress.worktop import LIFT_M
from pbrs_farm.geometry.plan_grid import PlanGrid
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.swept import floor_swept

_WALK_M = 0.65  # width of the ways that stay open
_REACH_M = 0.35  # maximum distance from an item's edge to a wall or furniture, metres
_NEAR_WALLS_M = 0.5  # walls farther from the room's outline belong to other rooms
_AT_WALL_M = 0.12  # maximum distance from the wall for wall items, metres
_KEPT_M = 0.04  # minimum distance between items, metres
_DOOR_M = 1.0  # kept free before doors
_OPEN_M = 0.6  # kept free before furniture with doors or drawers
_OPENED = (CABINET, COUNTER, REFRIGERATOR, DRESSER, OTHERFURNITURE)
_STANDS_M, _LEAST_FRONT_M = 0.15, 0.4  # above the floor, how low and how high it reaches
_HEAD_M = 1.9
_RUG_M = 0.03  # maximum height of flat items such as rugs, which may be anywhere but carry nothing


@dataclass(slots=True)
class _Floor:
    # Grid cells of a room's floor while items are placed.
    room: RoomSpace
    bitmap: FloorBitmap
    grid: PlanGrid  # of the same cells
    free: Bools  # unoccupied, and not needed by a door
    walkable: Bools  # unoccupied
    has_ways: bool  # one way joins the room's doors


def fill_floor(placing: Placing, scene: SceneTriangles, space: HouseSpace, room: RoomSpace) -> int:
    """Put items on the floor of a room; returns their number."""
    rng = placing.rng
    # Draw what the room usually has before its floor is looked at, which costs more.
    kinds = [
        kind
        for kind, chance in CLUTTER.floors.get(room.kind, ())
        if rng.random() < chance * placing.share
    ]
    floor = _floor_of_room(scene, space, room) if kinds else None
    flights = flights_of(placing.house, room.room, room.area)
    if floor is not None and not flights.before.is_empty:
        plan = floor.grid.centres()
        floor.free &= ~shapely.contains_xy(flights.before, plan[..., 0], plan[..., 1])
    if floor is None or not floor.free.any():
        return 0
    n = 0
    for kind in kinds:
        model = placing.stock.take(rng, kind, placing.style)
        if model is not None and kind == "shoes":
            model = separate_pair(model, rng, placing.house.mess)
        if model is not None:
            n += _put_on_floor(placing, floor, model, at_wall=kind in CLUTTER.at_walls)
    return n


def _floor_of_room(scene: SceneTriangles, space: HouseSpace, room: RoomSpace) -> _Floor | None:
    if room.area.is_empty or room.room.polygon.shape[0] < 3:
        return None
    y = room.room.floor_y
    bitmap = FloorCells(space, room).bitmap()
    grid = PlanGrid(np.asarray(bitmap.origin), 0.0, CELL_M, bitmap.inside.shape)
    plan = grid.centres()
    around = faces_around(scene, (), grid, y)
    hits, inside = around.hits, bitmap.inside & ~around.solid
    # Rugs carry nothing, but are walkable.
    stands = (hits.low < y + _HEAD_M) & (hits.high > y + 0.002)
    blocks = stands & (hits.high > y + _RUG_M)
    low, body = np.zeros(grid.shape, np.bool_), np.zeros(grid.shape, np.bool_)
    low[hits.row[stands], hits.column[stands]] = True
    body[hits.row[blocks], hits.column[blocks]] = True
    walkable = inside & ~body
    # Keep a metre before doors and windows that reach the floor.
    kept_free = np.zeros(grid.shape, np.bool_)
    for passage in (*room.doors, *(w for w in room.windows if w.bottom_y < y + 0.4)):
        side = passage.side_of(room.room.id)
        if side is None:
            continue
        zone = passage.before(side, _DOOR_M).union(passage.swing(side)).buffer(CELL_M)
        kept_free |= shapely.contains_xy(zone, plan[..., 0], plan[..., 1])
    items = [scene.items[k] for k in room.items]
    fronts = shapely.union_all([floor_swept(items, y), *(_before_front(item, y) for item in items)])
    kept_free |= shapely.contains_xy(fronts, plan[..., 0], plan[..., 1])
    joined = doors_are_joined(bitmap, room)
    return _Floor(room, bitmap, grid, inside & ~low & ~kept_free, walkable, joined)


def _before_front(item: Item, floor_y: float) -> BaseGeometry:
    """Standing area for opening doors or drawers: of a cupboard, a wardrobe, a cooker."""
    low_y, high_y = item.bounds[:, 1]
    is_closed = item.kind is ItemKind.OBJECT and item.nyu40 in _OPENED
    if not is_closed or low_y > floor_y + _STANDS_M or high_y < floor_y + _LEAST_FRONT_M:
        return shapely.Polygon()
    box = item.oriented_box
    out, across = box.axes[[0, 2], 2], box.axes[[0, 2], 0] * box.half[0]
    near = box.centre[[0, 2]] + out * box.half[2]
    far = near + out * _OPEN_M
    return shapely.Polygon([near - across, near + across, far + across, far - across])


def _put_on_floor(placing: Placing, floor: _Floor, model: Model, *, at_wall: bool) -> bool:
    low, high = model[1].bounds
    reach = float(np.hypot(high[0] - low[0], high[2] - low[2])) / 2
    # Its middle keeps from everything by its own radius, but not much more.
    distance = ndimage.distance_transform_edt(np.pad(floor.free, 1))[1:-1, 1:-1] * CELL_M
    to_wall = ndimage.distance_transform_edt(np.pad(floor.walkable, 1))[1:-1, 1:-1] * CELL_M
    least = reach + _KEPT_M + CELL_M
    near = distance >= least
    if not at_wall:
        near &= to_wall <= least + _REACH_M
    else:
        # Boxes and bins belong at walls; beside a chair they would be in the middle of a room.
        near &= _distance_to_walls(floor, distance >= least) <= least + _AT_WALL_M
    rows, columns = np.nonzero(near)
    for k in placing.rng.permutation(len(rows))[:12]:
        disc = _disc(floor.grid.shape, int(rows[k]), int(columns[k]), reach + CELL_M)
        # One way still joins all doors, where one did.
        if floor.has_ways and not doors_are_joined(
            with_body(floor.bitmap, disc, _WALK_M), floor.room
        ):
            continue
        x, z = floor.grid.plan_of(columns[k] + 0.5, rows[k] + 0.5)
        turn = _turn_from_wall(to_wall, int(rows[k]), int(columns[k]))
        placing.put(
            model,
            np.array([x, placing.room.floor_y + LIFT_M, z]),
            turn + float(placing.rng.normal(0, 0.2)),
        )
        floor.free &= ~disc
        floor.walkable &= ~disc
        floor.bitmap.occupied[disc] = True
        return True
    placing.refuse("no place on the floor")
    return False


def _distance_to_walls(floor: _Floor, cells: Bools) -> F64:
    """(H, W) metres from cells to real walls, or the room's outline in a home without."""
    distances = np.full(cells.shape, np.inf)
    room = floor.room
    near = shapely.intersection(room.walls, room.area.buffer(_NEAR_WALLS_M))
    near = room.area.boundary if near.is_empty else near
    distances[cells] = shapely.distance(shapely.points(floor.grid.centres()[cells]), near)
    return distances


def _disc(shape: tuple[int, int], row: int, column: int, radius_m: float) -> Bools:
    i, j = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((i - row) ** 2 + (j - column) ** 2 <= (radius_m / CELL_M) ** 2)


def _turn_from_wall(to_wall: F64, row: int, column: int) -> float:
    # Away from the nearest obstacle: up the gradient of the distance.
    i, j = slice(max(row - 2, 0), row + 3), slice(max(column - 2, 0), column + 3)
    part = to_wall[i, j]
    if min(part.shape) < 2:
        return 0.0
    down, right = np.gradient(part)
    return float(np.arctan2(right.mean(), down.mean()))
