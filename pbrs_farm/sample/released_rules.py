"""Where the published data's sampler let a camera be (docs/spec/suncg.md section 3.2 b, c); no effects."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Geometry, House, Item, ItemKind, Room, corners_of_surfaces
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.candidates import Candidates, Grid
from pbrs_farm.sample.eye_probes import ItemCounter

_MASK_CELL_M = 0.05  # cell of the mask where the clearance is 0
_MAX_MASK_CELL_M = 0.1  # otherwise half the clearance, at most this


def room_grid(house: House, room: Room) -> Grid:
    """The grid over the box of a room and all its objects; heights count from the box's bottom."""
    (x0, z0), (x1, z1) = room.polygon.min(0), room.polygon.max(0)
    low, high = np.array([x0, room.floor_y, z0]), np.array([x1, room.ceiling_y, z1])
    for item in _items_of(house, room):
        bounds = item.bounds
        low, high = np.fmin(low, bounds[0]), np.fmax(high, bounds[1])
    return Grid(float(low[0]), float(low[2]), float(high[0]), float(high[2]), float(low[1]))


def rejections(
    house: House,
    room: Room,
    fields: CameraFields,
    candidates: Candidates,
    geometry: Geometry,
    counter: ItemCounter,
) -> NDArray[np.uint8]:
    """(N,) verdict as published: off the floor's mask, on an obstacle's projection, or LOWER_SCORE."""
    verdict = np.full(len(candidates), Verdict.LOWER_SCORE, np.uint8)
    # Read the masks between their nodes, as the published program did.
    top = max((i.bounds[1, 1] for i in _items_of(house, room)), default=room.ceiling_y)
    floor, allowed, cell = viewpoint_mask(house, room, fields.clearance_m)
    grid = room_grid(house, room)
    x = (candidates.eye[:, 0] - grid.x_min) / cell
    z = (candidates.eye[:, 2] - grid.z_min) / cell
    verdict[_bilinear(allowed, x, z) < 0.5] = Verdict.NEAR_OBSTACLE
    outside = (_bilinear(floor, x, z) < 0.5) | (candidates.eye[:, 1] > max(top, room.ceiling_y))
    verdict[outside] = Verdict.OUTSIDE_ROOM
    return verdict


def viewpoint_mask(house: House, room: Room, clearance_m: float) -> tuple[Bools, Bools, float]:
    """(floor, allowed, cell): bool grids (n_z, n_x) of nodes every cell metres over room_grid.

    Floor: above the room's floor. Allowed: floor without the plan projection of any triangle between floor
    top and ceiling bottom, of walls, this room's objects and loose boxes (triangles across the grid's edge
    are skipped, as in the original); eroded by a positive clearance. A grid under 3 nodes a side allows
    nothing.
    """
    grid = room_grid(house, room)
    cell = min(clearance_m / 2, _MAX_MASK_CELL_M) if clearance_m > 0 else _MASK_CELL_M
    xs = np.arange(grid.x_min, grid.x_max + cell, cell)
    zs = np.arange(grid.z_min, grid.z_max + cell, cell)
    nodes = np.stack(np.meshgrid(xs, zs), axis=-1).reshape(-1, 2)
    shape = (len(zs), len(xs))

    # Area of the room's own floor, else its polygon.
    floors = [i for i in _items_of(house, room) if i.kind is ItemKind.FLOOR]
    ceilings = [i for i in _items_of(house, room) if i.kind is ItemKind.CEILING]
    floor_top = max((i.bounds[1, 1] for i in floors), default=room.floor_y)
    ceiling_bottom = min((i.bounds[0, 1] for i in ceilings), default=room.ceiling_y)
    if floors:
        floor = _nodes_near_shapes(nodes, _plan_shapes(_triangles(floors)), 0.0)
    else:
        floor = shapely.intersects_xy(room_shape(room), nodes[:, 0], nodes[:, 1])

    # Block what any triangle between floor and ceiling covers in plan.
    triangles = _triangles([i for i in house.items if _is_obstacle(i, room)])
    eps = 1e-3  # triangles that only touch floor or ceiling block nothing
    y = triangles[:, :, 1]
    plan_low, plan_high = triangles.min(1)[:, [0, 2]], triangles.max(1)[:, [0, 2]]
    in_height = (y.max(1) > floor_top + eps) & (y.min(1) < ceiling_bottom - eps)
    in_height &= (plan_low >= (xs[0], zs[0])).all(1) & (plan_high <= (xs[-1], zs[-1])).all(1)
    blocked = _nodes_near_shapes(nodes, _plan_shapes(triangles[in_height]), cell / 2)

    # Erode by the clearance.
    allowed = (floor & ~blocked).reshape(shape)
    if min(shape) < 3:
        allowed[:] = False
    if clearance_m > 0:
        allowed = (
            ndimage.distance_transform_edt(np.pad(allowed, 1))[1:-1, 1:-1] * cell > clearance_m
        )
    return floor.reshape(shape), allowed, cell


def _items_of(house: House, room: Room) -> list[Item]:
    return [i for i in house.items if i.room_id == room.id and i.n_faces]


def _is_obstacle(item: Item, room: Room) -> bool:
    if item.kind in (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND):
        return False
    loose = item.room_id is None and (item.kind is ItemKind.WALL or "box" in item.tags)
    return item.room_id == room.id or loose


def _triangles(items: list[Item]) -> F64:
    return corners_of_surfaces(s for i in items for s in i.surfaces)


def _plan_shapes(triangles: F64) -> NDArray[np.object_]:
    """Plan projections (x, z): triangles, or lines for vertical ones."""
    plan = triangles[:, :, [0, 2]]
    e, f = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
    upright = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]) < 1e-9
    ring = plan[:, [0, 1, 2, 0]]
    shapes = np.empty(len(plan), np.object_)
    shapes[upright] = shapely.linestrings(ring[upright])
    shapes[~upright] = shapely.polygons(ring[~upright])
    return shapes


def _nodes_near_shapes(nodes: F64, shapes: NDArray[np.object_], distance: float) -> Bools:
    near = np.zeros(len(nodes), np.bool_)
    if len(shapes):
        points = shapely.points(nodes)
        hits = shapely.STRtree(shapes).query(points, predicate="dwithin", distance=distance)
        near[hits[0]] = True
    return near


def _bilinear(mask: Bools, x: F64, z: F64) -> F64:
    return np.asarray(
        ndimage.map_coordinates(mask.astype(np.float64), [z, x], order=1, mode="constant", cval=0.0)
    )
