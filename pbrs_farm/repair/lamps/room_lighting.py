"""What lights each room, and a ceiling light where nothing does or no lamp is; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.classes import LAMP
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    Opening,
    Room,
    corners_of_surfaces,
)
from pbrs_farm.core.lighting import PowerUnit, flux_lm
from pbrs_farm.core.mesh import distances_to_triangles
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.home.lamps import flux_for_floor
from pbrs_farm.home.room_use import is_lived_in
from pbrs_farm.repair.lamps.bulbs import icosphere
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.prisms import polygons_of

# The lamp that repair hangs in a room: where, and what it looks like.
# `ceiling_lamp` is the one place that says what an added lamp is: a ball of light.


ADDED_LAMP = "added"  # tag of every lamp that repair adds
_BELOW_CEILING_M = 0.2  # centre of the lamp
_TALL_M = 0.5  # what reaches this near the ceiling takes part of it
_OWN_WALL_M = 0.2  # a room's own walls may stand so far inside its outline
_HEAD_M = 1.9  # a lamp hangs this high above the floor where the ceiling does
_RADIUS_M = 0.1
_POWER = 0.5  # of a lamp in Sweet Home 3D, the default there
_LEAST_LM, _MOST_LM = 600.0, 10_000.0  # of one lamp: a small bulb, a chandelier
_ABOVE_FLOOR_M = 0.5  # structure lower than this is the floor
_GRID_M = 0.25  # of places tried below a sloped ceiling


def ceiling_lamp(house: House, room: Room, material: int, tag: str, flux_lm: float = 0.0) -> Item:
    """A ball below the ceiling, in the middle of the largest part of it that is free.

    material: index of its bulb material. tag: why it was added; begins the item's id. flux_lm: its
    luminous flux, kept within what one lamp gives; 0 = that of a lamp of Sweet Home 3D.
    """
    centre = place_of_lamp(house, room)
    radius = _RADIUS_M
    near = [i for i in house.items if _within(i, centre, 2 * radius)]
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


def place_of_lamp(house: House, room: Room) -> F64:
    """(3,) middle of the largest circle in the room's ceiling that nothing tall takes part of:
    no cupboard, and no wall that stands inside the room's outline, as of a bathroom drawn in it.

    Below the ceiling that is really there; where that is too low for a head, below its highest
    place.
    """
    # Take what reaches the ceiling out of the room's plan, unless nothing would be left.
    area = plan.polygon_of_room(room.polygon)
    free = plan.without(area, *(f for i in house.items if (f := _tall_footprint(i, room))))
    free = plan.without(free, *_walls_inside(house, room, area))
    largest = max(polygons_of(free) or polygons_of(area), key=lambda p: p.area)
    circle = shapely.get_coordinates(shapely.maximum_inscribed_circle(largest, 0.05))
    # Measure how high it is there, and look for a higher place if it is low.
    places = circle[:1]
    heights = heights_above(house, room, places)
    if heights[0] < room.floor_y + _HEAD_M + _BELOW_CEILING_M:
        low, high = np.array(largest.bounds).reshape(2, 2)
        axes = [np.arange(low[k], high[k], _GRID_M) for k in range(2)]
        grid = np.stack([g.ravel() for g in np.meshgrid(*axes)], 1)
        inside = shapely.contains_xy(plan.grown(largest, -_RADIUS_M), grid[:, 0], grid[:, 1])
        places = np.concatenate([places, grid[inside]])
        heights = heights_above(house, room, places)
    best = int(np.argmax(np.minimum(heights, room.ceiling_y)))
    y = min(float(heights[best]), room.ceiling_y) - _BELOW_CEILING_M
    return np.array([places[best, 0], y, places[best, 1]])


def heights_above(house: House, room: Room, places: F64) -> F64:
    """(N,) y of the lowest structure above the room's floor at places (N, 2); inf = none."""
    surfaces = [s for item in house.items if item.kind.is_structure for s in item.surfaces]
    triangles = corners_of_surfaces(surfaces)
    return lowest_above(places, triangles, room.floor_y + _ABOVE_FLOOR_M)


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
    """The plan areas of walls as high as the room that stand farther inside it than its own."""
    inner = plan.grown(area, -_OWN_WALL_M)
    found = []
    for item in house.items:
        if item.kind is not ItemKind.WALL or not item.n_faces or inner.is_empty:
            continue
        (x0, low, z0), (x1, high, z1) = item.bounds
        is_tall = low < room.floor_y + _HEAD_M and high > room.ceiling_y - _TALL_M
        if is_tall and inner.intersects(shapely.box(x0, z0, x1, z1)):
            found += [
                plan.polygon_of_triangles(s.positions.astype(float), s.faces) for s in item.surfaces
            ]
    return found


def _within(item: Item, point: F64, by_m: float) -> bool:
    low, high = item.bounds
    return bool(((point > low - by_m) & (point < high + by_m)).all())


# What lights each room, and a ceiling light where nothing does or no lamp is.


FALLBACK = "fallback"
_WEAK = 0.25  # share of the flux a room wants, up to which its own lamps are too weak
_LEAST_ESCAPE = 0.01  # light output ratio below which a lamp counts as none
_HEIGHT_SLACK_M = 0.05  # a lamp or opening may lie so far outside the room's heights
_BY_THE_ROOM_M = 0.6  # an opening nearer than this is in a wall of the room
_SKY_POINTS = 64  # of a room without a ceiling, looked up from
_LEAST_SKY = 0.1  # share of them that see no structure above


@dataclass(frozen=True, slots=True)
class GivenLights:
    """Ids of the rooms that got a ceiling light."""

    fallback: tuple[str, ...]  # nothing lit them
    added: tuple[str, ...]  # they had daylight and no lamp, or lamps that are too weak


def with_room_lighting(
    house: House, *, fallback: bool, in_every_room: bool = False, lamp_lx: float = 0.0
) -> tuple[House, GivenLights]:
    """Room.lit_by of every room, and a ceiling light in each that lacks one.

    fallback: in each room that has a floor, a ceiling and no light. in_every_room: in each that
    people live in and that has no lamp of its own, whatever daylight it has. lamp_lx: what an
    added light aims at on the floor; a room whose own lamps have little of the flux for that gets
    one for the rest. 0: all lights are alike, and a room with any lamp gets none.
    """
    rooms, lights = [], []
    given: dict[str, list[str]] = {FALLBACK: [], ADDED_LAMP: []}
    areas = [plan.polygon_of_room(r.polygon) for r in house.rooms]
    glazed = {i.id for i in house.items if _has_pane(i, house.materials)}
    lamps = [i for i in house.items if any(_shines(light) for light in i.lights)]
    boxes = _plan_boxes(house.items)
    for room, area in zip(house.rooms, areas, strict=True):
        lit_by = []
        here = _items_near(house, boxes, area)
        own_lm = sum(_flux_in(lamp, room, area) for lamp in lamps)
        wanted_lm = flux_for_floor(area.area, lamp_lx)
        if own_lm > 0:
            lit_by.append("lamps")
        if any(_opens_on(o, room, area, glazed) for o in house.openings):
            lit_by.append("windows")
        if not room.has_ceiling and _sees_sky(here, room, area):
            lit_by.append("sky")
        # Hang a light where neither lamp nor daylight reaches, and where people live without one.
        tag = ""
        if not lit_by and fallback and room.has_floor and room.has_ceiling and area.area > 0:
            tag = FALLBACK
        elif in_every_room and own_lm <= _WEAK * wanted_lm and room.has_floor:
            tag = ADDED_LAMP if is_lived_in(room, area.area) else ""
        if tag:
            lit_by.append(tag)
            rest_lm = max(wanted_lm - own_lm, 0.0)
            lights.append(ceiling_lamp(here, room, len(house.materials), tag, rest_lm))
            given[tag].append(room.id)
        rooms.append(replace(room, lit_by=tuple(lit_by)))
    materials = house.materials
    if lights:
        materials = (*materials, Material("fallback_bulb", kind=MaterialKind.BULB))
    lighted = replace(house, rooms=tuple(rooms), items=(*house.items, *lights), materials=materials)
    return lighted, GivenLights(tuple(given[FALLBACK]), tuple(given[ADDED_LAMP]))


def _plan_boxes(items: Sequence[Item]) -> F64:
    """(N, 2, 2) bounds in plan, as much larger as a turned box may be; NaN of an item without faces."""
    found = np.full((len(items), 2, 2), np.nan)
    for k, item in enumerate(items):
        if item.n_faces:
            low, high = item.bounds[:, [0, 2]]
            found[k] = low - (high - low).max(), high + (high - low).max()
    return found


def _items_near(house: House, boxes: F64, area: plan.Shape) -> House:
    """The house with the items alone that may reach over a room's area."""
    x0, z0, x1, z1 = area.bounds if area.area > 0 else (np.nan,) * 4
    meets = (boxes[:, 0] <= [x1, z1]).all(1) & (boxes[:, 1] >= [x0, z0]).all(1)
    return house.with_items([house.items[k] for k in np.flatnonzero(meets)])


def _sees_sky(house: House, room: Room, area: plan.Shape) -> bool:
    """Whether a part of the room has no structure above: it is open to the sky."""
    low, high = np.array(area.bounds).reshape(2, 2) if area.area > 0 else np.zeros((2, 2))
    points = low + (high - low) * np.random.default_rng(0).random((4 * _SKY_POINTS, 2))
    points = points[shapely.contains_xy(area, points[:, 0], points[:, 1])][:_SKY_POINTS]
    if not len(points):
        return False
    return bool(np.isinf(heights_above(house, room, points)).mean() > _LEAST_SKY)


def _has_pane(item: Item, materials: Sequence[Material]) -> bool:
    return any(materials[s.material].kind is MaterialKind.PANE for s in item.surfaces)


def _flux_in(lamp: Item, room: Room, area: plan.Shape) -> float:
    """Luminous flux in lm that the lamp's sources in the room send out of it."""
    return sum(
        flux_lm(light.power, light.unit, light.share)
        * (1 if light.escape is None else light.escape)
        for light in lamp.lights
        if _shines(light)
        and _is_between(room, light.position[1])
        and shapely.contains_xy(area, light.position[0], light.position[2])
    )


def _is_between(room: Room, y: float) -> bool:
    """Whether a height is between the room's floor and its ceiling, or almost."""
    return room.floor_y - _HEIGHT_SLACK_M <= y <= room.ceiling_y + _HEIGHT_SLACK_M


def _shines(light: LightPart) -> bool:
    # A lamp whose light the ceiling or its own body keeps lights no room.
    return light.power > 0 and (light.escape is None or light.escape >= _LEAST_ESCAPE)


def _opens_on(opening: Opening, room: Room, area: plan.Shape, glazed: set[str]) -> bool:
    # Accept a window, or a door with glass, in a wall of this room.
    if not opening.is_window and opening.item_id not in glazed:
        return False
    middle = opening.quad.mean(0)
    if not _is_between(room, float(middle[1])):
        return False
    return bool(area.distance(shapely.Point(middle[0], middle[2])) < _BY_THE_ROOM_M)
