"""Openings of doors and windows: from the source's holes, else detected in the walls' meshes; no effects.

If the wall is cut already, as SUNCG's are (docs/spec/suncg.md section 1.5), the quad is the hole itself and
the cutter its plug, as thick as the wall. In a wall without a hole they have the door's or window's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Box, Item, ItemKind, Opening, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors, face_areas
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.geometry.solids import box

CUTTER_REACH_M: Final = 0.02  # how far a cutter reaches out of either face of a wall without a hole
_OVERLAP_M: Final = 0.002  # overlap of a plug with the wall around it
_HOLE_MARGIN_M: Final = 0.10  # maximum distance of a hole's rim from the door's outline, metres
_RIM_M: Final = 0.02  # from a hole's rim to the wall's end, and the least size of a hole
LEAST_HOLE_M: Final = 0.05  # width and height; a smaller one is a flaw of the mesh
_BESIDE_M: Final = 0.15  # a wall's faces lie no farther from the door's own plane
_PLANAR_M: Final = 0.01  # a thinner wall has one face, metres
_THICKER_M: Final = 0.15  # how far the cutter of a planar wall reaches to either side
_LEAST_SHARE: Final = 0.02  # a direction that has less of the wall's upright area is no face of it
_ROOF_M: Final = 0.6  # maximum distance of a hole's middle from the faces of its roof
_LEAST_SLOPE: Final = 0.1  # y of the normal of a roof's face, at least
_SAME_WAY: Final = 0.999  # least cosine between normals of one plane of a roof
_LEVEL: Final = 0.99  # y of the normal of a level roof, at least
_UP: Final = np.array([0.0, 1.0, 0.0])
_SIDE_SHARE: Final = (
    0.3  # of the largest direction's area: a direction that has less is no side of a wall
)


@dataclass(frozen=True, slots=True, eq=False)
class Void:
    """A hole given by the source and already cut out of walls."""

    id: str
    level_id: str
    walls: frozenset[str]  # ids of the wall items, or of those of a roof
    points: F64  # (N, 3) world, corners of the removed body
    item: Item | None = None  # the door or window in it
    is_window: bool = False
    undrawn: str = ""  # id of a door or window in it that has no mesh
    in_roof: bool = False
    others: tuple[str, ...] = ()  # ids of further doors and windows in it


@dataclass(frozen=True, slots=True, eq=False)
class _WallFrame:
    """The upright faces of a wall that look one way, or back."""

    item_id: str
    level_id: str
    normal: F64  # (3,) unit
    points: F64  # (V, 3) world
    corners: F64  # (F, 3, 3) world, of the faces
    area_m2: float
    is_side: bool  # no end of the wall

    def spans(self, low_y: float, high_y: float) -> bool:
        """True if the wall reaches from one height to another, as one of several storeys does."""
        y = self.points[:, 1]
        return bool(y.min() <= low_y + _RIM_M and high_y - _RIM_M <= y.max())


def openings(items: Sequence[Item]) -> tuple[Opening, ...]:
    """An opening, not cut yet, for every door and window in one of the walls among the items."""
    frames = [f for item in items if item.kind is ItemKind.WALL for f in _frames(item)]
    results = []
    for item in items:
        if item.kind in (ItemKind.DOOR, ItemKind.WINDOW) and item.box is not None:
            opening = _opening_of_leaf(item, item.box, frames)
            if opening is not None:
                results.append(opening)
    return tuple(results)


def openings_of_voids(items: Sequence[Item], voids: Sequence[Void]) -> dict[str, Opening]:
    """Openings of the source's holes, by the ids of their voids.

    items: all of a house, including walls. A void has no opening if it does not cut through its walls
    (a niche), or if it has no door or window and is inside another void.
    """
    frames = [f for item in items if item.kind is ItemKind.WALL for f in _frames(item)]
    openings: dict[str, Opening] = {}
    for void in sorted(voids, key=lambda v: (v.item is None, not v.undrawn)):
        opening = _opening_in_roof(void, items) if void.in_roof else _opening_of_void(void, frames)
        if opening is None:
            continue
        is_free = void.item is None and not void.undrawn
        if is_free and any(_lies_in(opening, o) for o in openings.values()):
            continue
        openings[void.id] = opening
    return openings


def _lies_in(opening: Opening, other: Opening) -> bool:
    quad, corners = opening.quad, other.cutter.positions
    inside = (quad > corners.min(0) - _BESIDE_M) & (quad < corners.max(0) + _BESIDE_M)
    return bool(inside.all() and abs(opening.normal @ other.normal) > 0.9)


def _opening_of_void(void: Void, frames: Sequence[_WallFrame]) -> Opening | None:
    own_frames = [f for f in frames if f.item_id in void.walls]
    if not own_frames:
        return None
    normal = _across_void(void, own_frames)
    axes = _axes_of_wall(normal)
    body = void.points @ axes
    low, high = body.min(0), body.max(0)
    # The corners that the cut left in the wall are its rim.
    wall = np.concatenate([f.points for f in own_frames]) @ axes
    rim = wall[(wall > low - _RIM_M).all(1) & (wall < high + _RIM_M).all(1)]
    has_rim = len(rim) >= 4 and np.ptp(rim[:, :2], axis=0).min() >= LEAST_HOLE_M
    # Without a rim the cut took the wall beside it away too, or failed.
    within = rim if has_rim else wall
    low, high = np.maximum(low, within.min(0)), np.minimum(high, within.max(0))
    if (high - low)[:2].min() < LEAST_HOLE_M:
        return None
    sides = [p for f in own_frames for p in _wall_points_around(f, axes, low, high)]
    if void.item is None and (not has_rim or _is_niche(rim, sides)):
        return None
    depth = [rim] if has_rim else sides
    if not depth:
        return None
    ends = np.stack([low, high])
    is_bare = not _is_covered((low + high) / 2, axes, own_frames)
    # Adjacent walls have their own holes, or are cut.
    wall_depths = [
        points
        for f in frames
        if f.item_id not in void.walls and f.is_side
        for points in _wall_points_around(f, axes, ends[0], ends[1])
    ]
    holes = [h for points in wall_depths if (h := _hole(points, ends[0], ends[1])) is not None]
    return _opening(
        void,
        axes=axes,
        ends=_across_walls(ends, [*depth, *wall_depths]),
        has_holes=is_bare,
        is_cut=is_bare and len(holes) == len(wall_depths),
    )


def _opening_in_roof(void: Void, items: Sequence[Item]) -> Opening | None:
    """The hole of a roof window, from the underside to the top of its roof; None without a roof around it."""
    corners = corners_of_surfaces([s for i in items if i.id in void.walls for s in i.surfaces])
    areas, centre = area_vectors(corners), void.points.mean(0)
    size = np.linalg.norm(areas, axis=1)
    # Of the planes beside the hole take the largest that is not upright.
    away = np.abs(((corners[:, 0] - centre) * areas).sum(1)) / np.maximum(size, 1e-12)
    is_near = (away < _ROOF_M) & (np.abs(areas[:, 1]) > _LEAST_SLOPE * size) & (size > 1e-9)
    if not is_near.any():
        return None
    normals = areas[is_near] / size[is_near, None]
    normals *= np.sign(normals[:, 1:2])
    agrees = normals @ normals.T > _SAME_WAY
    normal = normals[int((agrees * size[is_near]).sum(1).argmax())]
    along = np.cross(_UP, normal) if abs(normal[1]) < _LEVEL else _longest_side(void, normal)
    along = along / np.linalg.norm(along)
    axes = np.stack([along, np.cross(normal, along), normal], 1)
    body = void.points @ axes
    low, high = body.min(0), body.max(0)
    roof = corners.reshape(-1, 3) @ axes
    rim = roof[(roof > low - _RIM_M).all(1) & (roof < high + _RIM_M).all(1)]
    if len(rim) < 4 or np.ptp(rim[:, :2], axis=0).min() < LEAST_HOLE_M:
        return None
    ends = np.stack([rim.min(0), rim.max(0)])
    return _opening(void, axes=axes, ends=_across_walls(ends, [rim]), has_holes=True, is_cut=True)


def _longest_side(void: Void, normal: F64) -> F64:
    """(3,) the direction of a hole's longest edge in the plane of a level roof."""
    flat = void.points - (void.points @ normal)[:, None] * normal
    hull = shapely.MultiPoint(flat[:, [0, 2]]).minimum_rotated_rectangle
    sides = np.diff(shapely.get_coordinates(hull), axis=0)
    x, z = sides[int(np.hypot(*sides.T).argmax())] if len(sides) else (1.0, 0.0)
    side = np.array([x, 0.0, z])
    return np.asarray(side - (side @ normal) * normal)


def _is_niche(rim: F64, sides: Sequence[F64]) -> bool:
    """Whether a hole with that rim leaves part of the wall's thickness."""
    thick = np.ptp(np.concatenate([rim, *sides])[:, 2])
    return bool(np.ptp(rim[:, 2]) < thick - _RIM_M)


def _is_covered(place: F64, axes: F64, frames: Sequence[_WallFrame]) -> bool:
    """Whether faces of a wall's sides lie before or behind a place (3,) along, up and across it."""
    sides = [f.corners @ axes for f in frames if abs(float(f.normal @ axes[:, 2])) > 0.999]
    if not sides:
        return False
    # Look across the wall as from below.
    y = lowest_above(place[None, :2], np.concatenate(sides)[:, :, [0, 2, 1]], -np.inf)
    return bool(np.isfinite(y[0]))


def _across_void(void: Void, frames: Sequence[_WallFrame]) -> F64:
    """(3,) the direction across the wall: of its largest sides the one that the door's leaf agrees with."""
    largest = max(f.area_m2 for f in frames)
    sides = [f for f in frames if f.area_m2 >= _SIDE_SHARE * largest]
    leaf = void.item.box if void.item is not None else None
    if leaf is None or len(sides) == 1:
        return max(sides, key=lambda f: f.area_m2).normal
    thin = leaf.axes[:, 2]
    return max(sides, key=lambda f: (round(abs(float(f.normal @ thin)), 2), f.area_m2)).normal


def _across_walls(ends: F64, walls: Sequence[F64]) -> F64:
    """(2, 3) ends of a hole, extended through all walls that it cuts."""
    low, high = ends.copy()
    low[2] = min(p[:, 2].min() for p in walls)
    high[2] = max(p[:, 2].max() for p in walls)
    if high[2] - low[2] < _PLANAR_M:  # repair makes it a solid, to either side
        low[2], high[2] = low[2] - _THICKER_M, high[2] + _THICKER_M
    return np.stack([low, high])


def _frames(item: Item) -> list[_WallFrame]:
    """A frame for every direction that an item's larger upright faces have, to a degree."""
    corners = corners_of_surfaces(item.surfaces)
    n, area = area_vectors(corners), face_areas(corners)
    # Group upright faces by the direction they look in, to a degree, either way round.
    upright = (np.abs(n[:, 1]) < 0.01 * (2 * area)) & (area > 0)
    n, area, corners = n[upright], area[upright], corners[upright]
    degree = np.rint(np.degrees(np.arctan2(n[:, 2], n[:, 0]))).astype(int) % 180
    wall_frames = []
    of_degree = np.bincount(degree, area) if len(degree) else np.zeros(0)
    for d in np.unique(degree):
        mine = degree == d
        if area[mine].sum() < _LEAST_SHARE * area.sum():
            continue
        # Take the direction of the largest face of the group.
        best = n[mine][area[mine].argmax()] * [1, 0, 1]
        points = np.unique(corners[mine].reshape(-1, 3), axis=0)
        normal = best / np.linalg.norm(best)
        area_m2 = float(area[mine].sum())
        wall_frames.append(
            _WallFrame(
                item.id,
                item.level_id,
                normal,
                points,
                corners[mine],
                area_m2,
                is_side=area_m2 >= _SIDE_SHARE * of_degree.max(),
            )
        )
    return wall_frames


def _axes_of_wall(normal: F64) -> F64:
    """(3, 3) columns: along the wall, up, across."""
    return np.stack([np.cross(_UP, normal), _UP, normal], 1)


def _opening_of_leaf(item: Item, leaf: Box, frames: Sequence[_WallFrame]) -> Opening | None:
    normal = leaf.axes[:, 2] * [1, 0, 1]  # a model's front is +z, whatever its leaf does
    if np.linalg.norm(normal) < 0.5:
        return None  # horizontal: a roof window, in no wall
    normal = normal / np.linalg.norm(normal)
    axes = _axes_of_wall(normal)
    # Bound the door in the axes along, up and across, and find its walls.
    corners = leaf.corners @ axes
    low, high = corners.min(0), corners.max(0)
    standing = [
        p
        for f in frames
        if f.level_id == item.level_id or f.spans(float(low[1]), float(high[1]))
        for p in _wall_points_around(f, axes, low, high)
    ]
    if not standing:
        return None
    # Take the size of the holes where walls have some, else the door's own.
    holes = [h for h in (_hole(points, low, high) for points in standing) if h is not None]
    if holes:
        low[:2] = np.max([h[0] for h in holes], 0)
        high[:2] = np.min([h[1] for h in holes], 0)
    ends = _across_walls(np.stack([low, high]), standing)
    if (ends[1] - ends[0])[:2].min() < LEAST_HOLE_M:
        return None
    is_window = item.kind is ItemKind.WINDOW
    return _opening(
        Void(item.id, item.level_id, frozenset(), leaf.corners, item, is_window),
        axes=axes,
        ends=ends,
        has_holes=bool(holes),
        is_cut=len(holes) == len(standing),
    )


def _opening(void: Void, *, axes: F64, ends: F64, has_holes: bool, is_cut: bool) -> Opening:
    """The opening of a void between two corners (2, 3) in axes along the wall, up and across it."""
    low, high = ends
    # Lay the quad in the middle; a plug overlaps its hole, a cutter reaches out of the wall.
    middle = (low[2] + high[2]) / 2
    quad = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
    grown = np.array([_OVERLAP_M, _OVERLAP_M, 0.0] if has_holes else [0.0, 0.0, CUTTER_REACH_M])
    return Opening(
        id=void.id if void.item is None else f"{void.item.id}_hole",
        level_id=void.level_id,
        item_id=None if void.item is None else void.item.id,
        is_window=void.is_window,
        cutter=box_between(low - grown, high + grown, axes),
        quad=np.array([[s, y, middle] for s, y in quad]) @ axes.T,
        normal=axes[:, 2],
        is_cut=is_cut,
    )


def _wall_points_around(frame: _WallFrame, axes: F64, low: F64, high: F64) -> list[F64]:
    """The wall's points in axes, if low..high is inside it."""
    if abs(frame.normal @ axes[:, 2]) < 0.999:
        return []
    points = frame.points @ axes
    # Keep the points near the door's own plane.
    beside = (points[:, 2] > low[2] - _BESIDE_M) & (points[:, 2] < high[2] + _BESIDE_M)
    points = points[beside]
    if not len(points):
        return []
    wall_low, wall_high = points.min(0), points.max(0)
    # The wall holds the door where both overlap along the wall and upwards.
    overlap = np.minimum(wall_high - low, high - wall_low)[:2]
    return [points] if (overlap > _BESIDE_M).all() else []


def _hole(points: F64, low: F64, high: F64) -> tuple[F64, F64] | None:
    """(low, high) along and up of the wall's hole around low..high, if any."""
    s, y = points[:, 0], points[:, 1]
    # The rim of a hole is near the door's outline and away from the wall's ends.
    inner = (s > s.min() + _RIM_M) & (s < s.max() - _RIM_M)
    near = (s > low[0] - _HOLE_MARGIN_M) & (s < high[0] + _HOLE_MARGIN_M)
    near &= (y > low[1] - _HOLE_MARGIN_M) & (y < high[1] + _HOLE_MARGIN_M)
    rim = points[inner & near, :2]
    if len(rim) < 4 or np.ptp(rim, axis=0).min() < _RIM_M:
        return None
    return rim.min(0), rim.max(0)


def box_between(low: F64, high: F64, axes: F64) -> Surface:
    """A closed box between two corners in the frame of axes: (3, 3) columns along the wall, up, across."""
    return box("cutter", axes @ ((low + high) / 2), (high - low) / 2, 0, axes=axes)
