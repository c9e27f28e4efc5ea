"""Solids inside two walls, or wall and floor or ceiling, _RECESS_M behind their faces, as joints; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely
from manifold3d import Manifold

from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.booleans import TagTable
from pbrs_farm.repair.structure.planar_surfaces import Cover, PlanarSurface
from pbrs_farm.repair.structure.prisms import Plane, level_plane, polygons_of, solid_prisms
from pbrs_farm.repair.structure.room_volumes import MARGIN_M
from pbrs_farm.repair.structure.slabs import FOOT_M, GAP_M
from pbrs_farm.repair.structure.walls import Wall

_RECESS_M = 0.001  # joints stay this far behind the faces of their walls
_OVERLAP_M = 0.01  # least height of a joint, and how far it reaches into its wall
_GAP_SEEN_M = 1e-4  # walls farther apart than this miss each other visibly


def joints_between_walls(
    walls: Sequence[Wall], rooms: plan.Shape, table: TagTable
) -> tuple[list[tuple[Wall, Manifold]], int]:
    """(wall, solid) for walls within GAP_M, outside rooms, and the number of those that bridge a gap."""
    parts: list[tuple[Wall, Manifold]] = []
    n_gaps = 0
    tree = shapely.STRtree([w.footprint for w in walls])
    for i, a in enumerate(walls):
        for j in sorted(tree.query(a.footprint, "dwithin", GAP_M).tolist()):
            # Visit each pair once; shells of one item belong together already.
            if j <= i or walls[j].item == a.item:
                continue
            solids = _joint(a, walls[j], rooms, table)
            parts += [(a, s) for s in solids]
            n_gaps += bool(solids) and a.footprint.distance(walls[j].footprint) > _GAP_SEEN_M
    return parts, n_gaps


def _joint(a: Wall, b: Wall, rooms: plan.Shape, table: TagTable) -> list[Manifold]:
    # Fill the area near both walls, set back behind their faces.
    area = plan.union([a.footprint, b.footprint])
    near = plan.common(plan.grown(a.footprint, GAP_M), plan.grown(b.footprint, GAP_M))
    if a.thickened and b.thickened:
        area, near = _outer_corner(a, b, rooms)
    inner = plan.grown(plan.closed(area, GAP_M), -_RECESS_M)
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
    # Take the convex hull of the parts near the other wall.
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
    surface: PlanarSurface | Cover,
    footprint: plan.Shape,
    walls: Sequence[Wall],
    doors: plan.Shape,
    thickness_m: float,
    table: TagTable,
) -> list[tuple[Wall, Manifold]]:
    """Wall parts that reach half a slab into the floor below or the ceiling above, hidden in it.

    Made where a wall ends within GAP_M of the surface's plane, FOOT_M above a floor, so that a gap
    there is filled too, and in the corner of two walls of which one ends visibly short: over its whole
    height where they hardly touch.
    surface: a solid floor is a Cover, to which joints are made across gaps only. doors: plan area of
    openings down to the foot of their wall, where a wall has no foot; a gap below them is filled.
    """
    depth_m = 0.5 * thickness_m
    away = 1.0 if surface.is_ceiling else -1.0  # out of the room
    most_gap = GAP_M if surface.is_ceiling else FOOT_M
    feet: list[_Foot] = []
    for wall in plan.near_to(footprint, walls, lambda w: w.footprint, 0.0):
        area = plan.common(plan.grown(wall.footprint, -_RECESS_M), footprint)
        end = wall.top if surface.is_ceiling else level_plane(wall.bottom_y)
        for polygon, is_sill in _feet_and_sills(area, doors, is_ceiling=surface.is_ceiling):
            corners = shapely.get_coordinates(polygon)
            # Compare the end of the wall with the plane of the floor or ceiling.
            gap = away * (surface.plane.at(corners) - end.at(corners))
            least_gap = _GAP_SEEN_M if is_sill or isinstance(surface, Cover) else -depth_m
            if least_gap <= gap.max() <= most_gap:
                start = end.raised(-away * _OVERLAP_M)
                feet.append(_Foot(wall, polygon, start, float(gap.max())))
    # Reach from inside the wall to the middle of the slab.
    far = surface.plane.raised(away * depth_m)
    parts = []
    for foot in [*feet, *_joint_between(feet, is_ceiling=surface.is_ceiling)]:
        low, high = (foot.start, far) if surface.is_ceiling else (far, foot.start)
        corners = shapely.get_coordinates(foot.area)
        if (high.at(corners) - low.at(corners)).min() < _RECESS_M:
            continue
        tags = (foot.wall.tag("joint"),) * 3
        parts += [(foot.wall, s) for s in solid_prisms([foot.area], low, high, tags, table)]
        if isinstance(surface, Cover):
            # Reach into the solid floor beside the wall, below its face.
            wider = polygons_of(plan.grown(foot.area, _OVERLAP_M))
            below = surface.plane.raised(away * _OVERLAP_M)
            parts += [(foot.wall, s) for s in solid_prisms(wider, far, below, tags, table)]
    return parts


def _feet_and_sills(
    area: plan.Shape, doors: plan.Shape, *, is_ceiling: bool
) -> Iterator[tuple[shapely.Polygon, bool]]:
    """The pieces of a wall's end, each with whether it is below a door."""
    below = plan.union([]) if is_ceiling else plan.common(area, doors)
    yield from ((polygon, False) for polygon in polygons_of(plan.without(area, below)))
    yield from ((polygon, True) for polygon in polygons_of(below))


@dataclass(frozen=True, slots=True, eq=False)
class _Foot:
    """Contact area of a wall with a floor or ceiling, set back behind its faces."""

    wall: Wall
    area: shapely.Polygon
    start: Plane  # inside the wall
    gap_m: float  # largest distance of its end from the floor or ceiling, negative inside that


def _joint_between(feet: Sequence[_Foot], *, is_ceiling: bool) -> list[_Foot]:
    # Fill the corners of walls that end visibly short: drawn back, their feet are apart.
    corners = []
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
        corners += [replace(shorter, area=area) for area in areas]
    return corners


def _is_loose(a: Wall, b: Wall) -> bool:
    # Rooms cut MARGIN_M off what fills a corner: ask whether the walls share a wider part of it.
    thin = [plan.grown(w.footprint, -0.5 * MARGIN_M) for w in (a, b)]
    area = plan.grown(plan.union([a.footprint, b.footprint]), -0.5 * MARGIN_M)
    return not any(all(p.intersects(t) for t in thin) for p in polygons_of(area))
