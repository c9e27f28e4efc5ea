"""Floors and ceilings as slabs that reach under and over the walls; no effects.

A slab is a thin layer with the visible face, cut to what the room owns, and a base behind it
that overlaps its neighbours' bases: seen from a room nothing coincides, seen by light nothing
is open.
"""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from manifold3d import Manifold

from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import TagTable, solid_from_patches
from pbrs_farm.repair.structure.planar_surfaces import Sheet
from pbrs_farm.repair.structure.prisms import Plane, polygons_of, prism
from pbrs_farm.repair.structure.walls import Wall

GAP_M = 0.05
"""A gap narrower than this between rooms, walls and floors is a fault of the drawing, and closed."""

SAME_HEIGHT_M = 0.01
"""Floors (or ceilings) nearer in height than this are one level, told apart in plan."""

_FACE_M = 0.02
_BASE_BEHIND_M = 0.01


def ground_of_sheets(
    sheets: Sequence[Sheet], walls: Sequence[Wall], thresholds: plan.Shape, thickness_m: float
) -> list[plan.Shape]:
    """For each sheet the plan area of its slab: its own area, grown under or over the walls.

    It grows thickness_m into walls, across gaps up to GAP_M, and through thresholds (plan area of
    openings that reach the floor); never past a free edge.
    """
    grounds = []
    for sheet in sheets:
        mates = [s.area for s in sheets if _beside(sheet, s)]
        feet = [w.footprint for w in walls if _meets(sheet, w)]
        whole = plan.closed(plan.union([*mates, *feet]), 2 * GAP_M)
        reach = plan.grown(sheet.area, thickness_m)
        if not sheet.is_ceiling:
            doors = plan.common(thresholds, plan.grown(sheet.area, 1.0))
            near = [d for d in polygons_of(doors) if d.distance(sheet.area) < GAP_M]
            reach = plan.union([reach, *near])
        grounds.append(plan.union([sheet.area, plan.common(reach, whole)]))
    return grounds


def _beside(a: Sheet, b: Sheet) -> bool:
    near = a.is_ceiling == b.is_ceiling and a.area.distance(b.area) < 1.0
    if not near:
        return False
    middle = shapely.get_coordinates(b.area).mean(0)[None]
    return bool(abs(a.plane.at(middle)[0] - b.plane.at(middle)[0]) < 0.5)


def _meets(sheet: Sheet, wall: Wall) -> bool:
    # The wall's body comes within GAP_M of the sheet's plane where they are next to each other.
    if wall.footprint.distance(sheet.area) > 1.0:
        return False
    corners = shapely.get_coordinates(wall.footprint)
    heights = sheet.plane.at(corners)
    return bool((wall.bottom_y - GAP_M <= heights).any() and (heights <= wall.top.at(corners) + GAP_M).any())  # fmt: skip


def own_areas(sheets: Sequence[Sheet], grounds: Sequence[plan.Shape]) -> list[plan.Shape]:
    """For each sheet the part of its ground it shows: where sheets overlap, the later one.

    Under walls, where two grounds meet, the earlier one. Sheets at other heights do not count.
    """
    own = []
    for i, sheet in enumerate(sheets):
        same = [j for j, s in enumerate(sheets) if j != i and _same_height(sheet, s)]
        mine = plan.without(sheet.area, *(sheets[j].area for j in same if j > i))
        ring = plan.without(grounds[i], sheet.area, *(sheets[j].area for j in same))
        ring = plan.without(ring, *(grounds[j] for j in same if j < i))
        own.append(plan.union([mine, ring]))
    return own


def _same_height(a: Sheet, b: Sheet) -> bool:
    if a.is_ceiling != b.is_ceiling or a.area.distance(b.area) > 1.0:
        return False
    corners = shapely.get_coordinates(b.area)
    return bool(abs(a.plane.at(corners) - b.plane.at(corners)).min() < SAME_HEIGHT_M)


def slab(
    sheet: Sheet, ground: plan.Shape, own: plan.Shape, thickness_m: float, table: TagTable
) -> list[Manifold]:
    """The sheet's slab as solids that overlap: the layer with its face, and the base behind it."""
    away = 1.0 if sheet.is_ceiling else -1.0
    hidden, face = sheet.tag("hidden"), sheet.tag(sheet.surface)
    solids = []
    for area, near_m, far_m, tag in (
        (own, 0.0, _FACE_M, face),
        (ground, _BASE_BEHIND_M, thickness_m, hidden),
    ):
        near, far = sheet.plane.raised(away * near_m), sheet.plane.raised(away * far_m)
        low, high = (near, far) if sheet.is_ceiling else (far, near)
        tags = (tag, hidden, hidden) if sheet.is_ceiling else (hidden, tag, hidden)
        for polygon in polygons_of(area):
            solid = solid_from_patches(prism(polygon, low, high, tags, sheet.uv), table)
            if solid is not None:
                solids.append(solid)
    return solids


def bridged(sheets: Sequence[Sheet], thickness_m: float, table: TagTable) -> list[Manifold]:
    """Solids that join the planes of one ceiling behind its creases, where slabs only abut."""
    solids = []
    for k, sheet in enumerate(sheets):
        others = [s.area for j, s in enumerate(sheets) if j != k and s.item == sheet.item]
        if not others:
            continue
        whole = plan.union([sheet.area, *others])
        area = plan.common(plan.grown(sheet.area, 0.2 * thickness_m), whole)
        away = 1.0 if sheet.is_ceiling else -1.0
        a: Plane = sheet.plane.raised(away * 0.5 * thickness_m)
        b: Plane = sheet.plane.raised(away * thickness_m)
        hidden = sheet.tag("hidden")
        for polygon in polygons_of(area):
            low, high = (a, b) if sheet.is_ceiling else (b, a)
            solid = solid_from_patches(prism(polygon, low, high, (hidden,) * 3), table)
            if solid is not None:
                solids.append(solid)
    return solids
