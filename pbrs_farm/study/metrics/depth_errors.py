"""Errors of depth over any number of views."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Mask

_RATIO = 1.25  # threshold of delta 1


@dataclass(frozen=True, slots=True)
class DepthScore:
    """Figures of depth: shares 0..1, and metres."""

    scale_invariant: float = (
        math.nan
    )  # mean over views of the standard deviation of ln(predicted / true)
    abs_rel: float = math.nan  # mean over pixels of |predicted - true| / true
    below_1_25: float = (
        math.nan
    )  # of pixels whose ratio to the truth, or its inverse, is below 1.25
    rms_m: float = math.nan  # root of the mean square over pixels
    n_pixels: int = 0


class DepthErrors:
    """Accumulated errors of views (Eigen et al. 2014, section 4)."""

    def __init__(self) -> None:
        self._spreads: list[float] = []
        self._n = self._n_near = 0
        self._relative = self._squares = 0.0

    def add(self, predicted: NDArray[Any], truth: NDArray[Any], valid: Mask) -> float:
        """Add the valid pixels (H, W), metres; the view's standard deviation of ln(predicted
        true), or NaN.
        """
        p, t = (np.asarray(depth[valid], np.float64) for depth in (predicted, truth))
        if not p.size:
            return float("nan")
        ratio = np.log(np.maximum(p, 1e-6)) - np.log(t)
        self._n += p.size
        self._n_near += int((np.abs(ratio) < np.log(_RATIO)).sum())
        self._relative += float((np.abs(p - t) / t).sum())
        self._squares += float(((p - t) ** 2).sum())
        self._spreads.append(float(ratio.std()))
        return self._spreads[-1]

    def score(self) -> DepthScore:
        """Figures over pixels so far, the scale-invariant one a mean over views; NaN without a pixel."""
        if not self._n:
            return DepthScore()
        return DepthScore(
            scale_invariant=float(np.mean(self._spreads)),
            abs_rel=self._relative / self._n,
            below_1_25=self._n_near / self._n,
            rms_m=float(np.sqrt(self._squares / self._n)),
            n_pixels=self._n,
        )
