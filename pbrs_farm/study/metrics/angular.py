"""Angular error of surface normals in degrees, over the pixels of any number of views."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Mask

THRESHOLDS_DEG: Final = (11.25, 22.5, 30.0, 5.0, 7.5)  # degrees, for shares of pixels
_BIN_DEG: Final = 0.01  # bin width of the histogram for medians
_N_BINS: Final = round(180 / _BIN_DEG) + 1


def angles_deg(predicted: NDArray[Any], truth: NDArray[Any]) -> F64:
    """(...) degrees 0..180 between vectors (..., 3) of any length, 90 with a zero vector; ValueError for NaN."""
    a, b = np.asarray(predicted, np.float64), np.asarray(truth, np.float64)
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError("a normal is not finite")
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    cosine = (a * b).sum(-1) / np.where(lengths > 0, lengths, 1.0)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))), np.float64)


@dataclass(frozen=True, slots=True)
class NormalScore:
    """Figures of normals: degrees, and shares 0..1 of pixels below a threshold."""

    mean_deg: float = math.nan
    median_deg: float = math.nan  # over pixels, not views
    below_11_25: float = math.nan
    below_22_5: float = math.nan
    below_30: float = math.nan
    below_5: float = math.nan
    below_7_5: float = math.nan
    rms_deg: float = math.nan
    n_pixels: int = 0


class AngularErrors:
    """Accumulated errors of views: sums, counts and a histogram."""

    def __init__(self) -> None:
        self._histogram = np.zeros(_N_BINS, np.int64)
        self._below = np.zeros(len(THRESHOLDS_DEG), np.int64)
        self._sum = 0.0
        self._sum_of_squares = 0.0

    def add(self, predicted: NDArray[Any], truth: NDArray[Any], valid: Mask) -> float:
        """Add the valid pixels (H, W) of unit vectors (H, W, 3); the view's mean error in degrees, or NaN."""
        errors = angles_deg(predicted[valid], truth[valid])
        self._histogram += np.bincount(
            np.rint(errors / _BIN_DEG).astype(np.intp), minlength=_N_BINS
        )
        self._below += [int((errors < threshold).sum()) for threshold in THRESHOLDS_DEG]
        self._sum += float(errors.sum())
        self._sum_of_squares += float((errors**2).sum())
        return float(errors.mean()) if errors.size else float("nan")

    def score(self) -> NormalScore:
        """Figures over all pixels so far, the median to 0.005 degrees; NaN without a pixel."""
        n = int(self._histogram.sum())
        if n == 0:
            return NormalScore()
        # The bins of the two middle pixels, which are one if n is odd.
        middle = np.searchsorted(np.cumsum(self._histogram), [(n - 1) // 2, n // 2], side="right")
        median_deg = float(middle.mean() * _BIN_DEG)
        b = (self._below / n).tolist()
        rms_deg = float(np.sqrt(self._sum_of_squares / n))
        return NormalScore(self._sum / n, median_deg, b[0], b[1], b[2], b[3], b[4], rms_deg, n)
