"""Room volumes as solids, so that no slab or joint sticks into another room; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Room
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import Tag, TagTable, bounds, subtract
from pbrs_farm.repair.structure.planar_surfaces import PlanarSurface
from pbrs_farm.repair.structure.prisms import Plane, level_plane, polygons_of, solid_prisms
from pbrs_farm.repair.structure.slabs import SAME_HEIGHT_M

MARGIN_M = 0.005
"""Volumes of rooms reach this far into what bounds them."""

_TOUCH_M = 0.002  # solids that overlap less are left uncut


@dataclass(frozen=True, slots=True, eq=False)
class RoomVolume:
    """A part of a room's volume: a plan area between two planes."""

    area: shapely.Polygon
    low: Plane
    high: Plane
    items: frozenset[int]  # floors and ceilings that bound it, of any room
    bounds: F64  # (2, 3) lowest and highest corner


def volumes_of_rooms(rooms: Sequence[Room], surfaces: Sequence[PlanarSurface]) -> list[RoomVolume]:
    """Volumes of rooms, a part per ceiling plane, enlarged so that cuts end inside the structure."""
    margin = _margin(rooms)
    spans = _height_spans(surfaces)
    volumes = []
    for room in rooms:
        area = plan.polygon_of_room(room.polygon)
        items = frozenset(s.item for s in _bounding(room, surfaces, spans))
        # Stand a part below each plane of the ceiling, one below the nominal height elsewhere.
        ceilings = [s for s in surfaces if s.is_ceiling and s.room_id == room.id]
        floor = level_plane(room.floor_y - margin)
        parts = [(s.area, s.plane.raised(margin)) for s in ceilings]
        bare = plan.without(area, *(s.area for s in ceilings))
        parts.append((bare, level_plane(room.ceiling_y + margin)))
        for shape, high in parts:
            wide = plan.grown(shape, margin)
            volumes += [_volume(p, floor, high, items) for p in polygons_of(wide, min_area_m2=1e-3)]
    return volumes


def _height_spans(surfaces: Sequence[PlanarSurface]) -> F64:
    """(N, 2) lowest and highest y of each surface."""
    heights = [s.plane.at(shapely.get_coordinates(s.area)) for s in surfaces]
    return np.array([(y.min(), y.max()) for y in heights]).reshape(-1, 2)


def _bounding(room: Room, surfaces: Sequence[PlanarSurface], spans: F64) -> list[PlanarSurface]:
    # Count surfaces at the room's own height: slabs.visible_areas decides in plan.
    is_ceiling = np.array([s.is_ceiling for s in surfaces], np.bool_)
    nominal = np.where(is_ceiling, room.ceiling_y, room.floor_y)[:, None]
    is_level = np.abs(spans - nominal).max(1, initial=0.0) < SAME_HEIGHT_M
    return [s for s, level in zip(surfaces, is_level, strict=True) if level or s.room_id == room.id]


def _margin(rooms: Sequence[Room]) -> float:
    # Shrink the margin for thin floors: a roof may lie 1 mm above a ceiling.
    gaps = [
        upper.floor_y - lower.ceiling_y
        for lower in rooms
        for upper in rooms
        if upper.floor_y > lower.ceiling_y
    ]
    return min([MARGIN_M, *(gap / 3 for gap in gaps)])


def _volume(area: shapely.Polygon, low: Plane, high: Plane, items: frozenset[int]) -> RoomVolume:
    corners = shapely.get_coordinates(area)
    x0, z0, x1, z1 = area.bounds
    box = np.array([[x0, low.at(corners).min(), z0], [x1, high.at(corners).max(), z1]])
    return RoomVolume(area, low, high, items, box)


def without_volumes(
    solid: Manifold, tag: Tag, item: int | None, volumes: Sequence[RoomVolume], table: TagTable
) -> Manifold:
    """solid less the volumes of rooms but that which item bounds; new faces get tag."""
    cutters = []
    for volume in _overlapping(bounds(solid), volumes):
        if item in volume.items:
            continue
        # Cut with the volume, its faces tagged as the solid's own.
        cutters += solid_prisms([volume.area], volume.low, volume.high, (tag,) * 3, table)
    return subtract(solid, cutters)


def _overlapping(box: F64, volumes: Sequence[RoomVolume]) -> list[RoomVolume]:
    # Compare all bounds in one array operation: a house has hundreds of joints and rooms.
    boxes = np.array([v.bounds for v in volumes]).reshape(-1, 2, 3)
    overlap = np.minimum(box[1], boxes[:, 1]) - np.maximum(box[0], boxes[:, 0])
    return [volumes[k] for k in np.flatnonzero((overlap >= _TOUCH_M).all(1)).tolist()]
