"""Trim walls that extend into another room, so that each room sees its own walls; no effects.

If every room has separate walls (SUNCG), the walls of two neighbours overlap and their sides are
coplanar. The wall is cut by the volume of the other room, but only at its rim: along the wall,
wherever some of its thickness remains. A wall completely inside the other room is a partition
that one outline was drawn around, and stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Room
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import TagTable, subtract
from pbrs_farm.repair.structure.prisms import level_plane, polygons_of, solid_prisms
from pbrs_farm.repair.structure.slabs import GAP_M
from pbrs_farm.repair.structure.walls import Wall

_COINCIDE_M = 0.001  # walls nearer than this to a room lie in one plane with its own
_LEAST_LEFT_M = 0.01  # thickness that must be left behind a rim
_LEAST_LEFT_SHARE = 0.25  # of the wall's thickness, if less
_OVERLAP_M2 = 1e-3  # outlines that share less lie side by side


def with_own_sides_visible(
    walls: Sequence[Wall], rooms: Sequence[Room], table: TagTable
) -> list[Wall]:
    """The walls, those with a room cut by other rooms, with the remaining solid and footprint."""
    areas = {r.id: plan.polygon_of_room(r.polygon) for r in rooms}
    visible = []
    for wall in walls:
        if wall.room_id is None:
            visible.append(wall)
            continue
        footprint, cutters = wall.footprint, []
        for room in rooms:
            is_apart = room.floor_y > wall.high_y or room.ceiling_y < wall.bottom_y
            if room.id == wall.room_id or is_apart:
                continue
            reach = plan.grown(_volume_in_plan(room.id, wall.room_id, areas), _COINCIDE_M)
            polygons = polygons_of(_rim(footprint, reach))
            # Draw the wall back from the whole height of the other room.
            low, high = level_plane(room.floor_y - GAP_M), level_plane(room.ceiling_y + GAP_M)
            cutters += solid_prisms(polygons, low, high, (wall.tag("hidden"),) * 3, table)
            footprint = plan.without(footprint, *polygons)
        if cutters:
            wall = replace(wall, solid=subtract(wall.solid, cutters), footprint=footprint)
        visible.append(wall)
    return visible


def _volume_in_plan(room_id: str, owner_id: str, areas: dict[str, plan.Shape]) -> plan.Shape:
    # Give what two outlines share to the smaller room: a bathroom drawn inside a living room.
    area, owner = areas[room_id], areas.get(owner_id)
    if owner is None or owner.area >= area.area or plan.common(area, owner).area < _OVERLAP_M2:
        return area
    return plan.without(area, owner)


def _rim(footprint: plan.Shape, reach: plan.Shape) -> plan.Shape:
    """The part of reach that cuts a straight wall where some of its thickness is left."""
    if footprint.is_empty or not footprint.intersects(reach):
        return shapely.Polygon()
    # Lay the wall along x.
    axes = along_and_across(footprint)
    remains = shapely.transform(plan.without(footprint, reach), lambda p: p @ axes.T)
    whole = shapely.transform(footprint, lambda p: p @ axes.T)
    x0, z0, x1, z1 = whole.bounds
    least_m = min(_LEAST_LEFT_M, _LEAST_LEFT_SHARE * (z1 - z0))
    # Every slice of a connected rest has thickness: its spans are where the wall goes on.
    size = x1 - x0 + z1 - z0
    spans = [
        shapely.box(p.bounds[0], z0 - size, p.bounds[2], z1 + size)
        for p in polygons_of(plan.opened(remains, least_m))
    ]
    goes_on = plan.on_grid(shapely.transform(plan.union(spans), lambda p: p @ axes))
    return plan.common(reach, goes_on)


def along_and_across(footprint: plan.Shape) -> F64:
    """(2, 2) unit vectors along and across the smallest rectangle around a footprint."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(footprint))
    sides = np.diff(corners[:3], axis=0)
    along = sides[int(np.linalg.norm(sides, axis=1).argmax())]
    along = along / max(float(np.linalg.norm(along)), 1e-12)
    return np.array([along, [-along[1], along[0]]])
