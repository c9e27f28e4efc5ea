"""Edge maps to lines one pixel wide: maxima across each edge, then thinning."""

from __future__ import annotations

from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F32, F64, Mask

_SMOOTHING_PX: Final = 1.7  # standard deviation of the smoothing for orientations
_TIE: Final = 1.01  # factor by which a neighbour may exceed a maximum, for flat ridges
_DIM_BORDER_PX: Final = 5  # width of the fading border, where convolutions invent edges

# Offsets (row, column) of the eight neighbours, counter-clockwise from the right.
_AROUND: Final = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))


def suppress_non_maxima(strength: NDArray[Any], dim_border_px: int = _DIM_BORDER_PX) -> F32:
    """(H, W) float32 strength at its maxima across the largest curvature of the smoothed map, else 0."""
    strength = np.asarray(strength, np.float64)
    along_row, along_column = _across(strength)
    # Compare each pixel with both neighbours across its edge.
    rows, columns = np.indices(strength.shape, np.float64)
    is_top = np.ones(strength.shape, bool)
    for sign in (-1, 1):
        neighbours = [rows + sign * along_row, columns + sign * along_column]
        beside = ndimage.map_coordinates(strength, neighbours, order=1, mode="nearest")
        is_top &= strength * _TIE >= beside
    return np.asarray(
        np.where(is_top, strength * _fading(strength.shape, dim_border_px), 0), np.float32
    )


def _across(strength: F64) -> tuple[F64, F64]:
    """Rows and columns of the unit vectors across each pixel's edge."""
    rr, cc, rc = (
        ndimage.gaussian_filter(strength, _SMOOTHING_PX, order=order, mode="nearest")
        for order in ((2, 0), (0, 2), (1, 1))
    )
    # Eigenvector of the eigenvalue of largest magnitude: the curvature across is negative on an edge
    # and positive beside it.
    sign = np.where(rr + cc > 0, 1.0, -1.0)
    angle = 0.5 * np.arctan2(sign * 2 * rc, sign * (rr - cc))
    return np.asarray(np.cos(angle)), np.asarray(np.sin(angle))


def _fading(shape: tuple[int, ...], border_px: int) -> F64:
    """(H, W) factors that decrease to 0 over border_px at each side."""
    if border_px <= 0:
        return np.ones(shape)
    ramps = []
    for n in shape:
        away = np.minimum(np.arange(n), np.arange(n)[::-1])
        ramps.append(np.minimum(away / border_px, 1.0))
    return np.asarray(np.minimum(ramps[0][:, None], ramps[1]))


def thin_edges(edges: Mask) -> Mask:
    """(H, W) bool lines, one pixel wide, of the same length (Guo and Hall 1989; Lam, Lee and Suen 1992)."""
    width = edges.shape[1] + 2
    flat = np.pad(edges, 1).ravel()
    around = np.array([r * width + c for r, c in _AROUND])
    first, second = _removable()
    pixels = np.flatnonzero(flat)
    while True:
        n_before = pixels.size
        for removable in (first, second):
            # The eight neighbours of each pixel as one byte.
            codes = (flat[pixels[:, None] + around] << np.arange(8)).sum(1)
            is_removed = removable[codes]
            flat[pixels[is_removed]] = False
            pixels = pixels[~is_removed]
        if pixels.size == n_before:
            return flat.reshape(-1, width)[1:-1, 1:-1]


@cache
def _removable() -> tuple[Mask, Mask]:
    """(256,) for neighbourhoods (bit k = neighbour k): removable in pass 1, and in pass 2."""
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1 > 0
    n = [bits[:, k] for k in range(8)]  # right, then counter-clockwise
    # A centre beside two runs of neighbours connects them.
    crossings = sum((~n[k] & (n[k + 1] | n[(k + 2) % 8])).astype(int) for k in (0, 2, 4, 6))
    # Exclude ends of lines and the inside of patches.
    pairs_1 = sum((n[k] | n[(k + 1) % 8]).astype(int) for k in (0, 2, 4, 6))
    pairs_2 = sum((n[k] | n[k - 1]).astype(int) for k in (0, 2, 4, 6))
    fewest = np.minimum(pairs_1, pairs_2)
    is_removable = (crossings == 1) & (fewest >= 2) & (fewest <= 3)
    # Sides of the two passes.
    east = ~((n[1] | n[2] | ~n[7]) & n[0])
    west = ~((n[5] | n[6] | ~n[3]) & n[4])
    return is_removable & east, is_removable & west
