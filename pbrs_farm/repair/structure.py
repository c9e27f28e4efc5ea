"""Walls, floors and ceilings made one solid that light cannot pass, openings cut; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from manifold3d import Manifold

from pbrs_farm.house import House, Item, Opening, Room, Surface
from pbrs_farm.repair import plan
from pbrs_farm.repair.air import Air, airs_of_rooms, without_air
from pbrs_farm.repair.enclosure import Space, spaces_of_rooms
from pbrs_farm.repair.joints import joints_between_walls, joints_with_sheet
from pbrs_farm.repair.leaks import RoomAir
from pbrs_farm.repair.patches import patch_from_surface, surface_from_patch
from pbrs_farm.repair.prisms import level_plane, polygons_of
from pbrs_farm.repair.report import LeftAsIs, Removed, StructureReport
from pbrs_farm.repair.reveals import REVEAL, with_metric_uv
from pbrs_farm.repair.sheets import Lid, Sheets, sheets_from_house
from pbrs_farm.repair.slabs import GAP_M, bridged, ground_of_sheets, own_areas, slab
from pbrs_farm.repair.solids import (
    Tag,
    TagTable,
    bounds,
    common,
    overlap_of_bounds,
    patches_from_solid,
    reduced,
    solid_from_patches,
    united,
)
from pbrs_farm.repair.stairwells import stairwells_of_house
from pbrs_farm.repair.walls import Wall, walls_from_house

_SLIVER_M = 0.02


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
    doors = _thresholds(house, walls)

    grounds = ground_of_sheets(sheets.planar, walls, doors, thickness_m)
    airs = airs_of_rooms(lived, sheets.planar, grounds)
    slabs = _slabs(sheets, grounds, airs, thickness_m, table)
    parts: list[tuple[Wall, Manifold]] = [(w, w.solid) for w in uprights]
    joints, n_gaps = joints_between_walls(walls, table)
    for sheet, ground in zip(sheets.planar, grounds, strict=True):
        joints += joints_with_sheet(sheet, ground, walls, doors, thickness_m, table)
    parts += [(w, without_air(s, w.tag("joint"), None, airs, table)) for w, s in joints]

    cut_parts, plugs, idle = _cut(house.openings, parts, table)
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
        {r.id: _room_airs(r, uprights, sheets) for r in lived},
    )


def _lids(sheets: Sheets) -> list[Lid]:
    return [Lid(s.is_ceiling, s.area, s.plane) for s in sheets.planar] + sheets.lids


def _room_airs(room: Room, uprights: Sequence[Wall], sheets: Sheets) -> list[RoomAir]:
    # Between the walls, above the floor, below each plane of the ceiling.
    near = [
        w for w in uprights if w.bottom_y < room.ceiling_y - 0.1 and w.high_y > room.floor_y + 0.01
    ]
    walls = plan.union(w.footprint for w in near if not w.is_board)
    boards = [w for w in near if w.is_board]
    area = plan.without(plan.polygon_of_room(room.polygon), walls)
    foot = plan.union(w.footprint for w in boards)
    foot_m = max(
        (w.high_y - room.floor_y for w in boards if w.footprint.distance(area) < 0.05), default=0.0
    )
    ceilings = [s for s in sheets.planar if s.is_ceiling and s.room_id == room.id]
    parts = [(plan.common(area, s.area), s.plane) for s in ceilings]
    parts.append((plan.without(area, *(s.area for s in ceilings)), level_plane(room.ceiling_y)))
    floor = level_plane(room.floor_y)
    return [
        RoomAir(p, plan.opened(plan.without(p, foot), _SLIVER_M), foot_m, floor, plane)
        for shape, plane in parts
        for p in polygons_of(plan.opened(shape, _SLIVER_M), min_area_m2=1e-3)
    ]


def _left(house: House, left: dict[int, str]) -> list[LeftAsIs]:
    return [
        LeftAsIs(what=str(house.items[i].kind), id=house.items[i].id, reason=why)
        for i, why in sorted(left.items())
    ]


def _thresholds(house: House, walls: Sequence[Wall]) -> plan.Shape:
    # Plan area of the openings that reach down to the foot of the wall they stand in.
    areas = []
    for opening in house.openings:
        cutter = opening.cutter
        area = plan.polygon_of_triangles(cutter.positions.astype(float), cutter.faces)
        low = float(cutter.positions[:, 1].min())
        feet = [w.footprint for w in walls if abs(w.bottom_y - low) < GAP_M]
        areas.append(plan.common(area, plan.union(feet)))
    return plan.union(areas)


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


def _cut(
    openings: Sequence[Opening], parts: Sequence[tuple[Wall, Manifold]], table: TagTable
) -> tuple[list[Manifold], dict[str, tuple[Surface, ...]], list[str]]:
    """Each wall part less the openings that touch it; plugs by opening id; openings that cut none."""
    cutters_of: list[list[Manifold]] = [[] for _ in parts]
    plugs: dict[str, tuple[Surface, ...]] = {}
    for opening in openings:
        fills = []
        reach = np.stack([opening.cutter.positions.min(0), opening.cutter.positions.max(0)])
        for k, (wall, solid) in enumerate(parts):
            if (overlap_of_bounds(bounds(solid), reach) <= 0).any():
                continue
            tag = Tag(wall.item, REVEAL, wall.material)
            cutter = solid_from_patches([replace(patch_from_surface(opening.cutter, 0), tag=tag)], table)  # fmt: skip
            if cutter is None:
                continue
            fill = common(solid, cutter)
            if fill.volume() > 1e-9:
                cutters_of[k].append(cutter)
                fills.append(fill)
        if fills:
            plug = patches_from_solid(united(fills), table)
            plugs[opening.id] = tuple(s for p in plug if (s := surface_from_patch(p)) is not None)
    idle = [o.id for o in openings if o.id not in plugs]
    cut = [reduced(s, c) for (_, s), c in zip(parts, cutters_of, strict=True)]
    return cut, plugs, idle


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
