"""Floors or ceilings for stairwells between rooms, which people draw without a room; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import shapely

from pbrs_farm.core.house import House, ItemKind, Room
from pbrs_farm.repair.measure.enclosure import bare_area
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.planar_surfaces import Cover, PlanarSurface
from pbrs_farm.repair.structure.prisms import polygons_of
from pbrs_farm.repair.structure.slabs import GAP_M
from pbrs_farm.repair.structure.walls import Wall

_MIN_AREA_M2 = 0.05  # a smaller hole is a gap in the drawing
_NEIGHBOUR_M = 0.6  # a floor farther away is not carried on


@dataclass(frozen=True, slots=True, eq=False)
class Stairwells:
    """Stairwells as rooms, with their added floors and ceilings."""

    wells: tuple[Room, ...]  # ids "well_<level>_<k>"
    surfaces: tuple[PlanarSurface, ...]


def stairwells_of_house(
    house: House, walls: Sequence[Wall], surfaces: Sequence[PlanarSurface], covers: Sequence[Cover]
) -> Stairwells:
    """Holes with stairs among a level's rooms and walls, their covers continued from the nearest."""
    wells = [
        Room(
            id=f"well_{level_id}_{k}",
            name="stairwell",
            level_id=level_id,
            polygon=shapely.get_coordinates(hole.exterior)[:-1],
            floor_y=floor_y,
            ceiling_y=ceiling_y,
        )
        for level_id in dict.fromkeys(r.level_id for r in house.rooms)
        for k, (hole, floor_y, ceiling_y) in enumerate(_holes(house, level_id, walls))
    ]
    rooms = (*house.rooms, *wells)
    added = []
    for well in wells:
        for above in (False, True):
            # Extend the nearest floor or ceiling where the stairwell has none.
            bare = bare_area(well, rooms, covers, above=above)
            if bare.area > _MIN_AREA_M2:
                added += _continued(bare, well, surfaces, is_ceiling=above)
    return Stairwells(tuple(wells), tuple(added))


def _holes(
    house: House, level_id: str, walls: Sequence[Wall]
) -> Iterator[tuple[shapely.Polygon, float, float]]:
    rooms = [r for r in house.rooms if r.level_id == level_id]
    floor_y = min(r.floor_y for r in rooms)
    ceiling_y = max(r.ceiling_y for r in rooms)
    # Merge the rooms and walls of this level.
    feet = [w.footprint for w in walls if w.bottom_y < ceiling_y - 0.1 and w.high_y > floor_y + 0.1]
    # A stairwell stored as a room of two storeys is not a hole of this level.
    middle_y = (floor_y + ceiling_y) / 2
    through = [r for r in house.rooms if r.floor_y < middle_y < r.ceiling_y]
    areas = [plan.polygon_of_room(r.polygon) for r in {r.id: r for r in rooms + through}.values()]
    whole = plan.closed(plan.union([*areas, *feet]), 2 * GAP_M)
    stairs = [
        # Boxes of stairs that begin or end here.
        shapely.box(low[0], low[2], high[0], high[2])
        for low, high in (i.bounds for i in house.items if i.kind is ItemKind.STAIRS)
        if low[1] < ceiling_y and high[1] > floor_y - 0.2
    ]
    # Keep the holes with stairs in them.
    for polygon in polygons_of(whole):
        for ring in polygon.interiors:
            hole = shapely.Polygon(ring)
            if hole.area > _MIN_AREA_M2 and any(s.intersects(hole) for s in stairs):
                yield shapely.orient_polygons(hole), floor_y, ceiling_y


def _continued(
    area: plan.Shape, well: Room, surfaces: Sequence[PlanarSurface], *, is_ceiling: bool
) -> list[PlanarSurface]:
    low, high = well.floor_y - GAP_M, well.ceiling_y + GAP_M
    near = [
        s
        for s in surfaces
        if s.is_ceiling == is_ceiling
        and s.area.distance(area) < _NEIGHBOUR_M
        and low < s.plane.at(shapely.get_coordinates(s.area)).mean() < high
    ]
    if not near:
        return []
    nearest = min(near, key=lambda s: s.area.distance(area))
    return [replace(nearest, area=p) for p in polygons_of(area)]
