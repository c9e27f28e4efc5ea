"""Edge maps to lines one pixel wide: maxima across each edge, then thinning; no effects."""

from __future__ import annotations

from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F32, F64, Mask

_SMOOTHING_PX: Final = 1.7  # sd that orientations are read at
_TIE: Final = 1.01  # a pixel may lie this much below its neighbour: flat ridges keep their top
_DIM_BORDER_PX: Final = 5  # edges this near to the border fade: convolutions invent them there

# Offsets (row, column) of the eight neighbours, counter-clockwise from the right.
_AROUND: Final = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))


def suppress_non_maxima(strength: NDArray[Any], dim_border_px: int = _DIM_BORDER_PX) -> F32:
    """(H, W) float32: strength where it is a maximum across its edge, else 0.

    strength: (H, W), 0..1. Across is the direction in which the smoothed map bends most, an
    eigenvector of its Hessian; neighbours at one pixel are interpolated.
    """
    strength = np.asarray(strength, np.float64)
    along_row, along_column = _across(strength)
    # Compare each pixel with both neighbours across its edge.
    rows, columns = np.indices(strength.shape, np.float64)
    is_top = np.ones(strength.shape, bool)
    for sign in (-1, 1):
        at = [rows + sign * along_row, columns + sign * along_column]
        beside = ndimage.map_coordinates(strength, at, order=1, mode="nearest")
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
    # Turn to the eigenvector of the eigenvalue that is farthest from 0: on an edge the map bends
    # down across it, beside an edge it bends up.
    sign = np.where(rr + cc > 0, 1.0, -1.0)
    angle = 0.5 * np.arctan2(sign * 2 * rc, sign * (rr - cc))
    return np.asarray(np.cos(angle)), np.asarray(np.sin(angle))


def _fading(shape: tuple[int, ...], border_px: int) -> F64:
    """(H, W) factors that fall to 0 over border_px at each side."""
    if border_px <= 0:
        return np.ones(shape)
    ramps = []
    for n in shape:
        away = np.minimum(np.arange(n), np.arange(n)[::-1])
        ramps.append(np.minimum(away / border_px, 1.0))
    return np.asarray(np.minimum(ramps[0][:, None], ramps[1]))


def thin_edges(edges: Mask) -> Mask:
    """(H, W) bool: edges peeled to lines one pixel wide, connected as before; lines keep their length.

    Two passes in turn take pixels off opposite sides until none can go (Guo and Hall 1989; Lam,
    Lee and Suen 1992, page 879).
    """
    width = edges.shape[1] + 2
    flat = np.pad(edges, 1).ravel()
    around = np.array([r * width + c for r, c in _AROUND])
    first, second = _removable()
    left = np.flatnonzero(flat)
    while True:
        n_before = left.size
        for removable in (first, second):
            # Look at the eight neighbours of the pixels that are left, as one byte.
            codes = (flat[left[:, None] + around] << np.arange(8)).sum(1)
            goes = removable[codes]
            flat[left[goes]] = False
            left = left[~goes]
        if left.size == n_before:
            return flat.reshape(-1, width)[1:-1, 1:-1]


@cache
def _removable() -> tuple[Mask, Mask]:
    """For each of 256 neighbourhoods (bit k = neighbour k): may its centre go in pass 1, in pass 2."""
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1 > 0
    n = [bits[:, k] for k in range(8)]  # right, then counter-clockwise
    # The centre must border on exactly one run of neighbours, or it joins two.
    crossings = sum((~n[k] & (n[k + 1] | n[(k + 2) % 8])).astype(int) for k in (0, 2, 4, 6))
    # It must be neither the end of a line nor the inside of a patch.
    pairs_1 = sum((n[k] | n[(k + 1) % 8]).astype(int) for k in (0, 2, 4, 6))
    pairs_2 = sum((n[k] | n[k - 1]).astype(int) for k in (0, 2, 4, 6))
    fewest = np.minimum(pairs_1, pairs_2)
    may_go = (crossings == 1) & (fewest >= 2) & (fewest <= 3)
    # It must lie on the side that the pass takes from.
    east = ~((n[1] | n[2] | ~n[7]) & n[0])
    west = ~((n[5] | n[6] | ~n[3]) & n[4])
    return may_go & east, may_go & west
