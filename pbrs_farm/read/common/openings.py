"""Openings of doors and windows, found in the meshes of the walls they stand in; no effects.

Where the wall is cut already, as SUNCG's are (docs/spec/suncg.md section 1.5), the quad is the hole itself and
the cutter its plug, of the wall's thickness. In a wall without a hole they have the door's or window's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Box, Item, ItemKind, Opening, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors, face_areas
from pbrs_farm.geometry.solids import box

CUTTER_REACH_M: Final = 0.02  # how far a cutter reaches out of either face of a wall without a hole
_OVERLAP_M: Final = 0.002  # overlap of a plug with the wall around it
_HOLE_MARGIN_M: Final = 0.10  # a hole's rim lies no farther from the door's outline
_RIM_M: Final = 0.02  # from a hole's rim to the wall's end, and the least size of a hole
LEAST_HOLE_M: Final = 0.05  # width and height; a smaller one is a flaw of the mesh
_BESIDE_M: Final = 0.15  # a wall's faces lie no farther from the door's own plane
_PLANAR_M: Final = 0.01  # a wall that is thinner has one face
_THICKER_M: Final = 0.15  # how far the cutter of a planar wall reaches to either side
_LEAST_SHARE: Final = 0.02  # a direction that has less of the wall's upright area is no face of it
_UP: Final = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, slots=True, eq=False)
class _WallFrame:
    """The upright faces of a wall that look one way, or back."""

    level_id: str
    normal: F64  # (3,) unit
    points: F64  # (V, 3) world


def openings(items: Sequence[Item]) -> tuple[Opening, ...]:
    """An opening for every door and window that has a box and stands in a wall.

    items: all of a house, walls among them. A leaf that stands in no wall has no opening, and is
    not an error. Openings are not cut here: repair does that.
    """
    frames = [f for item in items if item.kind is ItemKind.WALL for f in _frames(item)]
    found = []
    for item in items:
        if item.kind in (ItemKind.DOOR, ItemKind.WINDOW) and item.box is not None:
            opening = _opening_of_leaf(item, item.box, frames)
            if opening is not None:
                found.append(opening)
    return tuple(found)


def _frames(item: Item) -> list[_WallFrame]:
    """A frame for every direction that an item's larger upright faces have, to a degree."""
    corners = corners_of_surfaces(item.surfaces)
    n, area = area_vectors(corners), face_areas(corners)
    # Group upright faces by the direction they look in, to a degree, either way round.
    upright = (np.abs(n[:, 1]) < 0.01 * (2 * area)) & (area > 0)
    n, area, corners = n[upright], area[upright], corners[upright]
    degree = np.rint(np.degrees(np.arctan2(n[:, 2], n[:, 0]))).astype(int) % 180
    found = []
    for d in np.unique(degree):
        here = degree == d
        if area[here].sum() < _LEAST_SHARE * area.sum():
            continue
        # Take the direction of the largest face of the group.
        best = n[here][area[here].argmax()] * [1, 0, 1]
        points = np.unique(corners[here].reshape(-1, 3), axis=0)
        found.append(_WallFrame(item.level_id, best / np.linalg.norm(best), points))
    return found


def _axes_of_wall(normal: F64) -> F64:
    """(3, 3) columns: along the wall, up, across."""
    return np.stack([np.cross(_UP, normal), _UP, normal], 1)


def _opening_of_leaf(item: Item, leaf: Box, frames: Sequence[_WallFrame]) -> Opening | None:
    normal = leaf.axes[:, 2] * [1, 0, 1]  # a model's front is +z, whatever its leaf does
    if np.linalg.norm(normal) < 0.5:
        return None  # lies flat: a roof window, which no wall holds
    normal = normal / np.linalg.norm(normal)
    axes = _axes_of_wall(normal)
    # Bound the door in the axes along, up and across, and find the walls it stands in.
    corners = leaf.corners @ axes
    low, high = corners.min(0), corners.max(0)
    standing = [
        p
        for f in frames
        if f.level_id == item.level_id
        for p in _wall_points_around(f, axes, low, high)
    ]
    if not standing:
        return None
    # Take the size of the holes where walls have some, else the door's own.
    holes = [h for h in (_hole(points, low, high) for points in standing) if h is not None]
    if holes:
        low[:2] = np.max([h[0] for h in holes], 0)
        high[:2] = np.min([h[1] for h in holes], 0)
    # Reach across all walls that it stands in.
    low[2] = min(p[:, 2].min() for p in standing)
    high[2] = max(p[:, 2].max() for p in standing)
    if high[2] - low[2] < _PLANAR_M:  # repair makes it a solid, to either side
        low[2], high[2] = low[2] - _THICKER_M, high[2] + _THICKER_M
    if (high - low)[:2].min() < LEAST_HOLE_M:
        return None
    # Lay the quad in the middle; a plug overlaps its hole, a cutter reaches out of the wall.
    middle = (low[2] + high[2]) / 2
    quad = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
    grown = np.array([_OVERLAP_M, _OVERLAP_M, 0.0] if holes else [0.0, 0.0, CUTTER_REACH_M])
    return Opening(
        id=f"{item.id}_hole",
        level_id=item.level_id,
        item_id=item.id,
        is_window=item.kind is ItemKind.WINDOW,
        cutter=box_between(low - grown, high + grown, axes),
        quad=np.array([[s, y, middle] for s, y in quad]) @ axes.T,
        normal=normal,
        is_cut=len(holes) == len(standing),
    )


def _wall_points_around(frame: _WallFrame, axes: F64, low: F64, high: F64) -> list[F64]:
    """The wall's points in axes, if it is the one (or one of those) that low..high stands in."""
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
    """(low, high) along and up of the hole that a wall has where low..high stands; None if none."""
    s, y = points[:, 0], points[:, 1]
    # The rim of a hole lies near the door's outline and not at the wall's ends.
    inner = (s > s.min() + _RIM_M) & (s < s.max() - _RIM_M)
    near = (s > low[0] - _HOLE_MARGIN_M) & (s < high[0] + _HOLE_MARGIN_M)
    near &= (y > low[1] - _HOLE_MARGIN_M) & (y < high[1] + _HOLE_MARGIN_M)
    rim = points[inner & near, :2]
    if len(rim) < 4 or np.ptp(rim, axis=0).min() < _RIM_M:
        return None
    return rim.min(0), rim.max(0)


def box_between(low: F64, high: F64, axes: F64) -> Surface:
    """A closed box between two corners.

    low, high: (3,) in the frame of axes, (3, 3) unit columns along the wall, up and across it.
    """
    return box("cutter", axes @ ((low + high) / 2), (high - low) / 2, 0, axes=axes)
