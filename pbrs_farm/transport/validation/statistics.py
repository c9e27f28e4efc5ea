"""z-tests whether two noisy images have one mean, over blocks of pixels; pure numpy, no effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.frames import LUMINANCE


def blocks(picture: F32, n: int = 4) -> F64:
    """(n, n) mean luminance of a radiance image (H, W, 3), H and W multiples of n."""
    luminance = picture @ LUMINANCE
    h, w = luminance.shape
    means = luminance.reshape(n, h // n, n, w // n).mean((1, 3))
    return np.asarray(means, np.float64)


def z_scores(a: Sequence[F64], b: Sequence[F64]) -> F64:
    """z of the difference of two means, one per block; a, b: independent runs of one shape.

    The variance is pooled over all blocks, each brought to relative terms first.
    """
    # Divide each block by its mean over both, so that bright blocks do not dominate.
    x, y = np.array(a), np.array(b)
    scale = 0.5 * (x.mean(0) + y.mean(0))
    x, y = x / scale, y / scale
    # Divide the difference by its standard error.
    error = np.sqrt(x.var(0, ddof=1).mean() / len(x) + y.var(0, ddof=1).mean() / len(y))
    return np.asarray((x.mean(0) - y.mean(0)) / error)
