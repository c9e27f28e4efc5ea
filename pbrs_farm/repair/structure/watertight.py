"""Walls, floors and ceilings made one solid that light cannot pass, openings cut; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from manifold3d import Manifold

from pbrs_farm.core.house import House, Item, Surface
from pbrs_farm.repair.measure.enclosure import Space, spaces_of_rooms
from pbrs_farm.repair.measure.room_edges import RoomAir, room_airs
from pbrs_farm.repair.report import LeftAsIs, Removed, StructureReport
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import TagTable, patches_from_solid, united
from pbrs_farm.repair.structure.cut_openings import WallPart, cut_openings, thresholds
from pbrs_farm.repair.structure.joints import joints_between_walls, joints_with_sheet
from pbrs_farm.repair.structure.patches import surface_from_patch
from pbrs_farm.repair.structure.planar_surfaces import Lid, Sheets, sheets_from_house
from pbrs_farm.repair.structure.reveals import with_metric_uv
from pbrs_farm.repair.structure.room_volumes import Air, airs_of_rooms, own_sides_first, without_air
from pbrs_farm.repair.structure.slabs import bridged, ground_of_sheets, own_areas, slab
from pbrs_farm.repair.structure.stairwells import stairwells_of_house
from pbrs_farm.repair.structure.walls import walls_from_house


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """The repaired structure. surfaces: item index -> its new surfaces, empty if swallowed.

    plugs: for each opening that cuts a wall, closed solids of the wall's own thickness that fill
    it (by opening id), for the leak meter. spaces: rooms by the air they share. airs: each room's
    air by room id, walls left out.
    """

    surfaces: dict[int, tuple[Surface, ...]]
    plugs: dict[str, tuple[Surface, ...]]
    report: StructureReport
    spaces: tuple[Space, ...]
    airs: dict[str, list[RoomAir]]


def repaired_structure(house: House, thickness_m: float) -> Structure:
    """Thicken what is planar, join, cut, unite. Faces keep item, surface name, material and uv."""
    table = TagTable()
    rooms = plan.union([plan.polygon_of_room(r.polygon) for r in house.rooms])
    uprights, left = walls_from_house(house, table, rooms, thickness_m)
    walls = [w for w in uprights if not w.is_board]
    sheets = sheets_from_house(house, table)
    found = stairwells_of_house(house, walls, sheets.planar, _lids(sheets))
    sheets.planar.extend(found.sheets)
    lived = (*house.rooms, *found.wells)
    doors = thresholds(house, walls)

    grounds = ground_of_sheets(sheets.planar, walls, doors, thickness_m)
    airs = airs_of_rooms(lived, sheets.planar)
    slabs = _slabs(sheets, grounds, airs, thickness_m, table)
    wholes = own_sides_first(uprights, house.rooms, table)
    joints, n_gaps = joints_between_walls(walls, rooms, table)
    for sheet, ground in zip(sheets.planar, grounds, strict=True):
        joints += joints_with_sheet(sheet, ground, walls, doors, thickness_m, table)
    parts = [WallPart(w, w.solid, is_joint=False) for w in wholes]
    for w, solid in joints:
        solid = without_air(solid, w.tag("joint"), None, airs, table)
        parts.append(WallPart(w, solid, is_joint=True))

    cut_parts, plugs, idle = cut_openings(house.openings, parts, table)
    bodies = [*cut_parts, *slabs, *(s for solids in sheets.solid.values() for s in solids)]
    surfaces = _surfaces(united(bodies), table) if bodies else {}
    touched = {w.item for w in uprights} | {s.item for s in sheets.planar} | set(sheets.solid)
    report = StructureReport(
        n_walls=len({w.item for w in walls}),
        n_walls_thickened=len({w.item for w in walls if w.thickened}),
        n_floors_thickened=len({s.item for s in sheets.planar if not s.is_ceiling}),
        n_ceilings_thickened=len({s.item for s in sheets.planar if s.is_ceiling}),
        n_solid_before=len({w.item for w in walls if not w.thickened} | set(sheets.solid)),
        n_joints_closed=n_gaps,
        n_stairwells_closed=len(found.sheets),
        n_openings=len(house.openings),
        n_openings_cut=len(plugs),
        left_as_is=(
            *_left(house, {**left, **sheets.left}),
            *(LeftAsIs(what="opening", id=i, reason="it touches no wall") for i in idle),
        ),
    )
    return Structure(
        {i: surfaces.get(i, ()) for i in sorted(touched)},
        plugs,
        report,
        spaces_of_rooms(house.rooms, found.wells, walls, _lids(sheets)),
        {r.id: room_airs(r, uprights, sheets.planar) for r in lived},
    )


def _lids(sheets: Sheets) -> list[Lid]:
    return [Lid(s.is_ceiling, s.area, s.plane) for s in sheets.planar] + sheets.lids


def _left(house: House, left: dict[int, str]) -> list[LeftAsIs]:
    return [
        LeftAsIs(what=str(house.items[i].kind), id=house.items[i].id, reason=why)
        for i, why in sorted(left.items())
    ]


def _slabs(
    sheets: Sheets,
    grounds: Sequence[plan.Shape],
    airs: Sequence[Air],
    thickness_m: float,
    table: TagTable,
) -> list[Manifold]:
    found = []
    owns = own_areas(sheets.planar, grounds)
    for sheet, ground, own in zip(sheets.planar, grounds, owns, strict=True):
        for solid in slab(sheet, ground, own, thickness_m, table):
            found.append(without_air(solid, sheet.tag("hidden"), sheet.item, airs, table))
    return found + bridged(sheets.planar, thickness_m, table)


def _surfaces(solid: Manifold, table: TagTable) -> dict[int, tuple[Surface, ...]]:
    found: dict[int, list[Surface]] = {}
    for patch in patches_from_solid(solid, table):
        surface = surface_from_patch(with_metric_uv(patch))
        if surface is not None:
            found.setdefault(patch.tag.item, []).append(surface)
    return {item: tuple(surfaces) for item, surfaces in found.items()}


def with_structure(house: House, structure: Structure) -> tuple[House, list[Removed]]:
    """The house with its new structure; items of which no face is left are taken out."""
    items: list[Item] = []
    removed = []
    for index, item in enumerate(house.items):
        surfaces = structure.surfaces.get(index, item.surfaces)
        if index in structure.surfaces and not surfaces:
            removed.append(Removed(item_id=item.id, name=item.name, reason="nothing left of it"))
        else:
            items.append(replace(item, surfaces=surfaces))
    return house.with_items(items), removed
