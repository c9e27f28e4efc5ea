"""Boundaries against the truth: ODS, OIS, AP and R50 over any number of views; no effects.

Conventions of the BSDS benchmark as Dollar and Zitnick 2015 use it: one truth a picture, counts at
each threshold summed over all pictures, F interpolated between thresholds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_flow
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F32, F64, Mask

# How many edge pixels of two maps can be paired one to one within a distance.


def n_matched(predicted: Mask, truth: Mask, max_distance_px: float) -> int:
    """The most pairs of edge pixels, one of each map, no pixel twice, none farther apart than that.

    The benchmark's min-cost assignment (Martin et al. 2004) gives an unpaired pixel a hundred
    times the cost of the farthest pair: it pairs as many pixels as possible. Their number is what
    precision and recall need, and a maximum matching has the same.
    """
    ours, theirs = _pixels(predicted), _pixels(truth)
    if not len(ours) or not len(theirs):
        return 0
    # Join every two pixels that are near enough.
    near: list[list[int]] = list(
        cKDTree(ours).query_ball_point(theirs, max_distance_px + 1e-9, return_sorted=False)  # type: ignore[arg-type]
    )
    degrees = np.array([len(row) for row in near], np.intp)
    if not degrees.any():
        return 0
    pairs = np.concatenate([np.asarray(row, np.intp) for row in near if row])
    # Let one unit flow from a source through each of theirs, a pair, one of ours, to a sink: the
    # largest flow is the largest matching. Dinic's algorithm takes 0.05 s where scipy's own
    # matching of 8,000 pixels to 8,400 ran for minutes.
    of_theirs = np.arange(1, len(theirs) + 1)
    of_ours = np.arange(len(theirs) + 1, len(theirs) + 1 + len(ours))
    sink = len(theirs) + len(ours) + 1
    starts = np.concatenate([np.zeros_like(of_theirs), np.repeat(of_theirs, degrees), of_ours])
    ends = np.concatenate([of_theirs, of_ours[pairs], np.full_like(of_ours, sink)])
    units = np.ones(len(starts), np.int32)
    graph = csr_array((units, (starts, ends)), shape=(sink + 1, sink + 1))
    return int(maximum_flow(graph, 0, sink, method="dinic").flow_value)


def _pixels(edges: Mask) -> NDArray[np.float64]:
    return np.argwhere(edges).astype(np.float64)


# Edge maps to lines one pixel wide: maxima across each edge, then thinning.


_SMOOTHING_PX: Final = 1.7  # sd that orientations are read at
_TIE: Final = 1.01  # a pixel may lie this much below its neighbour: flat ridges keep their top
_DIM_BORDER_PX: Final = 5  # edges this near to the border fade: convolutions invent them there

# Offsets (row, column) of the eight neighbours, counter-clockwise from the right.
_AROUND: Final = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))


def non_maxima_suppressed(strength: NDArray[Any], dim_border_px: int = _DIM_BORDER_PX) -> F32:
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


def thinned(edges: Mask) -> Mask:
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


# Boundaries against the truth.


N_THRESHOLDS: Final = 33  # a third of the benchmark's, which is EXACT_THRESHOLDS
EXACT_THRESHOLDS: Final = 99
MAX_DISTANCE: Final = 0.011  # of the diagonal, on NYUv2 (0.0075 on BSDS)
_STEPS: Final = 100  # between two thresholds, where the best F is looked for


@dataclass(frozen=True, slots=True)
class EdgeScore:
    """What the field reports of boundaries, as shares 0..1."""

    ods: float  # best F at one threshold for all pictures
    ois: float  # F with each picture's own best threshold
    ap: float
    r50: float  # recall at half precision
    n_views: int


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
    strength: NDArray[Any], truth: Mask, n_thresholds: int = N_THRESHOLDS,
    max_distance: float = MAX_DISTANCE,
) -> EdgeCounts:  # fmt: skip
    """Counts of one picture: strength (H, W) 0..1 as the network gives it, truth (H, W) lines.

    Maxima of strength are cut at n_thresholds equal steps inside 0..1 and thinned; max_distance is
    a share of the picture's diagonal.
    """
    maxima = non_maxima_suppressed(strength)
    reach_px = max_distance * float(np.hypot(*truth.shape))
    matched, predicted = np.zeros((2, n_thresholds), np.int64)
    before: Mask | None = None
    for k, threshold in enumerate(_thresholds(n_thresholds)):
        cut = maxima >= threshold
        # Keep the counts where no pixel fell below this threshold.
        if before is not None and np.array_equal(cut, before):
            matched[k], predicted[k] = matched[k - 1], predicted[k - 1]
            continue
        before, lines = cut, thinned(cut)
        matched[k], predicted[k] = n_matched(lines, truth, reach_px), lines.sum()
    return EdgeCounts(matched, predicted, int(truth.sum()))


class EdgeScores:
    """Counts of pictures that come one by one."""

    def __init__(self) -> None:
        self._views: list[EdgeCounts] = []

    def add(self, counts: EdgeCounts) -> float:
        """Take a picture; its own best F."""
        self._views.append(counts)
        return float(counts.f().max())

    def score(self) -> EdgeScore:
        """Over all pictures so far; all NaN without one."""
        if not self._views:
            nan = float("nan")
            return EdgeScore(nan, nan, nan, nan, n_views=0)
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
    """The best F on straight lines between neighbouring thresholds."""
    if len(precision) == 1:
        return float(_f(precision, recall)[0])
    share = np.linspace(0, 1, _STEPS)[:, None]
    ps, rs = (share * x[1:] + (1 - share) * x[:-1] for x in (precision, recall))
    return float(_f(ps, rs).max())


def _average_precision(precision: F64, recall: F64) -> float:
    """Precision at recalls 0, 0.01 .. 1 where the curve reaches, summed and divided by 100.

    101 points are divided by 100, as every table has it.
    """
    recalls, first = np.unique(recall, return_index=True)
    if len(recalls) < 2:
        return 0.0
    at = np.linspace(0, 1, 101)
    inside = (at >= recalls[0]) & (at <= recalls[-1])
    return float(np.interp(at[inside], recalls, precision[first]).sum() / 100)


def _recall_at_half(precision: F64, recall: F64) -> float:
    """Recall where precision is a half, or at the least precision where it is always above."""
    precisions, first = np.unique(precision, return_index=True)
    return float(np.interp(max(float(precisions[0]), 0.5), precisions, recall[first]))
