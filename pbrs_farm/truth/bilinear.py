"""Pictures looked up between the four nearest texels, repeating; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I64


def bilinear(pixels: NDArray[np.uint8], uv: F32, value_of_byte: F32 | None = None) -> F32:
    """(N, C) values of pixels (H, W, C) at uv (N, 2), v up and row 0 at the top.

    value_of_byte: (256,) what the bytes stand for; None = themselves.
    """
    # Place texel centres at half integers; v points up, rows count down.
    height, width = pixels.shape[:2]
    finite = np.where(np.isfinite(uv), uv, 0).astype(np.float64)
    x = finite[:, 0] * width - 0.5
    y = (1 - finite[:, 1]) * height - 0.5
    # Find the four texels around each point and how far it lies between them.
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0).astype(np.float32)[:, None], (y - y0).astype(np.float32)[:, None]
    left, right = (x0 % width).astype(np.int64), ((x0 + 1) % width).astype(np.int64)
    top, bottom = (y0 % height).astype(np.int64), ((y0 + 1) % height).astype(np.int64)

    def at(rows: I64, columns: I64) -> F32:
        found = pixels[rows, columns]
        return found.astype(np.float32) if value_of_byte is None else value_of_byte[found]

    # Blend along rows first.
    upper = at(top, left) * (1 - fx) + at(top, right) * fx
    lower = at(bottom, left) * (1 - fx) + at(bottom, right) * fx
    return np.asarray(upper * (1 - fy) + lower * fy, np.float32)
