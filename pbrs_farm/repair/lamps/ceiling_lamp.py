"""Position and shape of the lamp that repair adds to a room; no effects.

`ceiling_lamp` alone defines an added lamp: a glowing ball.
"""

from __future__ import annotations

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.classes import CEILING, LAMP, OTHERSTRUCTURE
from pbrs_farm.core.house import House, Item, ItemKind, LightPart, Room, corners_of_surfaces
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.mesh import distances_to_triangles
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.repair.lamps.bulbs import icosphere
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.prisms import polygons_of

ADDED_LAMP = "added"  # tag of every lamp that repair adds
_BELOW_CEILING_M = 0.2  # distance of the lamp's centre from the ceiling
_TALL_M = 0.5  # furniture that comes this near to the ceiling blocks its area for lamps
_OWN_WALL_M = 0.2  # maximum distance of a room's own walls inside its outline, metres
_HEAD_M = 1.9  # a lamp hangs this high above the floor where the ceiling does
_RADIUS_M = 0.1
_POWER = 0.5  # power of a lamp in Sweet Home 3D: its default
_LEAST_LM, _MOST_LM = 600.0, 10_000.0  # of one lamp: a small bulb, a chandelier
_ABOVE_FLOOR_M = 0.5  # structure lower than this is the floor
_GRID_M = 0.25  # spacing of the places tried below a sloped ceiling


def ceiling_lamp(
    house: House, room: Room, material: int, tag: str, flux_lm: float = 0.0
) -> Item | None:
    """A ball below the ceiling, in the centre of its largest free part.

    None if there is nothing above the room to hang it from: an attic without a roof. material: index
    of its bulb material. tag: reason for adding it; prefix of the item's id. flux_lm: its luminous
    flux, limited to that of one lamp; 0 = that of a lamp of Sweet Home 3D.
    """
    centre = place_of_lamp(house, room)
    if centre is None:
        return None
    radius = _RADIUS_M
    near = [i for i in house.items if _within_bounds(i, centre, 2 * radius)]
    # Shrink it until it touches nothing.
    for item in near:
        free = distances_to_triangles(centre, corners_of_surfaces(item.surfaces)).min()
        radius = max(min(radius, 0.9 * float(free)), 0.01)
    light = LightPart(
        position=triple(centre),
        radius_m=radius,
        power=min(max(flux_lm, _LEAST_LM), _MOST_LM) if flux_lm else _POWER,
        unit=PowerUnit.LUMEN if flux_lm else PowerUnit.SWEETHOME3D,
        emitting=(0,),
        escape=1.0,
    )
    return Item(
        id=f"{tag}_{room.id}",
        name=f"{tag} ceiling light",
        kind=ItemKind.LAMP,
        level_id=room.level_id,
        surfaces=(icosphere("bulb", centre, radius, material),),
        nyu40=LAMP,
        source_class=tag,
        room_id=room.id,
        lights=(light,),
        tags=tuple(dict.fromkeys((tag, ADDED_LAMP))),
    )


def place_of_lamp(house: House, room: Room) -> F64 | None:
    """(3,) centre of the largest circle in the room's ceiling clear of tall items: cupboards, and walls
    inside the room's outline, such as those of a bathroom drawn in it.

    Below the actual ceiling; if that is lower than a person or open to the sky, below its highest
    point. None if everything above is open.
    """
    # Take what reaches the ceiling out of the room's plan, unless nothing would be left.
    area = plan.polygon_of_room(room.polygon)
    free = plan.without(area, *(f for i in house.items if (f := _tall_footprint(i, room))))
    free = plan.without(free, *_walls_inside(house, room, area))
    largest = max(polygons_of(free) or polygons_of(area), key=lambda p: p.area)
    circle = shapely.get_coordinates(shapely.maximum_inscribed_circle(largest, 0.05))
    # Measure how high it is there, and look for a higher place if it is low.
    places = circle[:1]
    heights = _heights_to_hang_from(house, room, places)
    if not room.floor_y + _HEAD_M + _BELOW_CEILING_M <= heights[0] < np.inf:
        low, high = np.array(largest.bounds).reshape(2, 2)
        axes = [np.arange(low[k], high[k], _GRID_M) for k in range(2)]
        grid = np.stack([g.ravel() for g in np.meshgrid(*axes)], 1)
        inside = shapely.contains_xy(plan.grown(largest, -_RADIUS_M), grid[:, 0], grid[:, 1])
        places = np.concatenate([places, grid[inside]])
        heights = _heights_to_hang_from(house, room, places)
    is_under = np.isfinite(heights)
    if not is_under.any():
        return None
    best = int(np.argmax(np.where(is_under, np.minimum(heights, room.ceiling_y), -np.inf)))
    y = min(float(heights[best]), room.ceiling_y) - _BELOW_CEILING_M
    return np.array([places[best, 0], y, places[best, 1]])


def heights_above(house: House, room: Room, places: F64) -> F64:
    """(N,) y of the lowest structure above the room's floor at places (N, 2); inf = none.

    places: world (x, z), metres. Structure of all storeys counts, furniture does not; looked at
    from a little above the floor.
    """
    surfaces = [s for item in house.items if item.kind.is_structure for s in item.surfaces]
    triangles = corners_of_surfaces(surfaces)
    return lowest_above(places, triangles, room.floor_y + _ABOVE_FLOOR_M)


def _heights_to_hang_from(house: House, room: Room, places: F64) -> F64:
    """Like heights_above; if no part of the building is above, roofs that are items count."""
    heights = heights_above(house, room, places)
    is_open = np.isinf(heights)
    roofs = [s for i in house.items if i.nyu40 in (OTHERSTRUCTURE, CEILING) for s in i.surfaces]
    if is_open.any() and roofs:
        above = room.floor_y + _ABOVE_FLOOR_M
        heights[is_open] = lowest_above(places[is_open], corners_of_surfaces(roofs), above)
    return heights


def _tall_footprint(item: Item, room: Room) -> plan.Shape | None:
    """The plan area of a piece that reaches the ceiling's height in the room; None of others."""
    if item.kind.is_structure or not item.n_faces:
        return None
    low, high = item.bounds[:, 1]
    if high < room.ceiling_y - _TALL_M or low > room.ceiling_y:
        return None
    corners = item.oriented_box.corners[:, [0, 2]]
    return plan.on_grid(shapely.convex_hull(shapely.MultiPoint(corners)))


def _walls_inside(house: House, room: Room, area: plan.Shape) -> list[plan.Shape]:
    """Plan areas of full-height walls farther inside the room than its own walls."""
    inner = plan.grown(area, -_OWN_WALL_M)
    walls = []
    for item in house.items:
        if item.kind is not ItemKind.WALL or not item.n_faces or inner.is_empty:
            continue
        (x0, low, z0), (x1, high, z1) = item.bounds
        is_tall = low < room.floor_y + _HEAD_M and high > room.ceiling_y - _TALL_M
        if is_tall and inner.intersects(shapely.box(x0, z0, x1, z1)):
            walls += [
                plan.polygon_of_triangles(s.positions.astype(float), s.faces) for s in item.surfaces
            ]
    return walls


def _within_bounds(item: Item, point: F64, by_m: float) -> bool:
    low, high = item.bounds
    return bool(((point > low - by_m) & (point < high + by_m)).all())
