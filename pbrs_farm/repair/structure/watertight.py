"""Walls, floors and ceilings united to one solid that light cannot pass, with openings cut; no effects.

The area of each is measured before and after. A wall is measured from the side, along its thickness, with its openings
already cut out: the difference is the area that repair cut away. Floors and ceilings are measured from above.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.house import House, Item, ItemKind, Opening, Room, Surface
from pbrs_farm.repair.measure.enclosure import Space, bare_area, spaces_of_rooms
from pbrs_farm.repair.measure.room_interiors import RoomInterior, interiors_of_room
from pbrs_farm.repair.repair_report import LeftAsIs, Removed, SideArea, StructureReport, WallLoss
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import TagTable, patches_from_solid, unite
from pbrs_farm.repair.structure.closed_shells import surface_from_patch
from pbrs_farm.repair.structure.cut_openings import WallPart, cut_openings, thresholds
from pbrs_farm.repair.structure.joints import joints_between_walls, joints_with_surface
from pbrs_farm.repair.structure.own_sides import along_and_across, with_own_sides_visible
from pbrs_farm.repair.structure.planar_surfaces import (
    Cover,
    FloorsAndCeilings,
    PlanarSurface,
    covers_of_roof_windows,
    floors_and_ceilings_from_house,
)
from pbrs_farm.repair.structure.prisms import polygons_of
from pbrs_farm.repair.structure.room_volumes import RoomVolume, volumes_of_rooms, without_volumes
from pbrs_farm.repair.structure.slabs import (
    GAP_M,
    bridge_gaps,
    footprints_of_surfaces,
    slab,
    visible_areas,
)
from pbrs_farm.repair.structure.walls import Wall, walls_from_house, with_metric_uv


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """The repaired walls, floors and ceilings of a house, and the plugs of its openings."""

    surfaces: dict[int, tuple[Surface, ...]]  # item index -> new surfaces, none if swallowed
    plugs: dict[str, tuple[Surface, ...]]  # opening id -> what fills it for the leak meter
    report: StructureReport
    spaces: tuple[Space, ...]  # rooms that open into each other
    interiors: dict[str, list[RoomInterior]]  # room id -> its parts between the walls


def repaired_structure(house: House, thickness_m: float) -> Structure:
    """Thicken planar parts, join, cut and unite. Faces keep item, surface name, material and uv.

    thickness_m: of slabs, and of walls without one. The house is not changed: `with_structure` inserts
    the result. Items that cannot be made solid are unchanged and named in the report.
    """
    # Read walls, floors and ceilings; give stairwells without a room the covers they lack.
    table, rooms = TagTable(), plan.union(plan.polygon_of_room(r.polygon) for r in house.rooms)
    uprights, unchanged = walls_from_house(house, table, rooms, thickness_m)
    walls = [w for w in uprights if not w.is_board]
    horizontal = floors_and_ceilings_from_house(house, table)
    wells = stairwells_of_house(house, walls, horizontal.planar, _covers(horizontal))
    planar = [*horizontal.planar, *wells.surfaces]
    in_roofs = covers_of_roof_windows(house.openings)
    covers = [*_covers(replace(horizontal, planar=planar)), *in_roofs]
    lived = (*house.rooms, *wells.wells)
    doors = thresholds(house, walls)

    # Thicken floors and ceilings, join walls to walls and to slabs, but never inside a room.
    footprints = footprints_of_surfaces(planar, walls, doors, thickness_m)
    volumes = volumes_of_rooms(lived, planar)
    slabs = _slabs(planar, footprints, volumes, thickness_m, table)
    wholes = with_own_sides_visible(uprights, house.rooms, table)
    joints, n_gaps = joints_between_walls(walls, rooms, table)
    for surface, footprint in zip(planar, footprints, strict=True):
        joints += joints_with_surface(surface, footprint, walls, doors, thickness_m, table)
    solid_floors = [cover for cover in horizontal.covers if not cover.is_ceiling]
    below = footprints_of_surfaces(solid_floors, walls, doors, thickness_m)
    for floor, footprint in zip(solid_floors, below, strict=True):
        joints += joints_with_surface(floor, footprint, walls, doors, thickness_m, table)
    parts = [WallPart(w, w.solid, is_joint=False) for w in wholes]
    parts += _parts_of_joints(joints, volumes, table)

    # Cut the openings, united everything, and take the faces back by item.
    cut_parts, plugs, idle = cut_openings(house.openings, parts, table)
    solids = [*cut_parts, *slabs, *(s for wells in horizontal.solid.values() for s in wells)]
    surfaces = _surfaces_by_item(unite(solids), table) if solids else {}
    touched = {w.item for w in uprights} | {s.item for s in planar} | set(horizontal.solid)
    areas = side_areas(house, uprights, wholes, cut_parts[: len(wholes)], surfaces, table)
    report = _report_of_counts(walls, planar, set(horizontal.solid)).model_copy(
        update={
            "n_joints_closed": n_gaps,
            "n_stairwells_closed": len(wells.surfaces),
            "n_openings": len(house.openings),
            "n_openings_cut": len(plugs),
            "left_as_is": _left_as_is(house, {**unchanged, **horizontal.left}, idle),
            "areas": areas,
            "walls_lost": lost_walls(areas),
        }
    )
    standing = [w for w in wholes if not w.is_board]  # the remaining walls close rooms
    return Structure(
        {i: surfaces.get(i, ()) for i in sorted(touched)},
        plugs,
        report,
        spaces_of_rooms(house.rooms, wells.wells, standing, covers),
        {
            r.id: interiors_of_room(r, wholes, planar, [*horizontal.covers, *in_roofs])
            for r in lived
        },
    )


def _parts_of_joints(
    joints: Sequence[tuple[Wall, Manifold]], volumes: Sequence[RoomVolume], table: TagTable
) -> list[WallPart]:
    # Keep joints out of every room.
    outside = [(w, without_volumes(s, w.tag("joint"), None, volumes, table)) for w, s in joints]
    return [WallPart(w, solid, is_joint=True) for w, solid in outside]


def _report_of_counts(
    walls: Sequence[Wall], planar: Sequence[PlanarSurface], solid: set[int]
) -> StructureReport:
    # A wall of several shells counts once.
    return StructureReport(
        n_walls=len({w.item for w in walls}),
        n_walls_thickened=len({w.item for w in walls if w.thickened}),
        n_floors_thickened=len({s.item for s in planar if not s.is_ceiling}),
        n_ceilings_thickened=len({s.item for s in planar if s.is_ceiling}),
        n_solid_before=len({w.item for w in walls if not w.thickened} | solid),
    )


def _covers(horizontal: FloorsAndCeilings) -> list[Cover]:
    return [Cover(s.is_ceiling, s.area, s.plane) for s in horizontal.planar] + horizontal.covers


def _left_as_is(house: House, left: dict[int, str], idle: Sequence[str]) -> tuple[LeftAsIs, ...]:
    items = [
        LeftAsIs(what=str(house.items[i].kind), id=house.items[i].id, reason=reason)
        for i, reason in sorted(left.items())
    ]
    openings = [LeftAsIs(what="opening", id=i, reason="it touches no wall") for i in idle]
    # Name walls, floors and ceilings first, then openings.
    return (*items, *openings)


def _slabs(
    planar: Sequence[PlanarSurface],
    footprints: Sequence[plan.Shape],
    volumes: Sequence[RoomVolume],
    thickness_m: float,
    table: TagTable,
) -> list[Manifold]:
    slabs = []
    visible = visible_areas(planar, footprints)
    for surface, footprint, visible_area in zip(planar, footprints, visible, strict=True):
        # Keep slabs out of every room but their own.
        for solid in slab(surface, footprint, visible_area, thickness_m, table):
            slabs.append(
                without_volumes(solid, surface.tag("hidden"), surface.item, volumes, table)
            )
    return slabs + bridge_gaps(planar, thickness_m, table)


def _surfaces_by_item(solid: Manifold, table: TagTable) -> dict[int, tuple[Surface, ...]]:
    by_item: dict[int, list[Surface]] = {}
    for patch in patches_from_solid(solid, table):
        surface = surface_from_patch(with_metric_uv(patch))
        if surface is not None:
            by_item.setdefault(patch.tag.item, []).append(surface)
    return {item: tuple(surfaces) for item, surfaces in by_item.items()}


def with_structure(house: House, structure: Structure) -> tuple[House, list[Removed]]:
    """The house with its new structure, in item order, and the items of which no face is left."""
    items: list[Item] = []
    removed = []
    for index, item in enumerate(house.items):
        surfaces = structure.surfaces.get(index, item.surfaces)
        # Remove walls completely inside others.
        if index in structure.surfaces and not surfaces:
            removed.append(Removed(item_id=item.id, name=item.name, reason="nothing left of it"))
        else:
            items.append(replace(item, surfaces=surfaces))
    return house.with_items(items), removed


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


MAX_LOST_SHARE = 0.1
"""A wall that loses more of its side is a fault of the repair."""

_LEAST_M2 = 0.01  # less is lost to rounding


def side_areas(
    house: House,
    walls: Sequence[Wall],
    cut: Sequence[Wall],
    left: Sequence[Manifold],
    surfaces: Mapping[int, Sequence[Surface]],
    table: TagTable,
) -> tuple[SideArea, ...]:
    """Square metres of every structure item before and after.

    walls: before any cut. cut: trimmed by other rooms; left: with their openings cut too, in the same
    order. surfaces: item index -> new surfaces; other items are unchanged.
    """
    before, after = [0.0] * len(house.items), [0.0] * len(house.items)
    for wall, cut_wall, rest in zip(walls, cut, left, strict=True):
        area = _seen_from_the_side(rest, wall.footprint)
        after[wall.item] += area
        # Cut the openings out of the wall as it was; where nothing else was cut, that is the rest.
        if cut_wall.solid is not wall.solid:
            area = _seen_from_the_side(
                _cut_openings_of_wall(house.openings, wall, table), wall.footprint
            )
        before[wall.item] += area
    uprights = {w.item for w in walls}
    rows = []
    for index, item in enumerate(house.items):
        if not item.kind.is_structure:
            continue
        if index not in uprights:
            before[index] = _seen_from_above(item.surfaces)
            after[index] = _seen_from_above(surfaces.get(index, item.surfaces))
        rows.append(_side_area_of(item, before[index], after[index]))
    return tuple(rows)


def lost_walls(areas: Iterable[SideArea]) -> tuple[WallLoss, ...]:
    """The walls whose side lost more than MAX_LOST_SHARE and _LEAST_M2."""
    return tuple(
        WallLoss(item_id=a.item_id, before_m2=a.before_m2, after_m2=a.after_m2)
        for a in areas
        if a.kind == ItemKind.WALL
        and a.before_m2 - a.after_m2 > max(MAX_LOST_SHARE * a.before_m2, _LEAST_M2)
    )


def _cut_openings_of_wall(openings: Sequence[Opening], wall: Wall, table: TagTable) -> Manifold:
    # Where the source has cut the walls already, nothing is cut: their solids have the holes.
    return cut_openings(openings, [WallPart(wall, wall.solid, is_joint=False)], table)[0][0]


def _seen_from_the_side(solid: Manifold, footprint: plan.Shape) -> float:
    if solid.is_empty() or footprint.is_empty:
        return 0.0
    # Turn the wall so that its thickness is along z, and project along z.
    along, across = along_and_across(footprint)
    turned = np.zeros((3, 4))
    turned[0, [0, 2]], turned[1, 1], turned[2, [0, 2]] = along, 1.0, across
    return float(solid.transform(turned).project().area())


def _seen_from_above(surfaces: Iterable[Surface]) -> float:
    shapes = [plan.polygon_of_triangles(s.positions.astype(float), s.faces) for s in surfaces]
    return float(shapely.area(plan.union(shapes)))


def _side_area_of(item: Item, before: float, after: float) -> SideArea:
    return SideArea(
        item_id=item.id, kind=str(item.kind), before_m2=round(before, 3), after_m2=round(after, 3)
    )
