"""How near what a set of views shows comes to what photographs of rooms show; no effects.

The measure is the L1 distance of the mean NYU13 pixel shares of the views to those published of
NYUv2's labelled frames (Silberman et al. 2012), unlabelled pixels left out of both.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU13_NAMES

NYUV2_SHARES: Final[Mapping[str, float]] = {
    "wall": 0.235, "furniture": 0.139, "objects": 0.121, "floor": 0.098, "window": 0.051,
    "bed": 0.041, "table": 0.035, "chair": 0.033, "sofa": 0.031, "picture": 0.022,
    "ceiling": 0.013, "books": 0.007,
}  # fmt: skip
"""Shares of pixels over NYUv2's 1,449 labelled frames, unlabelled pixels counted."""

_PHOTOGRAPHS: Final[F64] = np.array([NYUV2_SHARES.get(name, 0.0) for name in NYU13_NAMES])
# (14,) the same of the labelled pixels alone.
_OF_LABELLED: Final[F64] = _PHOTOGRAPHS / _PHOTOGRAPHS.sum()


def share_distance(shares: F64) -> F64:
    """(...) L1 distance, 0..2, of NYU13 shares (..., 14) to those of NYUv2's frames.

    shares: means or sums over views, any scale; column 0 is left out. What shows nothing that has
    a class is as far as can be.
    """
    labelled = shares[..., 1:]
    total = labelled.sum(-1, keepdims=True)
    part = labelled / np.where(total > 0, total, 1.0)
    return np.where(total[..., 0] > 0, np.abs(part - _OF_LABELLED[1:]).sum(-1), 2.0)
