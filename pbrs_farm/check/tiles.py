"""Means over tiles of a picture, in which noise averages out; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64

TILE_PX = 16


def tile_means(picture: NDArray[Any]) -> F64:
    """(R, C, K) means of the whole tiles of (H, W, K); a smaller picture has one tile across or down."""
    rows, columns = (min(TILE_PX, n) for n in picture.shape[:2])
    n_rows, n_columns = picture.shape[0] // rows, picture.shape[1] // columns
    cut = picture[: n_rows * rows, : n_columns * columns].astype(float)
    return np.asarray(cut.reshape(n_rows, rows, n_columns, columns, -1).mean(axis=(1, 3)))


def halved(picture: NDArray[Any]) -> F32:
    """(H / 2, W / 2, 3) means of 2 x 2 pixels; an odd row or column is left out."""
    height, width = (n // 2 * 2 for n in picture.shape[:2])
    parts = picture[:height, :width].astype(np.float32).reshape(height // 2, 2, width // 2, 2, 3)
    return np.ascontiguousarray(parts.mean(axis=(1, 3)))
