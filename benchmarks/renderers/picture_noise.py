"""Measures of how far pictures lie apart, for the comparisons with other renderers; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.frames import LUMINANCE


def relative_square(
    picture: NDArray[np.float32], reference: NDArray[np.float32]
) -> NDArray[np.float64]:
    """(H, W) squared relative error of luminance."""
    y, t = (np.asarray(v, np.float64) @ LUMINANCE for v in (picture, reference))
    return np.asarray((y - t) ** 2 / (t**2 + 1e-3 * t.mean() ** 2))


def blocks(luminance: NDArray[np.float64]) -> NDArray[np.float64]:
    """(6, 8) means of 8x6 blocks of an (H, W) picture; what does not fit is cut off."""
    h, w = luminance.shape
    cut = luminance[: h // 6 * 6, : w // 8 * 8]
    return np.asarray(cut.reshape(6, h // 6, 8, w // 8).mean((1, 3)))
