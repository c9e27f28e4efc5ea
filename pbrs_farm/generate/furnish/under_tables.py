"""Depth that a chair fits under a table before the two touch; no effects but caches.

Both are rendered to depth maps along the direction of motion: per cell of 8 mm, how far the chair
extends and where the table begins. They touch at the minimum difference, for any position along
the edge, so each side of a table is rendered once.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import corners_of_surfaces
from pbrs_farm.geometry.surface_points import surface_points

_CELL_M: Final = 0.008
_SPACING_M: Final = 0.008  # of points: a leg covers cells enough where one of them is empty
_QUARTER: Final = np.array([1.0, 1.0, -1.0])
_APART_M: Final = 0.004  # at which a chair stops before the table


class _Depths(NamedTuple):
    """Depths in metres by cells across the way: x, then height. Where nothing is they are infinite."""

    first: tuple[int, int]  # number of the first cell
    depths: F64
    inner: Bools  # cells that count: a chair's rim may graze


def way_under_m(chair: Shape, table: Shape, at: float, turns: int, most_m: float) -> float:
    """Metres, at most most_m, that a chair's front goes beyond a table's edge; turns: quarters to the left."""
    return min(_way_m(chair, table, round(at / _CELL_M), turns % 4, most_m), most_m)


@lru_cache(maxsize=65536)
def _way_m(chair: Shape, table: Shape, at: int, turns: int, most_m: float) -> float:
    front, near = _front(chair), _near(table, turns, most_m)
    # Cells that both have, counted from the chair's middle.
    begins = np.array(near.first) - [at, 0]
    low = np.maximum(front.first, begins)
    high = np.minimum(
        np.array(front.first) + front.depths.shape, begins + np.array(near.depths.shape)
    )
    if (low >= high).any():
        return np.inf
    a, b = (tuple(map(slice, low - first, high - first)) for first in (front.first, begins))
    distances = np.where(front.inner[a], near.depths[b] - front.depths[a], np.inf)
    return max(float(distances.min()) - _APART_M, 0.0)


@lru_cache(maxsize=512)
def _front(chair: Shape) -> _Depths:
    """Extent of a chair relative to its front, at most 0: chairs face +z."""
    corners = corners_of_surfaces(chair.surfaces)
    points = surface_points(corners, _SPACING_M)
    first, depths = _greatest(points, points[:, 2] - corners[..., 2].max())
    covered = ndimage.binary_closing(np.isfinite(depths))
    return _Depths(first, depths, ndimage.binary_erosion(covered) & np.isfinite(depths))


@lru_cache(maxsize=512)
def _near(table: Shape, turns: int, most_m: float) -> _Depths:
    """Where a table begins behind an edge, seen by a chair there, mostly cells within most_m."""
    corners = corners_of_surfaces(table.surfaces)
    box = np.stack([corners.min((0, 1)), corners.max((0, 1))])
    # Take the points near the edge alone.
    end, axis = ((0, 2), (1, 0), (1, 2), (0, 0))[turns]
    slab = box + np.array([[-1.0], [1.0]])
    reach = most_m + _APART_M + _CELL_M
    slab[1 - end, axis] = box[end, axis] + (-reach if end else reach)
    points = surface_points(corners, _SPACING_M, slab)
    for _ in range(turns):
        # A quarter turn, without a rounding: z takes the place of x, -x that of z.
        points, box = (rows[:, [2, 1, 0]] * _QUARTER for rows in (points, box))
    first, depths = _greatest(points, box[:, 2].min() - points[:, 2])
    return _Depths(first, -depths, np.isfinite(depths))


def _greatest(points: F64, values: F64) -> tuple[tuple[int, int], F64]:
    """The first cell and the greatest value in each; an empty rim of two cells around them."""
    cells = np.floor(points[:, :2] / _CELL_M).astype(np.int64)
    first = cells.min(0) - 2
    greatest = np.full(tuple(cells.max(0) - first + 3), -np.inf)
    # One index: numpy's fast way.
    np.maximum.at(greatest.reshape(-1), (cells - first) @ [greatest.shape[1], 1], values)
    return (int(first[0]), int(first[1])), greatest
