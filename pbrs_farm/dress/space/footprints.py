"""The plan area of an item's mesh between two heights, and of walls; no effects. Plan is (x, z)."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import clipped_to_box, triangle_bounds
from pbrs_farm.geometry.surface_points import item_triangles, surface_points

_GRID_M = 1e-4  # plan coordinates are rounded to this
_THIN_M = 0.004  # half the width given to vertical faces, metres
_FAR = 1e6
_MANY = 300  # triangles
_SQUARE_M = 0.01


def item_footprint(item: Item, low_y: float = -_FAR, high_y: float = _FAR) -> BaseGeometry:
    """Plan area, maybe empty, of the triangles between two heights, vertical faces as strips of 8 mm."""
    corners = item_triangles(item)
    if low_y > -_FAR or high_y < _FAR:
        low, high = np.array([-_FAR, low_y, -_FAR]), np.array([_FAR, high_y, _FAR])
        inside = ((corners[:, :, 1] >= low_y) & (corners[:, :, 1] <= high_y)).all(1)
        cut = clipped_to_box(corners[~inside], low, high)
        corners = np.concatenate([corners[inside], cut])
    return plan_area(corners)


def plan_area(corners: F64, *, upright: bool = True) -> BaseGeometry:
    """The plan area of triangles (F, 3, 3): a polygon, several or none.

    upright: upright faces count, as strips; without, only where nothing else is there.
    Meshes of many triangles are taken by squares of 1 cm: exact unions would take seconds.
    """
    if upright and len(corners) > _MANY:
        return _area_by_squares(surface_points(corners, _SQUARE_M))
    plan = corners[:, :, [0, 2]]
    u, v = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
    twice_area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    # Add horizontal triangles once each.
    flat = plan[twice_area > 1e-7]
    shapes: list[BaseGeometry] = [shapely.Polygon(triangle) for triangle in flat]
    # Give upright ones a width.
    standing = plan[twice_area <= 1e-7]
    if len(standing) and (upright or not shapes):
        low, high = triangle_bounds(standing)
        # The line goes from the leftmost corner to the rightmost; sign by the other axis.
        order = np.argsort(standing[:, :, 0] + 1e-3 * standing[:, :, 1], axis=1)
        rows = np.arange(len(standing))
        ends = np.stack([standing[rows, order[:, 0]], standing[rows, order[:, 2]]], 1)
        ends = np.unique(np.round(ends[(high - low).max(1) > 1e-3], 4), axis=0)
        if len(ends):
            lines = shapely.union_all(shapely.linestrings(ends))
            shapes.append(shapely.buffer(lines, _THIN_M, cap_style="flat", quad_segs=1))
    if not shapes:
        return shapely.Polygon()
    union = shapely.union_all(shapes, grid_size=_GRID_M)
    return areal(union)


def _area_by_squares(points: F64) -> BaseGeometry:
    cells = np.floor(points[:, [2, 0]] / _SQUARE_M).astype(np.int64)
    # Number the squares row by row: faster than comparing rows and columns.
    least, n_columns = cells.min(0), int(np.ptp(cells[:, 1])) + 1
    number = np.unique((cells[:, 0] - least[0]) * n_columns + cells[:, 1] - least[1])
    cells = np.stack(np.divmod(number, n_columns), -1) + least
    # Join neighbours of a row into one rectangle.
    new = np.r_[True, (np.diff(cells[:, 0]) != 0) | (np.diff(cells[:, 1]) != 1)]
    first = np.flatnonzero(new)
    last = np.r_[first[1:], len(cells)] - 1
    row, start, end = cells[first, 0], cells[first, 1], cells[last, 1] + 1
    boxes = shapely.box(start * _SQUARE_M, row * _SQUARE_M, end * _SQUARE_M, (row + 1) * _SQUARE_M)
    return areal(shapely.union_all(boxes, grid_size=_GRID_M))


def areal(shape: BaseGeometry) -> BaseGeometry:
    """shape without the lines and points of overlays, valid; may be empty."""
    shape = shapely.make_valid(shape)
    if shape.geom_type in ("Polygon", "MultiPolygon"):
        return shape
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.union_all([p for p in parts.tolist() if p.geom_type == "Polygon"])
