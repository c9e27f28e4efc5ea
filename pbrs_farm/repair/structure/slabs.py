"""Floors and ceilings as slabs that reach under and over the walls; no effects.

A slab is a thin layer with the visible face, cut to what the room owns, and a base behind it
that overlaps its neighbours' bases: seen from a room nothing coincides, seen by light nothing
is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import CEILING
from pbrs_farm.core.house import House, Item, ItemKind, Room, Surface, corners_of_surfaces, part_of
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.added_ceilings import (
    MAX_UNDERSIDE_NORMAL_Y,
    MIN_WALL_HEIGHT_M,
    cover_of_surfaces,
)
from pbrs_farm.repair.structure.booleans import TagTable
from pbrs_farm.repair.structure.planar_surfaces import Cover, PlanarSurface
from pbrs_farm.repair.structure.prisms import (
    BASE_BEHIND_M,
    FACE_M,
    Plane,
    UvMap,
    polygons_of,
    solid_prisms,
)
from pbrs_farm.repair.structure.walls import Wall

GAP_M = 0.05
"""A gap narrower than this between rooms, walls and floors is a fault of the drawing, and closed."""

FOOT_M = 3 * GAP_M
"""A wall's foot may be so far above the floor: spaces_of_rooms accepts it, and the gap is closed."""

SAME_HEIGHT_M = 0.01
"""Floors (or ceilings) nearer in height than this are one level, and separated in plan."""


def footprints_of_surfaces(
    surfaces: Sequence[PlanarSurface | Cover],
    walls: Sequence[Wall],
    thresholds: plan.Shape,
    thickness_m: float,
) -> list[plan.Shape]:
    """For each surface the plan area of its slab: its own area, grown under or over the walls.

    It grows thickness_m into walls, across gaps up to GAP_M, and through thresholds (plan area of
    openings that reach the floor); never past a free edge.
    """
    footprints = []
    for surface in surfaces:
        # Close the gaps between neighbours at this height and the walls between them.
        nearby = plan.near_to(surface.area, surfaces, lambda s: s.area, 1.0)
        mates = [s.area for s in nearby if _is_level_with(surface, s)]
        near = plan.near_to(surface.area, walls, lambda w: w.footprint, 1.0)
        feet = [w.footprint for w in near if _wall_meets_surface(surface, w)]
        whole = plan.closed(plan.union([*mates, *feet]), 2 * GAP_M)
        # Grow into walls, and for a floor through the thresholds of its doors.
        reach = plan.grown(surface.area, thickness_m)
        if not surface.is_ceiling:
            doors = plan.common(thresholds, plan.grown(surface.area, 1.0))
            ways = [d for d in polygons_of(doors) if d.distance(surface.area) < GAP_M]
            reach = plan.union([reach, *ways])
        footprints.append(plan.union([surface.area, plan.common(reach, whole)]))
    return footprints


def _is_level_with(a: PlanarSurface | Cover, b: PlanarSurface | Cover) -> bool:
    if a.is_ceiling != b.is_ceiling:
        return False
    # Compare heights in the middle of the other one.
    middle = shapely.get_coordinates(b.area).mean(0)[None]
    return bool(abs(a.plane.at(middle)[0] - b.plane.at(middle)[0]) < 0.5)


def _wall_meets_surface(surface: PlanarSurface | Cover, wall: Wall) -> bool:
    # Ask whether the wall comes within GAP_M of the surface's plane, or FOOT_M above a floor.
    below_m = GAP_M if surface.is_ceiling else FOOT_M
    corners = shapely.get_coordinates(wall.footprint)
    heights = surface.plane.at(corners)
    return bool(
        (wall.bottom_y - below_m <= heights).any()
        and (heights <= wall.top.at(corners) + GAP_M).any()
    )


def visible_areas(
    surfaces: Sequence[PlanarSurface], footprints: Sequence[plan.Shape]
) -> list[plan.Shape]:
    """For each surface the visible part of its footprint: of overlapping ones the later; under walls the earlier."""
    areas = []
    for i, surface in enumerate(surfaces):
        near = plan.near_to(surface.area, range(len(surfaces)), lambda j: surfaces[j].area, 1.0)
        same = [j for j in near if j != i and _same_height(surface, surfaces[j])]
        # Show the surface's own area, except under a later surface.
        mine = plan.without(surface.area, *(surfaces[j].area for j in same if j > i))
        # Show the ring under the walls, except under an earlier footprint.
        ring = plan.without(footprints[i], surface.area, *(surfaces[j].area for j in same))
        ring = plan.without(ring, *(footprints[j] for j in same if j < i))
        areas.append(plan.union([mine, ring]))
    return areas


def _same_height(a: PlanarSurface, b: PlanarSurface) -> bool:
    if a.is_ceiling != b.is_ceiling:
        return False
    corners = shapely.get_coordinates(b.area)
    return bool(abs(a.plane.at(corners) - b.plane.at(corners)).min() < SAME_HEIGHT_M)


def slab(
    surface: PlanarSurface,
    footprint: plan.Shape,
    visible: plan.Shape,
    thickness_m: float,
    table: TagTable,
) -> list[Manifold]:
    """The surface's slab as solids that overlap: the layer with its face, and the base behind it.

    visible: plan area in which its face is seen; footprint: what the slab reaches under, walls too.
    thickness_m: away from the room. They overlap on purpose: `unite` makes one of them without a
    seam.
    """
    away = 1.0 if surface.is_ceiling else -1.0
    hidden, face = surface.tag("hidden"), surface.tag(surface.name)
    solids = []
    # Stack the two layers from the face outwards.
    for area, near_m, far_m, tag in (
        (visible, 0.0, FACE_M, face),
        (footprint, BASE_BEHIND_M, thickness_m, hidden),
    ):
        near, far = surface.plane.raised(away * near_m), surface.plane.raised(away * far_m)
        low, high = (near, far) if surface.is_ceiling else (far, near)
        tags = (tag, hidden, hidden) if surface.is_ceiling else (hidden, tag, hidden)
        for part, uv in _parts_by_uv(surface, area) if tag is face else ((area, surface.uv),):
            solids += solid_prisms(polygons_of(part), low, high, tags, table, uv)
    return solids


def _parts_by_uv(surface: PlanarSurface, area: plan.Shape) -> list[tuple[plan.Shape, UvMap | None]]:
    """The parts of an area of its slab, each with the map that lays the texture on it."""
    if not surface.uv_parts:
        return [(area, surface.uv)]
    # The area outside the surface, under walls, continues its first part.
    beyond = plan.without(area, *(part.area for part in surface.uv_parts))
    within = [(plan.common(area, part.area), part.uv) for part in surface.uv_parts]
    return [(beyond, surface.uv_parts[0].uv), *within]


def bridge_gaps(
    surfaces: Sequence[PlanarSurface], thickness_m: float, table: TagTable
) -> list[Manifold]:
    """Solids behind the creases of an item's ceiling, where its slabs only abut."""
    solids = []
    for k, surface in enumerate(surfaces):
        other_areas = [s.area for j, s in enumerate(surfaces) if j != k and s.item == surface.item]
        if not other_areas:
            continue
        whole = plan.union([surface.area, *other_areas])
        # Reach a little past the crease, behind the visible layers.
        area = plan.common(plan.grown(surface.area, 0.2 * thickness_m), whole)
        away = 1.0 if surface.is_ceiling else -1.0
        a: Plane = surface.plane.raised(away * 0.5 * thickness_m)
        b: Plane = surface.plane.raised(away * thickness_m)
        hidden = surface.tag("hidden")
        low, high = (a, b) if surface.is_ceiling else (b, a)
        solids += solid_prisms(polygons_of(area), low, high, (hidden,) * 3, table)
    return solids


_STEP_M: Final = 0.2  # spacing of floor samples for visibility from below, metres
_MOST_PLACES: Final = 2000  # of one floor: of a larger one they lie farther apart
_LEAST_PLACES: Final = 3  # seen: fewer are the seam between a ceiling and a wall
_APART_M: Final = 0.002  # a ceiling in the plane of an underside does not hide it
UNDERSIDE: Final = "underside"
"""Tag of such ceilings."""


class _Stand(NamedTuple):
    """A standpoint below a floor: a room's floor or the ground outside."""

    area: plan.Shape
    y: float
    room: Room | None


def with_undersides(house: House) -> House:
    """Append, as ceilings, the undersides of floors that a room or the outdoors sees from below."""
    floors = [i for i in house.items if i.kind is ItemKind.FLOOR and i.n_faces]
    lowest = min((room.floor_y for room in house.rooms), default=np.inf)
    if not any(i.bounds[1, 1] > lowest + MIN_WALL_HEIGHT_M / 2 for i in floors):
        return house
    stands = [_Stand(plan.polygon_of_room(r.polygon), r.floor_y, r) for r in house.rooms]
    for ground in house.items:
        if ground.kind is ItemKind.GROUND and ground.n_faces:
            area = cover_of_surfaces(ground).area
            stands.append(_Stand(area, float(ground.bounds[1, 1]), None))
    covers = [i for i in house.items if i.kind in (ItemKind.FLOOR, ItemKind.CEILING)]
    above = corners_of_surfaces([s for i in covers for s in i.surfaces])
    items: list[Item] = []
    undersides: list[Item] = []
    for item in house.items:
        is_floor = item.kind is ItemKind.FLOOR and item.n_faces
        stand = _seen_from(item, stands, above) if is_floor else None
        upper, under = _parted(item) if stand is not None else (item.surfaces, ())
        if stand is None or not under or not upper:
            items.append(item)
            continue
        items.append(replace(item, surfaces=upper))
        level_id, room_id = item.level_id, None
        if stand.room is not None:
            level_id, room_id = stand.room.level_id, stand.room.id
        undersides.append(
            Item(
                id=f"{UNDERSIDE}_{item.id}",
                name=f"Underside of {item.name or item.id}",
                kind=ItemKind.CEILING,
                level_id=level_id,
                surfaces=under,
                nyu40=CEILING,
                source_class="ceiling",
                room_id=room_id,
                tags=(UNDERSIDE,),
            )
        )
    return house.with_items([*items, *undersides])


def _seen_from(item: Item, stands: Sequence[_Stand], above: F64) -> _Stand | None:
    """A standpoint that sees most of a floor past all others (above); None if it is hidden."""
    corners = corners_of_surfaces(item.surfaces)
    under = corners[unit_normals(corners)[:, 1] < MAX_UNDERSIDE_NORMAL_Y]
    if not len(under):
        return None
    low, high = item.bounds[:, [0, 2]]
    step = max(_STEP_M, float(np.sqrt(np.prod(high - low) / _MOST_PLACES)))
    axes = [np.arange(low[k] + step / 2, high[k], step) for k in range(2)]
    grid = np.stack([g.ravel() for g in np.meshgrid(*axes)], 1)
    under_y = lowest_above(grid, under, -np.inf)
    grid, under_y = grid[np.isfinite(under_y)], under_y[np.isfinite(under_y)]
    best, most = None, _LEAST_PLACES - 1
    for stand in stands:
        least_y = stand.y + MIN_WALL_HEIGHT_M / 2
        overhead = under_y > least_y
        if overhead.sum() <= most:
            continue
        overhead &= shapely.contains_xy(stand.area, grid[:, 0], grid[:, 1])
        first_y = lowest_above(grid[overhead], above, least_y)
        n_seen = int((under_y[overhead] <= first_y + _APART_M).sum())
        if n_seen > most:
            best, most = stand, n_seen
    return best


def _parted(item: Item) -> tuple[tuple[Surface, ...], tuple[Surface, ...]]:
    """The surfaces of a floor without the faces that look down, and those faces."""
    upper, under = [], []
    for s in item.surfaces:
        down = unit_normals(corners_of_surfaces([s]))[:, 1] < MAX_UNDERSIDE_NORMAL_Y
        upper += [part_of(s, s.faces[~down], s.name)] if not down.all() else []
        under += [part_of(s, s.faces[down], s.name)] if down.any() else []
    return tuple(upper), tuple(under)
