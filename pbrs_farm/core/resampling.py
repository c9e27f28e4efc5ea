"""Arrays on another pixel grid or between pixels, the same bits on every machine; no effects."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Pixels = TypeVar("Pixels", bound=NDArray[Any])


def resized_by_area(picture: Pixels, width: int, height: int) -> Pixels:
    """(height, width, ...) means over pixels' areas of (H, W, ...), bytes as encoded and rounded."""
    if picture.shape[:2] == (height, width):
        return picture
    if picture.dtype.kind == "f":
        wide = _axis_means(_axis_means(picture.astype(np.float64), 0, height), 1, width)
        return wide.astype(picture.dtype)  # type: ignore[return-value]
    # Average whole blocks in integers where the grid divides, else along one axis after the other.
    rows, columns = picture.shape[0] / height, picture.shape[1] / width
    if rows.is_integer() and columns.is_integer():
        return _block_means(picture, int(rows), int(columns))  # type: ignore[return-value]
    means = _axis_means(_axis_means(picture.astype(np.float64), 0, height), 1, width)
    return np.asarray(np.rint(means), np.uint8)  # type: ignore[return-value]


def resized_nearest(array: Pixels, width: int, height: int) -> Pixels:
    """(height, width, ...) of the nearest centres, for ids and classes; the array itself if unchanged."""
    if array.shape[:2] == (height, width):
        return array
    rows = _nearest(array.shape[0], height)
    columns = _nearest(array.shape[1], width)
    return np.ascontiguousarray(array[rows[:, None], columns])  # type: ignore[return-value]


def resized_any(mask: NDArray[np.bool_], width: int, height: int) -> NDArray[np.bool_]:
    """(height, width) bool: any pixel of mask (H, W) in the area; the mask itself if unchanged."""
    if mask.shape == (height, width):
        return mask
    for axis, n in ((0, height), (1, width)):
        size = mask.shape[axis]
        first = np.arange(n) * size // n
        # Take at least one pixel, where the grid grows.
        last = np.maximum(-(-(np.arange(n) + 1) * size // n), first + 1)
        counts = np.insert(np.cumsum(mask, axis=axis, dtype=np.int32), 0, 0, axis=axis)
        mask = np.take(counts, last, axis=axis) > np.take(counts, first, axis=axis)
    return mask


def bilinear(
    pixels: NDArray[np.uint8],
    uv: NDArray[np.floating],
    value_of_byte: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """(N, C) values of pixels (H, W, C) at uv (N, 2), v up, row 0 on top; value_of_byte: decoded, if given."""
    # Place texel centres at half integers; v points up, rows count down.
    height, width = pixels.shape[:2]
    finite = np.where(np.isfinite(uv), uv, 0).astype(np.float64)
    x = finite[:, 0] * width - 0.5
    y = (1 - finite[:, 1]) * height - 0.5
    # The four texels around each point, and its fraction between them.
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0).astype(np.float32)[:, None], (y - y0).astype(np.float32)[:, None]
    left, right = (x0 % width).astype(np.int64), ((x0 + 1) % width).astype(np.int64)
    top, bottom = (y0 % height).astype(np.int64), ((y0 + 1) % height).astype(np.int64)

    def at(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
        texels = pixels[rows, columns]
        return texels.astype(np.float32) if value_of_byte is None else value_of_byte[texels]

    # Blend along rows first.
    upper = at(top, left) * (1 - fx) + at(top, right) * fx
    lower = at(bottom, left) * (1 - fx) + at(bottom, right) * fx
    return np.asarray(upper * (1 - fy) + lower * fy, np.float32)


def _nearest(size: int, n: int) -> NDArray[np.intp]:
    return ((2 * np.arange(n) + 1) * size // (2 * n)).astype(np.intp)


def _block_means(picture: NDArray[np.uint8], rows: int, columns: int) -> NDArray[np.uint8]:
    # Sum the pixels of each block one by one: slices are quicker than a sum over short axes.
    total = np.zeros((picture.shape[0] // rows, *picture.shape[1:]), np.uint32)
    for row in range(rows):
        total += picture[row::rows]
    block = np.zeros((total.shape[0], total.shape[1] // columns, *picture.shape[2:]), np.uint32)
    for column in range(columns):
        block += total[:, column::columns]
    # Round halves up, in integers.
    area = rows * columns
    return ((block + area // 2) // area).astype(np.uint8)


def _axis_means(array: NDArray[np.float64], axis: int, n: int) -> NDArray[np.float64]:
    # Sum up to each edge of the new grid; a mean is the difference of two sums.
    size = array.shape[axis]
    sums = np.insert(np.cumsum(array, axis=axis), 0, 0, axis=axis)
    edges = np.arange(n + 1) * (size / n)
    whole = np.minimum(edges.astype(np.intp), size - 1)
    part = (edges - whole).reshape(-1, *(1,) * (array.ndim - 1 - axis))
    at_edges = np.take(sums, whole, axis=axis) + part * np.take(array, whole, axis=axis)
    return np.asarray(np.diff(at_edges, axis=axis) * (n / size))
