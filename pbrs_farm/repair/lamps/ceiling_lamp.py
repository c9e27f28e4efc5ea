"""Place and shape of an added lamp: a fitting `ceiling_lamp` of the catalogue, else a globe on a cord; no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.catalogue import Catalogue, Shape
from pbrs_farm.core.classes import CEILING, LAMP, OTHERSTRUCTURE
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    Room,
    corners_of_surfaces,
)
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.mesh import clipped_to_box, distances_to_triangles
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.geometry.solids import lathe
from pbrs_farm.repair.lamps.bulbs import icosphere
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.prisms import polygons_of

ADDED_LAMP = "added"  # tag of every lamp that repair adds
_GROUP: Final = "ceiling_lamp"  # of the catalogue
_LEAST_LM, MOST_LM = 600.0, 10_000.0  # of one lamp: a small bulb, a chandelier
_GLOBE_BELOW_CEILING_M = 0.2  # distance of a globe's centre from the ceiling
_TALL_M = 0.5  # furniture that comes this near to the ceiling blocks its area for lamps
_OWN_WALL_M = 0.2  # maximum distance of a room's own walls inside its outline, metres
_HEAD_M = 1.9  # a lamp hangs this high above the floor where the ceiling does
_RADIUS_M = 0.1
_POWER = 0.5  # power of a lamp in Sweet Home 3D: its default
_ABOVE_FLOOR_M = 0.5  # structure lower than this is the floor
_SLACK_M = 0.05  # between the drawn height of a ceiling and its mesh
_GRID_M = 0.25  # spacing of the places tried below a sloped ceiling
_FLAT_M = 0.2  # maximum height of a lamp close to the ceiling
_SMALL_M2 = 8.0  # rooms below this floor area take flat lamps first
_WIDEST = 0.3  # maximum width of a lamp, as a share of the room's shorter side
_AROUND_M = 0.03  # free space around a lamp
_GAP_M = 0.0005  # between a lamp and the ceiling: coincident faces flicker
_SCALES = (1.0, 0.75, 0.5)


def ceiling_lamp(
    house: House, room: Room, tag: str, flux_lm: float = 0.0, lamps: Catalogue | None = None
) -> tuple[Item, Shape] | None:
    """A lamp under the ceiling, in the centre of its largest free part, and its shape.

    None if there is nothing above the room to hang it from: an attic without a roof. The materials of
    the item's surfaces are indices into shape.materials. tag: reason for adding it; prefix of the item's
    id. flux_lm: its luminous flux, limited to that of one lamp; 0 = that of a lamp of Sweet Home 3D.
    """
    top = place_of_lamp(house, room)
    if top is None:
        return None
    fitting = _fitting_piece(lamps, house, room, top) if lamps else None
    shape, scale = fitting or (_globe(house, room, top), 1.0)
    at = top - [0.0, float(shape.bounds[1, 1]) * scale + _GAP_M, 0.0]
    surfaces = tuple(
        replace(s, positions=(s.positions * scale + at).astype(np.float32)) for s in shape.surfaces
    )
    power = min(max(flux_lm, _LEAST_LM), MOST_LM) if flux_lm else _POWER
    unit = PowerUnit.LUMEN if flux_lm else PowerUnit.SWEETHOME3D
    lights = tuple(
        replace(
            light,
            position=triple(np.array(light.position) * scale + at),
            radius_m=light.radius_m * scale,
            power=power,
            unit=unit,
            share=1.0 / len(shape.lights),
            rgb_linear=(1.0, 1.0, 1.0),  # the recipe draws the colour of white lamps
        )
        for light in shape.lights
    )
    item = Item(
        id=f"{tag}_{room.id}",
        name=f"{tag} ceiling light",
        kind=ItemKind.LAMP,
        level_id=room.level_id,
        surfaces=surfaces,
        nyu40=LAMP,
        source_class=tag,
        room_id=room.id,
        lights=lights,
        tags=tuple(dict.fromkeys((tag, ADDED_LAMP))),
    )
    return item, shape


def _fitting_piece(
    lamps: Catalogue, house: House, room: Room, top: F64
) -> tuple[Shape, float] | None:
    """The shape of a piece that fits below the ceiling at top (3,), and its scale; None if none does."""
    height = _heights_to_hang_from(house, room, top[None, [0, 2]])[0]
    if height > top[1] + _GAP_M:
        return None
    area = plan.polygon_of_room(room.polygon)
    x0, z0, x1, z1 = area.bounds
    widest = _WIDEST * min(x1 - x0, z1 - z0)
    pieces = lamps.of(_GROUP)
    # Draw an order; flat lamps first in small rooms, hanging ones first in others.
    rng = np.random.default_rng(keys.seed("added lamp", house.id, room.id))
    drawn = [pieces[int(k)] for k in rng.permutation(len(pieces))]
    drawn.sort(key=lambda piece: (piece.size[2] < _FLAT_M) != (area.area < _SMALL_M2))
    corners = corners_of_surfaces(s for item in house.items for s in item.surfaces)
    reach = max((max(piece.size) for piece in pieces), default=0.0) + _AROUND_M
    corners = clipped_to_box(corners, top - reach, top + reach)
    for scale in _SCALES:
        for piece in drawn:
            width, depth, tall = np.array(piece.size) * scale
            if max(width, depth) > widest or top[1] - tall < room.floor_y + _HEAD_M:
                continue
            if not _is_free(corners, top, np.array([width, tall, depth])):
                continue
            shape = lamps.shape(piece)
            if shape is not None and shape.lights:
                return shape, scale
    return None


def _is_free(corners: F64, top: F64, size: F64) -> bool:
    """True if no triangle (F, 3, 3) reaches into the box of a lamp that hangs from top (3,)."""
    half = size[[0, 2]] / 2 + _AROUND_M
    low = np.array([top[0] - half[0], top[1] - size[1] - _AROUND_M, top[2] - half[1]])
    high = np.array([top[0] + half[0], top[1] - _GAP_M, top[2] + half[1]])
    return not len(clipped_to_box(corners, low, high))


def _globe(house: House, room: Room, top: F64) -> Shape:
    """An opal globe on a cord to the structure above, as large as the items around it allow."""
    centre = top - [0.0, _GLOBE_BELOW_CEILING_M, 0.0]
    radius = _RADIUS_M
    for item in house.items:
        if _within_bounds(item, centre, 2 * radius):
            free = distances_to_triangles(centre, corners_of_surfaces(item.surfaces)).min()
            radius = max(min(radius, 0.9 * float(free)), 0.01)
    canopy = min(0.05, radius)
    height = float(_heights_to_hang_from(house, room, top[None, [0, 2]])[0]) - centre[1] + radius
    profile = [[0.0, 2 * radius], [0.004, 2 * radius], [0.004, height - 0.025]]
    profile += [[canopy, height - 0.02], [canopy, height], [0.0, height]]
    middle = np.array([0.0, radius, 0.0])
    return Shape(
        (icosphere("bulb", middle, radius, 0), lathe("cord", np.array(profile), np.zeros(3), 1)),
        (
            Material("fallback_bulb", kind=MaterialKind.BULB),
            Material("fallback_cord", diffuse=(0.5, 0.5, 0.5)),
        ),
        lights=(LightPart(triple(middle), radius, _POWER, PowerUnit.SWEETHOME3D, emitting=(0,)),),
    )


def place_of_lamp(house: House, room: Room) -> F64 | None:
    """(3,) place on the ceiling, in the centre of its largest circle clear of tall items: cupboards, and
    walls inside the room's outline, such as those of a bathroom drawn in it.

    On the actual ceiling; if that is lower than a person or open to the sky, below its highest
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
    if not room.floor_y + _HEAD_M + _GLOBE_BELOW_CEILING_M <= heights[0] < np.inf:
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
    y = float(heights[best])
    # A void above the room is no place for a lamp, a ceiling a little above its drawn height is.
    y = y if y < room.ceiling_y + _SLACK_M else room.ceiling_y
    return np.array([places[best, 0], y, places[best, 1]])


def heights_above(house: House, room: Room, places: F64) -> F64:
    """(N,) world y of the lowest structure above the room's floor at places (N, 2); inf without any."""
    surfaces = [s for item in house.items if item.kind.is_structure for s in item.surfaces]
    triangles = corners_of_surfaces(surfaces)
    return lowest_above(places, triangles, room.floor_y + _ABOVE_FLOOR_M)


def _heights_to_hang_from(house: House, room: Room, places: F64) -> F64:
    """Like heights_above; if no part of the building is above, roof items count."""
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
