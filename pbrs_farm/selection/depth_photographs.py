"""What photographs of depth cameras need before they are counted; arrays only, no effects."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Srgb8Image

# A pixel of the registration border has all channels at least WHITE, or at most BLACK.
WHITE: Final = 245
BLACK: Final = 10

_BORDER_SHARE: Final = 0.97  # of a row or column that is border
_MAX_BORDER: Final = 1 / 8  # of the picture, at each side


def sun_rgbd_depth(stored: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Depth in mm from SUN RGB-D's files, whose 16 bits are rotated left by 3 (its toolbox)."""
    return (stored >> np.uint16(3)) | (stored << np.uint16(13))


def depth_mm_from_units(depth: NDArray[Any], units_per_m: float) -> NDArray[np.uint16]:
    """(H, W) uint16 mm, 0 = unknown, of depth in units_per_m; 65.535 m and beyond is 65535.

    Zero and below is unknown. Raises ValueError for NaN and infinity.
    """
    if np.issubdtype(depth.dtype, np.floating) and not np.isfinite(depth).all():
        raise ValueError(f"{int((~np.isfinite(depth)).sum())} pixels of depth are not finite")
    mm = np.rint(np.asarray(depth, np.float64) * (1000.0 / units_per_m))
    return np.clip(mm, 0, 65535).astype(np.uint16)


def registration_border(rgb_srgb8: Srgb8Image) -> tuple[slice, slice]:
    """Rows and columns that are left when the border is peeled off a registered photograph.

    Warping colour onto the depth camera leaves edges that are white (NYUv2) or black. A row or
    column goes while 97 % of it is such; at most an eighth of the picture at each side.
    """
    # Mark the pixels that may be border.
    light, dark = (rgb_srgb8 >= WHITE).all(axis=2), (rgb_srgb8 <= BLACK).all(axis=2)
    plain = np.asarray(light | dark)
    height, width = plain.shape
    top, bottom, left, right = 0, height, 0, width  # what is left, half-open
    most_rows, most_columns = int(height * _MAX_BORDER), int(width * _MAX_BORDER)
    # Peel one row or column a side and turn until nothing changes.
    changed = True
    while changed:
        before = (top, bottom, left, right)
        if top < most_rows and plain[top, left:right].mean() >= _BORDER_SHARE:
            top += 1
        if height - bottom < most_rows and plain[bottom - 1, left:right].mean() >= _BORDER_SHARE:
            bottom -= 1
        if left < most_columns and plain[top:bottom, left].mean() >= _BORDER_SHARE:
            left += 1
        if width - right < most_columns and plain[top:bottom, right - 1].mean() >= _BORDER_SHARE:
            right -= 1
        changed = (top, bottom, left, right) != before
    return slice(top, bottom), slice(left, right)
