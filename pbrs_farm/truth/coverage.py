"""An item's unoccluded mask: the pixels it would cover if it were alone; no effects.

Exact at pixel centres: a ray through the eye hits a triangle if it is on the same side of the three
planes through the eye and the triangle's edges (Olano and Greer 1997), so nothing is clipped or divided
by depth. On one row of pixels that is an interval.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F32, F64, I32, I64, Bools, Mask
from pbrs_farm.core.camera import Camera, Intrinsics, pinholes_of
from pbrs_farm.core.cutouts import CutOut, CutOuts
from pbrs_farm.core.house import Item, Surface
from pbrs_farm.core.mesh import cross_products, finite_triangles, triangle_bounds

_CHUNK_ROWS = 500_000  # row intervals per batch, to bound memory on large meshes
_CHUNK_PIXELS = 500_000  # and pixels of surfaces with holes


def coverage(item: Item, camera: Camera, cut_outs: CutOuts | None = None) -> Mask:
    """(H, W) bool: item's pixels alone, holes excluded; exact for a pinhole, by finer ones for other lenses."""
    holes = cut_outs or {}
    if camera.intrinsics.lens.is_pinhole:
        return _pinhole_coverage(item, camera, holes)
    cameras, faces = pinholes_of(camera)
    return faces.nearest([_pinhole_coverage(item, face, holes) for face in cameras])


def _pinhole_coverage(item: Item, camera: Camera, cut_outs: CutOuts) -> Mask:
    # Count intervals that begin and end along each row; their running sum is the depth of cover.
    i = camera.intrinsics
    starts = np.zeros((i.height_px, i.width_px + 1), np.int32)
    covered = np.zeros((i.height_px, i.width_px), np.bool_)
    solid: list[F64] = []
    for s in item.surfaces:
        if not len(s.faces):
            continue
        corners = _camera_space(s.positions, camera)[s.faces]
        if s.material in cut_outs:
            _cover_without_holes(covered, corners, s, cut_outs[s.material], i)
        else:
            solid.append(finite_triangles(corners))
    # In one call, as most surfaces are small.
    if solid:
        for spans in _spans_of_triangles(np.concatenate(solid), i):
            _add_spans(starts, spans)
    # Sum up the rows that the item reaches.
    used = starts.any(1)
    covered[used] |= np.cumsum(starts[used], axis=1, dtype=np.int32)[:, :-1] > 0
    return covered


class _Spans(NamedTuple):
    """Intervals of pixels on rows, both ends inclusive."""

    triangle: I64  # (N,) triangle indices
    row: I64
    left: I64
    right: I64


def _add_spans(starts: I32, spans: _Spans) -> None:
    """Add to starts, per row, +1 where a span begins and -1 past where it ends."""
    begin, flat = spans.row * starts.shape[1], starts.reshape(-1)
    np.add.at(flat, begin + spans.left, 1)
    np.add.at(flat, begin + spans.right + 1, -1)


def _cover_without_holes(
    covered: Mask, corners: F64, surface: Surface, holes: CutOut, i: Intrinsics
) -> None:
    """Mark the pixels that a surface's triangles (F, 3, 3) cover where it has no hole."""
    finite = np.isfinite(corners).all((1, 2))
    corners, faces = corners[finite], surface.faces[finite]
    uvs = np.zeros((len(surface.positions), 2)) if surface.uvs is None else surface.uvs
    planes, _ = _edge_planes(corners)
    for spans in _spans_of_triangles(corners, i):
        for part in _parts_by_pixels(spans):
            # List every pixel of the spans that nothing covers yet.
            n = part.right - part.left + 1
            column = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n - part.left, n)
            triangle, row = np.repeat(part.triangle, n), np.repeat(part.row, n)
            is_open = ~covered[row, column]
            triangle, row, column = triangle[is_open], row[is_open], column[is_open]
            # Weigh the corners by the planes of the edges over against them.
            x, y = (column + 0.5 - i.cx) / i.fx, (row + 0.5 - i.cy) / i.fy
            ray = np.stack([x, y, np.ones(len(row))], axis=1)
            weights = np.einsum("ntk,nk->nt", planes[triangle], ray)
            weights /= weights.sum(1, keepdims=True)
            uv = np.einsum("nt,ntc->nc", weights, uvs[faces[triangle]].astype(np.float64))
            solid = ~holes.is_hole(uv)
            covered[row[solid], column[solid]] = True


def _parts_by_pixels(spans: _Spans) -> Iterator[_Spans]:
    """The spans in batches bounded by their pixels."""
    ends = np.cumsum(spans.right - spans.left + 1)
    most = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(_CHUNK_PIXELS, most, _CHUNK_PIXELS))
    for part in np.split(np.arange(len(ends)), cuts):
        yield _Spans(*(values[part] for values in spans))


def _camera_space(points: F32, camera: Camera) -> F64:
    """(V, 3) x right, y down, z forward."""
    moved = points.astype(np.float64) - camera.eye
    return np.asarray(moved @ camera.world_from_camera[:3, :3] * [1.0, -1.0, -1.0])


def _spans_of_triangles(corners: F64, i: Intrinsics) -> Iterator[_Spans]:
    """The rows of pixel centres covered by each triangle (T, 3, 3), in batches."""
    # Cut the triangles into chunks of bounded rows, one triangle at least.
    first, n_rows = _rows_of_triangles(corners, i)
    rows = np.nonzero(n_rows)[0]
    ends = np.cumsum(n_rows[rows])
    begin = 0
    while begin < len(rows):
        done = ends[begin - 1] if begin else 0
        stop = max(begin + 1, int(np.searchsorted(ends, done + _CHUNK_ROWS, side="right")))
        chosen = rows[begin:stop]
        spans = _row_spans(corners[chosen], first[chosen], n_rows[chosen], i)
        yield spans._replace(triangle=chosen[spans.triangle])
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


def _edge_planes(corners: F64) -> tuple[F64, Bools]:
    """(T, 3, 3) normals of the planes through the eye and the edge over against each corner, positive
    in the triangle; (T,) whether it is seen from its edge."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    planes = np.stack([cross_products(b, c), cross_products(c, a), cross_products(a, b)], axis=1)
    determinant = np.einsum("ti,ti->t", a, planes[:, 0])
    planes *= np.sign(determinant)[:, None, None]
    return planes, determinant == 0


def _row_spans(corners: F64, first: I64, n_rows: I64, i: Intrinsics) -> _Spans:
    # List one interval for each triangle and row; y is the row's ray at z = 1.
    row = np.arange(n_rows.sum()) - np.repeat(np.cumsum(n_rows) - n_rows - first, n_rows)
    y = (row + 0.5 - i.cy) / i.fy

    planes, is_edge_on = _edge_planes(corners)

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

    # Round inwards to pixel centres.
    first_column = np.ceil(np.clip(i.fx * low + i.cx - 0.5, 0, i.width_px)).astype(np.int64)
    right = np.floor(np.clip(i.fx * high + i.cx - 0.5, -1, i.width_px - 1)).astype(np.int64)
    triangle = np.repeat(np.arange(len(corners)), n_rows)
    covers = (right >= first_column) & ~is_edge_on[triangle]
    return _Spans(*(values[covers] for values in (triangle, row, first_column, right)))
