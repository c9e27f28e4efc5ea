"""The error of surface normals in degrees, pooled over the pixels of any number of views; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Mask

THRESHOLDS_DEG: Final = (11.25, 22.5, 30.0, 5.0, 7.5)  # of the shares that papers report
_BIN_DEG: Final = 0.01  # of the histogram that medians are read from
_N_BINS: Final = round(180 / _BIN_DEG) + 1


def angles_deg(predicted: NDArray[Any], truth: NDArray[Any]) -> F64:
    """(...) degrees 0..180 between the vectors of two arrays (..., 3), of any length.

    A vector of no length stands at 90 degrees to everything. Raises ValueError for NaN.
    """
    a, b = np.asarray(predicted, np.float64), np.asarray(truth, np.float64)
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError("a normal is not finite")
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    cosine = (a * b).sum(-1) / np.where(lengths > 0, lengths, 1.0)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))), np.float64)


@dataclass(frozen=True, slots=True)
class NormalScore:
    """What the field reports of normals: degrees, and shares 0..1 of pixels below a threshold."""

    mean_deg: float
    median_deg: float  # of pixels, not of views
    below_11_25: float
    below_22_5: float
    below_30: float
    below_5: float
    below_7_5: float
    rms_deg: float
    n_pixels: int


class AngularErrors:
    """Errors of views that come one by one: sums, counts and a histogram, no pixels."""

    def __init__(self) -> None:
        self._histogram = np.zeros(_N_BINS, np.int64)
        self._below = np.zeros(len(THRESHOLDS_DEG), np.int64)
        self._sum = 0.0
        self._sum_of_squares = 0.0

    def add(self, predicted: NDArray[Any], truth: NDArray[Any], valid: Mask) -> float:
        """Count the pixels (H, W) where valid; the view's own mean in degrees, NaN without any.

        predicted and truth are (H, W, 3) unit vectors in one frame, valid (H, W) bool. Pixels
        count, not views: a view with more valid pixels weighs more.
        """
        errors = angles_deg(predicted[valid], truth[valid])
        self._histogram += np.bincount(
            np.rint(errors / _BIN_DEG).astype(np.intp), minlength=_N_BINS
        )
        self._below += [int((errors < threshold).sum()) for threshold in THRESHOLDS_DEG]
        self._sum += float(errors.sum())
        self._sum_of_squares += float((errors**2).sum())
        return float(errors.mean()) if errors.size else float("nan")

    def score(self) -> NormalScore:
        """Over all pixels so far; the median to 0.005 degrees. All NaN without a pixel.

        Mean, median and RMS in degrees, and shares below the thresholds of the literature (11.25,
        22.5 and 30 degrees among them; Fouhey et al. 2013).
        """
        n = int(self._histogram.sum())
        if n == 0:
            nan = float("nan")
            return NormalScore(nan, nan, nan, nan, nan, nan, nan, nan, 0)
        # Read the two middle pixels off the histogram: they are one where n is odd.
        seen = np.cumsum(self._histogram)
        middle = np.searchsorted(seen, [(n - 1) // 2, n // 2], side="right")
        below_11_25, below_22_5, below_30, below_5, below_7_5 = (
            float(count / n) for count in self._below
        )
        median_deg = float(middle.mean() * _BIN_DEG)
        rms_deg = float(np.sqrt(self._sum_of_squares / n))
        return NormalScore(
            self._sum / n,
            median_deg,
            below_11_25,
            below_22_5,
            below_30,
            below_5,
            below_7_5,
            rms_deg,
            n,
        )
