"""Things on the floor: bins, bags, shoes, baskets, boxes near walls, never in anybody's way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.walkable import CELL_M
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.clutter.worktop import LIFT_M
from pbrs_farm.dress.generated.assembly import Made
from pbrs_farm.dress.space.flights import flights_of
from pbrs_farm.dress.space.floor_bitmaps import (
    FloorBitmap,
    doors_are_joined,
    floor_bitmap,
    with_body,
)
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.supports.find_supports import surroundings
from pbrs_farm.dress.supports.plan_grid import PlanGrid
from pbrs_farm.dress.supports.scene_triangles import SceneTriangles

_WALK_M = 0.65  # the width of a way, with something to spare
_REACH_M = 0.35  # a thing's middle is no farther from a wall or furniture
_KEPT_M = 0.04  # between things
_DOOR_M = 1.0  # kept free before doors
_HEAD_M = 1.9
_RUG_M = 0.03  # what is lower may lie anywhere, but carries nothing

# What stands on floors: kind, chance in a room.
_USUAL: dict[RoomKind, tuple[tuple[str, float], ...]] = {
    RoomKind.HALL: (("stool", 0.4), ("shoes", 0.8), ("shoes", 0.6), ("bag", 0.35), ("suitcase", 0.2), ("basket", 0.15)),
    RoomKind.LIVING: (("armchair", 0.85), ("armchair", 0.4), ("basket", 0.5), ("pouf", 0.55), ("toy", 0.35), ("bag", 0.25), ("storage_box", 0.25)),
    RoomKind.BEDROOM: (("armchair", 0.4), ("stool", 0.4), ("laundry_basket", 0.4), ("suitcase", 0.25), ("pouf", 0.25), ("basket", 0.4), ("shoes", 0.45), ("toy", 0.3), ("bag", 0.3), ("storage_box", 0.3), ("bin", 0.2)),
    RoomKind.KITCHEN: (("stool", 0.5), ("bin", 0.75), ("bag", 0.25), ("bottle", 0.25), ("carton", 0.12)),
    RoomKind.DINING: (("basket", 0.25), ("toy", 0.2), ("bag", 0.2)),
    RoomKind.BATHROOM: (("stool", 0.45), ("laundry_basket", 0.5), ("basket", 0.4), ("bin", 0.5), ("shoes", 0.15)),
    RoomKind.OFFICE: (("armchair", 0.4), ("stool", 0.4), ("bin", 0.8), ("carton", 0.4), ("bag", 0.4), ("storage_box", 0.4)),
    RoomKind.STORE: (("cartons", 0.8), ("carton", 0.8), ("storage_box", 0.6), ("basket", 0.3), ("bag", 0.3), ("shoes", 0.4)),
    RoomKind.OTHER: (("armchair", 0.5), ("stool", 0.3), ("carton", 0.3), ("basket", 0.4), ("bag", 0.2)),
    RoomKind.OUTDOOR: (("plant_pot", 0.5), ("plant_pot", 0.3)),
}  # fmt: skip


@dataclass(slots=True)
class _Floor:
    # Cells of a room's floor while things are put there.
    room: RoomSpace
    bitmap: FloorBitmap
    grid: PlanGrid  # of the same cells
    free: Bools  # nothing stands there, no door needs it
    walkable: Bools  # nothing stands there
    has_ways: bool  # one way joins the room's doors


def fill_floor(placing: Placing, scene: SceneTriangles, space: HouseSpace, room: RoomSpace) -> int:
    """Put things on the floor of a room; how many."""
    rng = placing.rng
    # Draw what the room usually has before its floor is looked at, which costs more.
    wanted = [
        kind for kind, chance in _USUAL.get(room.kind, ()) if rng.random() < chance * placing.share
    ]
    floor = _floor(scene, space, room) if wanted else None
    flights = flights_of(placing.draft, room.room, room.area)
    if floor is not None and not flights.before.is_empty:
        plan = floor.grid.centres()
        floor.free &= ~shapely.contains_xy(flights.before, plan[..., 0], plan[..., 1])
    if floor is None or not floor.free.any():
        return 0
    n = 0
    for kind in wanted:
        made = placing.stock.take(rng, kind, placing.style)
        if made is not None:
            n += _put(placing, floor, made)
    return n


def _floor(scene: SceneTriangles, space: HouseSpace, room: RoomSpace) -> _Floor | None:
    if room.area.is_empty or room.room.polygon.shape[0] < 3:
        return None
    y = room.room.floor_y
    bitmap = floor_bitmap(space, room)
    grid = PlanGrid(np.asarray(bitmap.origin), 0.0, CELL_M, bitmap.inside.shape)
    plan = grid.centres()
    around = surroundings(scene, -1, grid, y)
    hits, inside = around.hits, bitmap.inside & ~around.solid
    # Rugs carry nothing, but one walks over them.
    stands = (hits.low < y + _HEAD_M) & (hits.high > y + 0.002)
    blocks = stands & (hits.high > y + _RUG_M)
    low, body = np.zeros(grid.shape, np.bool_), np.zeros(grid.shape, np.bool_)
    low[hits.row[stands], hits.column[stands]] = True
    body[hits.row[blocks], hits.column[blocks]] = True
    walkable = inside & ~body
    # Keep a metre before doors and windows that reach the floor.
    kept = np.zeros(grid.shape, np.bool_)
    for passage in (*room.doors, *(w for w in room.windows if w.bottom_y < y + 0.4)):
        side = passage.side_of(room.room.id)
        if side is None:
            continue
        zone = passage.before(side, _DOOR_M).union(passage.swing(side)).buffer(CELL_M)
        kept |= shapely.contains_xy(zone, plan[..., 0], plan[..., 1])
    joined = doors_are_joined(bitmap, room)
    return _Floor(room, bitmap, grid, inside & ~low & ~kept, walkable, joined)


def _put(placing: Placing, floor: _Floor, made: Made) -> bool:
    low, high = made[1].bounds
    reach = float(np.hypot(high[0] - low[0], high[2] - low[2])) / 2
    # Its middle keeps from everything by its own radius, but not much more.
    distance = ndimage.distance_transform_edt(np.pad(floor.free, 1))[1:-1, 1:-1] * CELL_M
    to_wall = ndimage.distance_transform_edt(np.pad(floor.walkable, 1))[1:-1, 1:-1] * CELL_M
    least = reach + _KEPT_M + CELL_M
    rows, columns = np.nonzero((distance >= least) & (to_wall <= least + _REACH_M))
    for k in placing.rng.permutation(len(rows))[:12]:
        disc = _disc(floor.grid.shape, int(rows[k]), int(columns[k]), reach + CELL_M)
        # One way still joins all doors, where one did.
        if floor.has_ways and not doors_are_joined(
            with_body(floor.bitmap, disc, _WALK_M), floor.room
        ):
            continue
        x, z = floor.grid.plan_of(columns[k] + 0.5, rows[k] + 0.5)
        turn = _facing(to_wall, int(rows[k]), int(columns[k]))
        placing.put(
            made, np.array([x, placing.room.floor_y + LIFT_M, z]),
            turn + float(placing.rng.normal(0, 0.2)),
        )  # fmt: skip
        floor.free &= ~disc
        floor.walkable &= ~disc
        floor.bitmap.occupied[disc] = True
        return True
    placing.refuse("no place on the floor")
    return False


def _disc(shape: tuple[int, int], row: int, column: int, radius_m: float) -> Bools:
    i, j = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((i - row) ** 2 + (j - column) ** 2 <= (radius_m / CELL_M) ** 2)


def _facing(to_wall: F64, row: int, column: int) -> float:
    # Away from what is nearest: up the slope of the distance.
    i, j = slice(max(row - 2, 0), row + 3), slice(max(column - 2, 0), column + 3)
    part = to_wall[i, j]
    if min(part.shape) < 2:
        return 0.0
    down, right = np.gradient(part)
    return float(np.arctan2(right.mean(), down.mean()))
