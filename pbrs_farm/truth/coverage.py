"""An item's unoccluded mask: the pixels it would cover if it were alone; no effects.

Exact at pixel centres: a ray through the eye meets a triangle where it lies on the same side of
the three planes through the eye and the triangle's edges (Olano and Greer 1997), so nothing is
clipped and nothing is divided by depth. On one row of pixels that is an interval.
"""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F32, F64, I32, I64, Mask
from pbrs_farm.core.camera import Camera, Intrinsics, pinholes_of
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import cross_products, finite_triangles, triangle_bounds

_CHUNK_ROWS = 500_000  # row intervals handled at once: bounds memory on large meshes


def coverage(item: Item, camera: Camera) -> Mask:
    """(H, W) bool: the ray through the pixel's centre meets any triangle of item.

    Exact for a pin-hole; of another lens, by pin-hole pictures that are finer than its own.
    """
    if camera.intrinsics.lens.is_pinhole:
        return _pinhole_coverage(item, camera)
    cameras, faces = pinholes_of(camera)
    return faces.nearest([_pinhole_coverage(item, face) for face in cameras])


def _pinhole_coverage(item: Item, camera: Camera) -> Mask:
    # Count intervals that begin and end along each row; their running sum is the depth of cover.
    i = camera.intrinsics
    starts = np.zeros((i.height_px, i.width_px + 1), np.int32)
    for s in item.surfaces:
        if len(s.faces):
            corners = _camera_space(s.positions, camera)[s.faces]
            _add_triangles(starts, finite_triangles(corners), i)
    # Sum up the rows that the item reaches.
    covered, used = np.zeros((i.height_px, i.width_px), np.bool_), starts.any(1)
    covered[used] = np.cumsum(starts[used], axis=1, dtype=np.int32)[:, :-1] > 0
    return covered


def _camera_space(points: F32, camera: Camera) -> F64:
    """(V, 3) x right, y down, z forward."""
    moved = points.astype(np.float64) - camera.eye
    return np.asarray(moved @ camera.world_from_camera[:3, :3] * [1.0, -1.0, -1.0])


def _add_triangles(starts: I32, corners: F64, i: Intrinsics) -> None:
    """Add to starts, per row, +1 where a triangle (T, 3, 3) begins and -1 past where it ends."""
    # Cut the triangles into chunks of bounded rows, one triangle at least.
    first, n_rows = _rows_of_triangles(corners, i)
    kept = np.nonzero(n_rows)[0]
    ends = np.cumsum(n_rows[kept])
    begin = 0
    while begin < len(kept):
        done = ends[begin - 1] if begin else 0
        stop = max(begin + 1, int(np.searchsorted(ends, done + _CHUNK_ROWS, side="right")))
        chosen = kept[begin:stop]
        _add_spans(starts, corners[chosen], first[chosen], n_rows[chosen], i)
        begin = stop


def _rows_of_triangles(corners: F64, i: Intrinsics) -> tuple[I64, I64]:
    """(T,) first row whose pixel centres a triangle may cover, and how many rows follow from it."""
    # Project triangles that lie wholly before the camera; others may cover any row.
    z = corners[..., 2]
    y = i.fy * corners[..., 1] / np.where(z > 1e-6, z, 1.0) + i.cy - 0.5
    (least_y, least_z), (most_y, most_z) = (b.T for b in triangle_bounds(np.stack([y, z], -1)))
    ahead = least_z > 1e-6
    first = np.where(ahead, np.ceil(least_y - 1e-6), 0)
    last = np.where(ahead, np.floor(most_y + 1e-6), i.height_px - 1)
    # Hold the rows to the picture; a triangle behind the camera covers none.
    first, last = np.clip(first, 0, i.height_px), np.clip(last, -1, i.height_px - 1)
    n_rows = np.where(most_z <= 0, 0, np.maximum(last - first + 1, 0))
    return first.astype(np.int64), n_rows.astype(np.int64)


def _add_spans(starts: I32, corners: F64, first: I64, n_rows: I64, i: Intrinsics) -> None:
    # List one interval for each triangle and row; y is the row's ray at z = 1.
    row = np.arange(n_rows.sum()) - np.repeat(np.cumsum(n_rows) - n_rows - first, n_rows)
    y = (row + 0.5 - i.cy) / i.fy

    # Span planes by the eye and each edge; turn them so that they are positive in the triangle.
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    planes = np.stack([cross_products(b, c), cross_products(c, a), cross_products(a, b)], axis=1)
    determinant = np.einsum("ti,ti->t", a, planes[:, 0])
    planes *= np.sign(determinant)[:, None, None]

    # Intersect the half-lines p x + q >= 0 on each row: bounds from below (p > 0), above (p < 0).
    low = np.full(len(row), -np.inf)
    high = np.full(len(row), np.inf)
    for edge in range(3):
        p, by_row, q = (np.repeat(planes[:, edge, k], n_rows) for k in range(3))
        q += by_row * y
        with np.errstate(divide="ignore", invalid="ignore"):
            bound = -q / p
        np.maximum(low, bound, out=low, where=p > 0)
        np.minimum(high, bound, out=high, where=p < 0)
        low[(p == 0) & (q < 0)] = np.inf

    # Round inwards to pixel centres and add the interval's two ends.
    left = np.ceil(np.clip(i.fx * low + i.cx - 0.5, 0, i.width_px)).astype(np.int64)
    right = np.floor(np.clip(i.fx * high + i.cx - 0.5, -1, i.width_px - 1)).astype(np.int64)
    covers = (right >= left) & np.repeat(determinant != 0, n_rows)
    begin, flat = row[covers] * (i.width_px + 1), starts.reshape(-1)
    np.add.at(flat, begin + left[covers], 1)
    np.add.at(flat, begin + right[covers] + 1, -1)
