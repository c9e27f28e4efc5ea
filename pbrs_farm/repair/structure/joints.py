"""Where walls meet walls, floors and ceilings: solids inside both, so that joints intersect.

No effects. Joints keep _RECESS_M behind the walls' own faces: where the walls do touch nothing
of a joint shows, where they do not it fills the gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Room
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import Tag, TagTable, bounds, reduced
from pbrs_farm.repair.structure.planar_surfaces import PlanarSurface
from pbrs_farm.repair.structure.prisms import Plane, level_plane, polygons_of, solid_prisms
from pbrs_farm.repair.structure.slabs import GAP_M, SAME_HEIGHT_M
from pbrs_farm.repair.structure.walls import Wall

# Room volumes as solids, so that no slab or joint sticks into another room.


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
    """The volumes of every room, a part below each plane of its ceiling, a little too large.

    What they cut ends inside walls, floor and ceiling, flush with none of them.
    """
    margin = _margin(rooms)
    spans = _height_spans(surfaces)
    found = []
    for room in rooms:
        area = plan.polygon_of_room(room.polygon)
        own = frozenset(s.item for s in _bounding(room, surfaces, spans))
        # Stand a part below each plane of the ceiling, one below the nominal height elsewhere.
        ceilings = [s for s in surfaces if s.is_ceiling and s.room_id == room.id]
        floor = level_plane(room.floor_y - margin)
        parts = [(s.area, s.plane.raised(margin)) for s in ceilings]
        bare = plan.without(area, *(s.area for s in ceilings))
        parts.append((bare, level_plane(room.ceiling_y + margin)))
        for shape, high in parts:
            wide = plan.grown(shape, margin)
            found += [_volume(p, floor, high, own) for p in polygons_of(wide, min_area_m2=1e-3)]
    return found


def _height_spans(surfaces: Sequence[PlanarSurface]) -> F64:
    """(N, 2) lowest and highest y of each surface."""
    heights = [s.plane.at(shapely.get_coordinates(s.area)) for s in surfaces]
    return np.array([(y.min(), y.max()) for y in heights]).reshape(-1, 2)


def _bounding(room: Room, surfaces: Sequence[PlanarSurface], spans: F64) -> list[PlanarSurface]:
    # Count what lies at the room's own height: slabs.visible_areas settles it in plan.
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
    """solid less the volumes of rooms, save of the room that item (a floor or ceiling) bounds.

    New faces get tag.
    """
    cutters = []
    for volume in _overlapping(bounds(solid), volumes):
        if item in volume.items:
            continue
        # Cut with the volume, its faces tagged as the solid's own.
        cutters += solid_prisms([volume.area], volume.low, volume.high, (tag,) * 3, table)
    return reduced(solid, cutters)


def _overlapping(box: F64, volumes: Sequence[RoomVolume]) -> list[RoomVolume]:
    # Compare all bounds at once: a house has hundreds of joints and rooms.
    boxes = np.array([v.bounds for v in volumes]).reshape(-1, 2, 3)
    overlap = np.minimum(box[1], boxes[:, 1]) - np.maximum(box[0], boxes[:, 0])
    return [volumes[k] for k in np.flatnonzero((overlap >= _TOUCH_M).all(1)).tolist()]


# Where walls meet walls, floors and ceilings.


_RECESS_M = 0.001  # joints stay this far behind the faces of their walls
_OVERLAP_M = 0.01  # least height of a joint, and how far it reaches into its wall
_GAP_SEEN_M = 1e-4  # walls farther apart than this miss each other visibly


def joints_between_walls(
    walls: Sequence[Wall], rooms: plan.Shape, table: TagTable
) -> tuple[list[tuple[Wall, Manifold]], int]:
    """A solid across each place where two walls come within GAP_M, with the wall it belongs to.

    Second: how many of them bridge a gap (the others lie inside walls that touch). rooms: plan
    area of all rooms, into which no corner is filled.
    """
    found: list[tuple[Wall, Manifold]] = []
    n_gaps = 0
    tree = shapely.STRtree([w.footprint for w in walls])
    for i, a in enumerate(walls):
        for j in sorted(tree.query(a.footprint, "dwithin", GAP_M).tolist()):
            # Visit each pair once; shells of one item belong together already.
            if j <= i or walls[j].item == a.item:
                continue
            solids = _joint(a, walls[j], rooms, table)
            found += [(a, s) for s in solids]
            n_gaps += bool(solids) and a.footprint.distance(walls[j].footprint) > _GAP_SEEN_M
    return found, n_gaps


def _joint(a: Wall, b: Wall, rooms: plan.Shape, table: TagTable) -> list[Manifold]:
    # Fill what lies near both walls, drawn back behind their faces.
    both = plan.union([a.footprint, b.footprint])
    near = plan.common(plan.grown(a.footprint, GAP_M), plan.grown(b.footprint, GAP_M))
    if a.thickened and b.thickened:
        both, near = _outer_corner(a, b, rooms)
    inner = plan.grown(plan.closed(both, GAP_M), -_RECESS_M)
    areas = polygons_of(plan.common(near, inner))
    # Bridge walls that both end short of their corner.
    if not any(_touches(p, a) and _touches(p, b) for p in areas):
        areas += polygons_of(_bridge(a, b, rooms))
    # Run on into the slabs below and above where the joint crosses a gap.
    beyond = GAP_M if a.footprint.distance(b.footprint) > _GAP_SEEN_M else -_RECESS_M
    solids = []
    for polygon in areas:
        corners = shapely.get_coordinates(polygon)
        # Stand as high as both walls do.
        low = max(a.bottom_y, b.bottom_y) - beyond
        high = min(float(a.top.at(corners).min()), float(b.top.at(corners).min())) + beyond
        if high - low < _OVERLAP_M:
            continue
        tags = (a.tag("joint"),) * 3
        solids += solid_prisms([polygon], level_plane(low), level_plane(high), tags, table)
    return solids


def _touches(area: shapely.Polygon, wall: Wall) -> bool:
    return bool(area.distance(wall.footprint) < _RECESS_M)


def _bridge(a: Wall, b: Wall, rooms: plan.Shape) -> plan.Shape:
    # Span the ends of both walls, outside the rooms.
    return plan.without(_hull_of_ends(a.footprint, b.footprint), plan.grown(rooms, _RECESS_M))


def _hull_of_ends(a: plan.Shape, b: plan.Shape) -> plan.Shape:
    # Take the convex hull of what lies near the other one.
    ends = [plan.common(x, plan.grown(y, 1.5 * GAP_M)) for x, y in ((a, b), (b, a))]
    return shapely.convex_hull(plan.union(ends))


def _outer_corner(a: Wall, b: Wall, rooms: plan.Shape) -> tuple[plan.Shape, plan.Shape]:
    # Run both walls on to fill an outer corner: thickened outward, they touch at its edge only.
    strips = [_run_on(w) for w in (a, b)]
    corner = plan.without(plan.common(*strips), rooms)
    whole = plan.union([a.footprint, b.footprint, corner])
    return whole, plan.grown(corner, 2 * _OVERLAP_M)


def _run_on(wall: Wall) -> plan.Shape:
    # Lengthen the wall's footprint at both ends by its own thickness.
    box = shapely.minimum_rotated_rectangle(wall.footprint)
    corners = shapely.get_coordinates(box)[:4]
    sides = np.linalg.norm(np.roll(corners, -1, 0) - corners, axis=1)
    thickness, k = float(sides.min()), int(sides.argmax())  # k: the first of its two long sides
    along = (corners[(k + 1) % 4] - corners[k]) / max(float(sides.max()), 1e-9)
    middle = corners.mean(0)
    outward = np.sign((corners - middle) @ along)[:, None]
    return plan.on_grid(shapely.Polygon(corners + outward * along * thickness))


def joints_with_surface(
    surface: PlanarSurface,
    footprint: plan.Shape,
    walls: Sequence[Wall],
    doors: plan.Shape,
    thickness_m: float,
    table: TagTable,
) -> list[tuple[Wall, Manifold]]:
    """Wall parts that reach half a slab into the floor below or the ceiling above, hidden in it.

    Made where a wall ends within GAP_M of the surface's plane, so that a gap there is filled too, and
    in the corner of two walls of which one ends visibly short: over its whole height where they
    hardly touch.
    doors: plan area of openings down to the floor, where a wall has no foot.
    """
    depth_m = 0.5 * thickness_m
    away = 1.0 if surface.is_ceiling else -1.0  # out of the room
    feet: list[_Foot] = []
    for wall in plan.near_to(footprint, walls, lambda w: w.footprint, 0.0):
        area = plan.common(plan.grown(wall.footprint, -_RECESS_M), footprint)
        if not surface.is_ceiling:
            area = plan.without(area, doors)
        for polygon in polygons_of(area):
            corners = shapely.get_coordinates(polygon)
            # Compare the end of the wall with the plane of the floor or ceiling.
            end = wall.top if surface.is_ceiling else level_plane(wall.bottom_y)
            gap = away * (surface.plane.at(corners) - end.at(corners))
            if -depth_m <= gap.max() <= GAP_M:
                start = end.raised(-away * _OVERLAP_M)
                feet.append(_Foot(wall, polygon, start, float(gap.max())))
    # Reach from inside the wall to the middle of the slab.
    far = surface.plane.raised(away * depth_m)
    found = []
    for foot in [*feet, *_between(feet, is_ceiling=surface.is_ceiling)]:
        low, high = (foot.start, far) if surface.is_ceiling else (far, foot.start)
        corners = shapely.get_coordinates(foot.area)
        if (high.at(corners) - low.at(corners)).min() < _RECESS_M:
            continue
        tags = (foot.wall.tag("joint"),) * 3
        found += [(foot.wall, s) for s in solid_prisms([foot.area], low, high, tags, table)]
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Foot:
    """Where a wall stands on a floor or under a ceiling, drawn back behind its faces."""

    wall: Wall
    area: shapely.Polygon
    start: Plane  # inside the wall
    gap_m: float  # largest distance of its end from the floor or ceiling, negative inside that


def _between(feet: Sequence[_Foot], *, is_ceiling: bool) -> list[_Foot]:
    # Fill the corners of walls that end visibly short: drawn back, their feet are apart.
    found = []
    for a, b in combinations(feet, 2):
        if a.wall is b.wall or max(a.gap_m, b.gap_m) <= _GAP_SEEN_M:
            continue
        if a.area.distance(b.area) > GAP_M:
            continue
        shorter = max(a, b, key=lambda foot: foot.gap_m)
        # Fill a corner of which the walls share little over their whole height.
        if _is_loose(a.wall, b.wall):
            y = shorter.wall.bottom_y - GAP_M if is_ceiling else shorter.wall.high_y + GAP_M
            shorter = replace(shorter, start=level_plane(y))
        areas = polygons_of(_hull_of_ends(a.area, b.area))
        found += [replace(shorter, area=area) for area in areas]
    return found


def _is_loose(a: Wall, b: Wall) -> bool:
    # Rooms cut MARGIN_M off what fills a corner: ask whether the walls share a wider part of it.
    thin = [plan.grown(w.footprint, -0.5 * MARGIN_M) for w in (a, b)]
    both = plan.grown(plan.union([a.footprint, b.footprint]), -0.5 * MARGIN_M)
    return not any(all(p.intersects(t) for t in thin) for p in polygons_of(both))


# Walls drawn back where they reach into another room, so that each room sees its own.
# Where every room brings walls of its own (SUNCG), the walls of two neighbours fill one slab and
# their sides lie in one plane. A wall is cut there by the volume of the other room, but its rim
# alone: along the wall, wherever some of its thickness is left. What stands in the other room
# with all its thickness is a partition that one outline was drawn around, and stays.


_COINCIDE_M = 0.001  # walls nearer than this to a room lie in one plane with its own
_LEAST_LEFT_M = 0.01  # thickness that must be left behind a rim
_LEAST_LEFT_SHARE = 0.25  # of the wall's thickness, where that is less
_OVERLAP_M2 = 1e-3  # outlines that share less lie side by side


def with_own_sides_visible(
    walls: Sequence[Wall], rooms: Sequence[Room], table: TagTable
) -> list[Wall]:
    """The walls with their rims cut by other rooms; solid and footprint are what is left.

    Walls that belong to no room stay as they are.
    """
    areas = {r.id: plan.polygon_of_room(r.polygon) for r in rooms}
    found = []
    for wall in walls:
        if wall.room_id is None:
            found.append(wall)
            continue
        footprint, cutters = wall.footprint, []
        for room in rooms:
            apart = room.floor_y > wall.high_y or room.ceiling_y < wall.bottom_y
            if room.id == wall.room_id or apart:
                continue
            reach = plan.grown(_volume_in_plan(room.id, wall.room_id, areas), _COINCIDE_M)
            polygons = polygons_of(_rim(footprint, reach))
            # Draw the wall back from the whole height of the other room.
            low, high = level_plane(room.floor_y - GAP_M), level_plane(room.ceiling_y + GAP_M)
            cutters += solid_prisms(polygons, low, high, (wall.tag("hidden"),) * 3, table)
            footprint = plan.without(footprint, *polygons)
        if cutters:
            wall = replace(wall, solid=reduced(wall.solid, cutters), footprint=footprint)
        found.append(wall)
    return found


def _volume_in_plan(room_id: str, owner_id: str, areas: dict[str, plan.Shape]) -> plan.Shape:
    # Give what two outlines share to the smaller room: a bathroom drawn inside a living room.
    area, own = areas[room_id], areas.get(owner_id)
    if own is None or own.area >= area.area or plan.common(area, own).area < _OVERLAP_M2:
        return area
    return plan.without(area, own)


def _rim(footprint: plan.Shape, reach: plan.Shape) -> plan.Shape:
    """The part of reach that cuts a straight wall where some of its thickness is left."""
    if footprint.is_empty or not footprint.intersects(reach):
        return shapely.Polygon()
    # Lay the wall along x.
    axes = along_and_across(footprint)
    left = shapely.transform(plan.without(footprint, reach), lambda p: p @ axes.T)
    whole = shapely.transform(footprint, lambda p: p @ axes.T)
    x0, z0, x1, z1 = whole.bounds
    least_m = min(_LEAST_LEFT_M, _LEAST_LEFT_SHARE * (z1 - z0))
    # Every slice of a connected rest has thickness: its spans are where the wall goes on.
    size = x1 - x0 + z1 - z0
    spans = [
        shapely.box(p.bounds[0], z0 - size, p.bounds[2], z1 + size)
        for p in polygons_of(plan.opened(left, least_m))
    ]
    goes_on = plan.on_grid(shapely.transform(plan.union(spans), lambda p: p @ axes))
    return plan.common(reach, goes_on)


def along_and_across(footprint: plan.Shape) -> F64:
    """(2, 2) rows: unit vectors in plan along the longest side of a footprint, and across it."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(footprint))
    sides = np.diff(corners[:3], axis=0)
    along = sides[int(np.linalg.norm(sides, axis=1).argmax())]
    along = along / max(float(np.linalg.norm(along)), 1e-12)
    return np.array([along, [-along[1], along[0]]])
