"""What lights each room, and a ceiling light where nothing does; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    Opening,
    Room,
)
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.mesh import distances_to_triangles
from pbrs_farm.repair.lamps.bulbs import icosphere, triangles_of
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import F64
from pbrs_farm.repair.structure.prisms import polygons_of

LAMP_NYU40 = 35  # class "lamp" of NYU40
FALLBACK = "fallback"
_BELOW_CEILING_M = 0.2  # centre of the fallback light
_RADIUS_M = 0.1
_POWER = 0.5  # of a lamp in Sweet Home 3D, the default there
_LEAST_ESCAPE = 0.01  # light output ratio below which a lamp counts as none
_BY_THE_ROOM_M = 0.6  # an opening nearer than this is in a wall of the room


def with_room_lighting(house: House, *, fallback: bool) -> tuple[House, list[str]]:
    """Room.lit_by of every room; and a light in each that has a floor, a ceiling and no light.

    Second: ids of the rooms that got one. fallback False: none does.
    """
    rooms, lights, given = [], [], []
    areas = [plan.polygon_of_room(r.polygon) for r in house.rooms]
    glazed = {i.id for i in house.items if _has_pane(i, house.materials)}
    lamps = [i for i in house.items if any(_shines(light) for light in i.lights)]
    for room, area in zip(house.rooms, areas, strict=True):
        lit_by = []
        if any(_lights(lamp, room, area) for lamp in lamps):
            lit_by.append("lamps")
        if any(_opens_on(o, room, area, glazed) for o in house.openings):
            lit_by.append("windows")
        # Hang a light where neither lamp nor daylight reaches.
        if not lit_by and fallback and room.has_floor and room.has_ceiling:
            lit_by.append(FALLBACK)
            lights.append(_fallback_light(house, room, area, len(house.materials)))
            given.append(room.id)
        rooms.append(replace(room, lit_by=tuple(lit_by)))
    materials = house.materials
    if lights:
        materials = (*materials, Material("fallback_bulb", kind=MaterialKind.BULB))
    items = (*house.items, *lights)
    return replace(house, rooms=tuple(rooms), items=items, materials=materials), given


def _has_pane(item: Item, materials: Sequence[Material]) -> bool:
    return any(materials[s.material].kind is MaterialKind.PANE for s in item.surfaces)


def _lights(lamp: Item, room: Room, area: plan.Shape) -> bool:
    return any(
        room.floor_y - 0.05 <= light.position[1] <= room.ceiling_y + 0.05
        and shapely.contains_xy(area, light.position[0], light.position[2])
        for light in lamp.lights
        if _shines(light)
    )


def _shines(light: LightPart) -> bool:
    # A lamp whose light the ceiling or its own body keeps lights no room.
    return light.power > 0 and (light.escape is None or light.escape >= _LEAST_ESCAPE)


def _opens_on(opening: Opening, room: Room, area: plan.Shape, glazed: set[str]) -> bool:
    # Accept a window, or a door with glass, in a wall of this room.
    if not opening.is_window and opening.item_id not in glazed:
        return False
    middle = opening.quad.mean(0)
    if not room.floor_y - 0.05 <= middle[1] <= room.ceiling_y + 0.05:
        return False
    return bool(area.distance(shapely.Point(middle[0], middle[2])) < _BY_THE_ROOM_M)


def _fallback_light(house: House, room: Room, area: plan.Shape, material: int) -> Item:
    """A ball below the ceiling, as near the middle of the room as nothing stands in its way."""
    # Hang it in the middle of the largest circle in the plan.
    largest = max(polygons_of(area), key=lambda p: p.area)
    circle = shapely.get_coordinates(shapely.maximum_inscribed_circle(largest, 0.05))
    x, z = circle[0]
    centre = np.array([x, room.ceiling_y - _BELOW_CEILING_M, z])
    radius = _RADIUS_M
    near = [i for i in house.items if _within(i, centre, 2 * radius)]
    # Shrink it until it touches nothing.
    for item in near:
        free = distances_to_triangles(centre, triangles_of(item)).min()
        radius = max(min(radius, 0.9 * float(free)), 0.01)
    light = LightPart(
        position=(float(centre[0]), float(centre[1]), float(centre[2])),
        radius_m=radius,
        power=_POWER,
        unit=PowerUnit.SWEETHOME3D,
        emitting=(0,),
        escape=1.0,
    )
    return Item(
        id=f"{FALLBACK}_{room.id}",
        name="fallback ceiling light",
        kind=ItemKind.LAMP,
        level_id=room.level_id,
        surfaces=(icosphere("bulb", centre, radius, material),),
        nyu40=LAMP_NYU40,
        source_class=FALLBACK,
        room_id=room.id,
        lights=(light,),
        tags=(FALLBACK,),
    )


def _within(item: Item, point: F64, by_m: float) -> bool:
    low, high = item.bounds
    return bool(((point > low - by_m) & (point < high + by_m)).all())
