"""Scores of boundaries: ODS, OIS, AP and R50 over any number of views.

Conventions of the BSDS benchmark as in Dollar and Zitnick 2015: one truth per picture, counts at each
threshold summed over all pictures, F interpolated between thresholds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64, Mask
from pbrs_farm.study.metrics.edge_thinning import suppress_non_maxima, thin_edges

N_THRESHOLDS: Final = 33  # a third of the benchmark's EXACT_THRESHOLDS
EXACT_THRESHOLDS: Final = 99
MAX_DISTANCE: Final = (
    0.011  # maximum distance of a match, of the diagonal, for NYUv2 (0.0075 for BSDS)
)
_STEPS: Final = 100  # number of interpolated points between two thresholds


def n_matched(predicted: Mask, truth: Mask, max_distance_px: float) -> int:
    """Size of a maximum matching of edge pixels within a distance.

    The benchmark's min-cost assignment (Martin et al. 2004) gives an unpaired pixel a hundred
    times the cost of the farthest pair, so it matches as many pixels as possible too. Precision and
    recall need only their number.
    """
    ours, theirs = (np.argwhere(edges).astype(np.float64) for edges in (predicted, truth))
    if not len(ours) or not len(theirs):
        return 0
    near: list[list[int]] = list(
        cKDTree(ours).query_ball_point(theirs, max_distance_px + 1e-9, return_sorted=False)  # type: ignore[arg-type]
    )
    degrees = np.array([len(row) for row in near], np.intp)
    if not degrees.any():
        return 0
    pairs = np.concatenate([np.asarray(row, np.intp) for row in near if row])
    # The maximum flow from a source through the pixels of the truth and of the prediction to a sink
    # is the maximum matching. Dinic's algorithm takes 0.05 s; scipy's matching of 8,000 pixels with
    # 8,400 took minutes.
    of_theirs = np.arange(1, len(theirs) + 1)
    of_ours = np.arange(len(theirs) + 1, len(theirs) + 1 + len(ours))
    sink = len(theirs) + len(ours) + 1
    starts = np.concatenate([np.zeros_like(of_theirs), np.repeat(of_theirs, degrees), of_ours])
    ends = np.concatenate([of_theirs, of_ours[pairs], np.full_like(of_ours, sink)])
    units = np.ones(len(starts), np.int32)
    graph = csr_array((units, (starts, ends)), shape=(sink + 1, sink + 1))
    return int(maximum_flow(graph, 0, sink, method="dinic").flow_value)


@dataclass(frozen=True, slots=True)
class EdgeScore:
    """Figures of boundaries, shares 0..1."""

    ods: float = math.nan  # best F with one threshold for all pictures
    ois: float = math.nan  # F with each picture's own best threshold
    ap: float = math.nan
    r50: float = math.nan  # recall at half precision
    n_views: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class EdgeCounts:
    """Pixels of one picture at each threshold, (n,) int64."""

    matched: NDArray[np.int64]
    predicted: NDArray[np.int64]
    n_truth: int

    def f(self) -> F64:
        """(n,) F at each threshold."""
        return _f(*_precision_recall(self.matched, self.predicted, self.n_truth))


def edge_counts(
    strength: NDArray[Any],
    truth: Mask,
    n_thresholds: int = N_THRESHOLDS,
    max_distance: float = MAX_DISTANCE,
) -> EdgeCounts:
    """Counts of one picture: strength (H, W) 0..1 of the network, truth (H, W) lines.

    Maxima of strength are cut at n_thresholds equal steps inside 0..1 and thinned; max_distance is
    a share of the picture's diagonal.
    """
    maxima = suppress_non_maxima(strength)
    reach_px = max_distance * float(np.hypot(*truth.shape))
    matched, predicted = np.zeros((2, n_thresholds), np.int64)
    before: Mask | None = None
    for k, threshold in enumerate(_thresholds(n_thresholds)):
        cut = maxima >= threshold
        # Repeat the counts if this threshold removes no pixel.
        if before is not None and np.array_equal(cut, before):
            matched[k], predicted[k] = matched[k - 1], predicted[k - 1]
            continue
        before, lines = cut, thin_edges(cut)
        matched[k], predicted[k] = n_matched(lines, truth, reach_px), lines.sum()
    return EdgeCounts(matched, predicted, int(truth.sum()))


class EdgeScores:
    """Accumulated counts of pictures."""

    def __init__(self) -> None:
        self._views: list[EdgeCounts] = []

    def add(self, counts: EdgeCounts) -> float:
        """Add the counts of a picture; its best F."""
        self._views.append(counts)
        return float(counts.f().max())

    def score(self) -> EdgeScore:
        """Figures over all pictures so far (Arbelaez et al. 2011); NaN without one."""
        if not self._views:
            return EdgeScore()
        matched = np.sum([v.matched for v in self._views], axis=0)
        predicted = np.sum([v.predicted for v in self._views], axis=0)
        n_truth = sum(v.n_truth for v in self._views)
        precision, recall = _precision_recall(matched, predicted, n_truth)
        return EdgeScore(
            ods=_best_f(precision, recall),
            ois=self._ois(n_truth),
            ap=_average_precision(precision, recall),
            r50=_recall_at_half(precision, recall),
            n_views=len(self._views),
        )

    def _ois(self, n_truth: int) -> float:
        """Sum the counts at each picture's own best threshold, then take F."""
        best = [int(view.f().argmax()) for view in self._views]
        matched = sum(int(v.matched[k]) for v, k in zip(self._views, best, strict=True))
        predicted = sum(int(v.predicted[k]) for v, k in zip(self._views, best, strict=True))
        pair = _precision_recall(np.array([matched]), np.array([predicted]), n_truth)
        return float(_f(*pair)[0])


def _thresholds(n: int) -> F64:
    return np.linspace(1 / (n + 1), 1 - 1 / (n + 1), n)


def _precision_recall(
    matched: NDArray[np.int64], predicted: NDArray[np.int64], n_truth: int
) -> tuple[F64, F64]:
    return matched / np.maximum(predicted, 1), matched / max(n_truth, 1)


def _f(precision: F64, recall: F64) -> F64:
    return 2 * precision * recall / np.maximum(precision + recall, 1e-12)


def _best_f(precision: F64, recall: F64) -> float:
    """The best F, interpolated linearly between thresholds."""
    if len(precision) == 1:
        return float(_f(precision, recall)[0])
    share = np.linspace(0, 1, _STEPS)[:, None]
    ps, rs = (share * x[1:] + (1 - share) * x[:-1] for x in (precision, recall))
    return float(_f(ps, rs).max())


def _average_precision(precision: F64, recall: F64) -> float:
    """Sum of the precision at recalls 0, 0.01 .. 1 on the curve, divided by 100 as in the benchmark."""
    recalls, first = np.unique(recall, return_index=True)
    if len(recalls) < 2:
        return 0.0
    points = np.linspace(0, 1, 101)
    points = points[(points >= recalls[0]) & (points <= recalls[-1])]
    return float(np.interp(points, recalls, precision[first]).sum() / 100)


def _recall_at_half(precision: F64, recall: F64) -> float:
    """Recall at a precision of one half, or at the least precision if higher."""
    precisions, first = np.unique(precision, return_index=True)
    return float(np.interp(max(float(precisions[0]), 0.5), precisions, recall[first]))
