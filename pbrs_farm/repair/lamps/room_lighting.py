"""Lights of each room, and ceiling lights for rooms that need one; no effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Shape
from pbrs_farm.core.house import House, Item, LightPart, Material, MaterialKind, Opening, Room
from pbrs_farm.core.lighting import PowerUnit, flux_lm
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.home.lamps import flux_for_floor
from pbrs_farm.home.room_use import is_lived_in
from pbrs_farm.repair.lamps.ceiling_lamp import ADDED_LAMP, MOST_LM, ceiling_lamp, heights_above
from pbrs_farm.repair.lamps.lampshades import with_shades
from pbrs_farm.repair.measure.leaks import Occluder
from pbrs_farm.repair.structure import plan_geometry as plan

FALLBACK = "fallback"
_DIM = 0.25  # lamps with less than this share of the flux a room needs count as too dim
_LEAST_ESCAPE = 0.01  # light output ratio below which a lamp counts as none
_HEIGHT_SLACK_M = 0.05  # a lamp or opening may lie so far outside the room's heights
_BRIGHTER = "brighter"
_HUNG_M = 1.4  # a lamp over a table hangs this high above the floor
_AT_CEILING_M = 0.4  # maximum distance from the ceiling to the top of a lamp that hangs there
_BY_THE_ROOM_M = 0.6  # an opening nearer than this is in a wall of the room
_SKY_POINTS = 64  # points of a room without a ceiling from which rays go up
_LEAST_SKY = 0.1  # share of them with open sky from which the sky lights the room


@dataclass(frozen=True, slots=True)
class GivenLights:
    """Ids of the rooms that got a ceiling light or brighter ones."""

    fallback: tuple[str, ...]  # nothing lit them
    added: tuple[str, ...]  # rooms with daylight and either no lamp or too weak ones
    brightened: tuple[str, ...] = ()  # too weak lamps hung at the ceiling


def with_room_lighting(
    house: House,
    *,
    fallback: bool,
    in_every_room: bool = False,
    lamp_lx: float = 0.0,
    lamps_from: Callable[[], Catalogue] | None = None,
) -> tuple[House, GivenLights]:
    """Set Room.lit_by of every room, and add ceiling lights, at the end of the items, where needed.

    fallback: to each room with a floor, a ceiling and no light. in_every_room: to each living area
    without a lamp, regardless of daylight. Rooms open to the sky get none. lamp_lx: target
    illuminance of an added light on the floor. If a room's lamps have little of the required flux,
    those that hang at its ceiling become brighter; if none hangs there, the room gets a light for the
    rest. 0: all added lights are alike, and a room with any lamp gets none. lamps_from: loads the
    shapes of added lights.
    """
    rooms, added = list[Room](), list[tuple[Item, Shape]]()
    given: dict[str, list[str]] = {FALLBACK: [], ADDED_LAMP: [], _BRIGHTER: []}
    areas = [plan.polygon_of_room(r.polygon) for r in house.rooms]
    glazed = {i.id for i in house.items if _has_pane(i, house.materials)}
    boxes = _plan_boxes(house.items)
    items = list(house.items)
    lamps = [k for k, i in enumerate(items) if any(_shines(light) for light in i.lights)]
    for room, area in zip(house.rooms, areas, strict=True):
        lit_by = []
        near = _items_near(house, boxes, area)
        own_lm = sum(_flux_in(items[k], room, area) for k in lamps)
        wanted_lm = flux_for_floor(area.area, lamp_lx)
        if own_lm > 0:
            lit_by.append("lamps")
        if any(_opens_on(o, room, area, glazed) for o in house.openings):
            lit_by.append("windows")
        if not room.has_ceiling and _sees_sky(near, room, area):
            lit_by.append("sky")
        # Hang a light where neither lamp nor daylight reaches, and where people live without one.
        tag = ""
        if not lit_by and fallback and room.has_floor and room.has_ceiling and area.area > 0:
            tag = FALLBACK
        elif in_every_room and own_lm <= _DIM * wanted_lm and room.has_floor:
            tag = ADDED_LAMP if is_lived_in(room, area.area) else ""
        hung = [k for k in lamps if tag and _hangs_in(items[k], room, area)]
        if hung:
            # Make the room's own lamps brighter rather than hang another beside them.
            hung_lm = sum(_flux_in(items[k], room, area) for k in hung)
            for k in hung:
                items[k] = _brightened(items[k], room, area, 1 + (wanted_lm - own_lm) / hung_lm)
            tag = ""
            given[_BRIGHTER].append(room.id)
        catalogue = lamps_from() if tag and lamps_from else None
        rest_lm = max(wanted_lm - own_lm, 0.0)
        lamp = ceiling_lamp(near, room, tag, rest_lm, catalogue) if tag else None
        if lamp is not None:
            lit_by.append(tag)
            added.append(lamp)
            given[tag].append(room.id)
        elif tag == FALLBACK:
            # Nothing is above the room, whatever its source says.
            lit_by.append("sky")
        rooms.append(replace(room, lit_by=tuple(lit_by)))
    lighted = _with_added(replace(house, rooms=tuple(rooms), items=tuple(items)), added)
    return lighted, GivenLights(*(tuple(ids) for ids in given.values()))


def _with_added(house: House, added: Sequence[tuple[Item, Shape]]) -> House:
    """The house with lamps at the end of its items, and the materials and textures of their shapes."""
    items, materials, textures = list(house.items), list(house.materials), dict(house.textures)
    for item, shape in added:
        first = len(materials)
        surfaces = tuple(replace(s, material=s.material + first) for s in item.surfaces)
        items.append(replace(item, surfaces=surfaces))
        materials += shape.materials
        textures |= shape.textures
    return replace(house, items=tuple(items), materials=tuple(materials), textures=textures)


def with_measured_lamps(
    house: House, n_added: int, fields: RepairFields, occluder_from: Callable[[House], Occluder]
) -> House:
    """The house with its last n_added lamps measured, and brighter by what their shades keep in."""
    if not n_added:
        return house
    kept, lamps = house.items[:-n_added], house.items[-n_added:]
    # Structure near a lamp reflects its light; other lamps do not matter.
    structure = tuple(item for item in kept if item.kind.is_structure and not item.lights)
    alone = replace(house, items=(*structure, *lamps))
    shaded, _sources = with_shades(alone, (), fields, occluder_from)
    lamps = tuple(_compensated(item) for item in shaded.items[-n_added:])
    return replace(house, items=(*kept, *lamps), materials=shaded.materials)


def _compensated(item: Item) -> Item:
    lights = tuple(
        replace(light, power=min(light.power / (light.escape or 1.0), MOST_LM))
        if light.unit is PowerUnit.LUMEN
        else light
        for light in item.lights
    )
    return replace(item, lights=lights)


def _hangs_in(lamp: Item, room: Room, area: plan.Shape) -> bool:
    """True for a lamp that hangs at the room's ceiling and gives light to the room."""
    if not lamp.n_faces or _flux_in(lamp, room, area) <= 0:
        return False
    low, high = lamp.bounds[:, 1]
    return bool(low > room.floor_y + _HUNG_M and high > room.ceiling_y - _AT_CEILING_M)


def _brightened(lamp: Item, room: Room, area: plan.Shape, factor: float) -> Item:
    """The lamp with the flux of its sources in the room times a factor, up to that of one lamp."""
    lights = []
    for light in lamp.lights:
        if _flux_in(replace(lamp, lights=(light,)), room, area) > 0:
            whole_lm = flux_lm(light.power, light.unit, 1.0)
            power = max(min(whole_lm * factor, MOST_LM), whole_lm)
            light = replace(light, power=round(power, 1), unit=PowerUnit.LUMEN)
        lights.append(light)
    return replace(lamp, lights=tuple(lights))


def _plan_boxes(items: Sequence[Item]) -> F64:
    """(N, 2, 2) bounds in plan, as much larger as a turned box may be; NaN of an item without faces."""
    boxes = np.full((len(items), 2, 2), np.nan)
    for k, item in enumerate(items):
        if item.n_faces:
            low, high = item.bounds[:, [0, 2]]
            boxes[k] = low - (high - low).max(), high + (high - low).max()
    return boxes


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
