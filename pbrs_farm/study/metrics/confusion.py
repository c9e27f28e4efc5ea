"""Semantic segmentation from one confusion matrix over all pixels (Long et al. 2015)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class ClassScore:
    """Figures of segmentation, shares 0..1."""

    pixel_accuracy: float = math.nan
    mean_accuracy: float = math.nan  # over the classes in the truth
    mean_iou: float = math.nan  # over the classes in truth or prediction
    weighted_iou: float = math.nan  # classes weighted by their share of the truth
    n_pixels: int = 0


class Confusion:
    """Pixels by true class (row) and predicted class (column); class 0 of the truth is ignored."""

    def __init__(self, n_classes: int) -> None:
        """n_classes: ids 1..n_classes exist, in truth and in prediction."""
        self.counts = np.zeros((n_classes, n_classes), np.int64)

    def add(self, predicted: NDArray[Any], truth: NDArray[Any]) -> float:
        """Count a view's labelled pixels; its pixel accuracy, or NaN. ValueError for classes out of range."""
        n = len(self.counts)
        labelled = truth > 0
        rows, columns = (
            truth[labelled].astype(np.int64) - 1,
            predicted[labelled].astype(np.int64) - 1,
        )
        for kind, ids in (("label", rows), ("prediction", columns)):
            if ids.size and (ids.min() < 0 or ids.max() >= n):
                wrong = next(i for i in (int(ids.max()), int(ids.min())) if not 0 <= i < n)
                raise ValueError(f"the {kind} {wrong + 1} is not a class of 1 to {n}")
        self.counts += np.bincount(rows * n + columns, minlength=n * n).reshape(n, n)
        return float((rows == columns).mean()) if rows.size else float("nan")

    def iou(self) -> NDArray[np.float64]:
        """(n_classes,) intersection over union; NaN for classes in neither truth nor prediction."""
        hits = np.diag(self.counts)
        return _shares(hits, self.counts.sum(0) + self.counts.sum(1) - hits)

    def score(self) -> ClassScore:
        """Figures over all pixels so far, NaN without any; the mean IoU is over classes in truth or prediction."""
        n = int(self.counts.sum())
        if n == 0:
            return ClassScore()
        hits, truth, iou = np.diag(self.counts), self.counts.sum(1), self.iou()
        return ClassScore(
            pixel_accuracy=float(hits.sum() / n),
            mean_accuracy=float(np.nanmean(_shares(hits, truth))),
            mean_iou=float(np.nanmean(iou)),
            weighted_iou=float((truth / n * np.nan_to_num(iou)).sum()),
            n_pixels=n,
        )


def _shares(part: NDArray[np.int64], total: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.where(total > 0, part / np.maximum(total, 1), np.nan)
