"""Thinning, matching and the scores of boundaries against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

from pbrs_farm.study.metrics.edge_scores import EdgeCounts, EdgeScores, edge_counts, n_matched
from pbrs_farm.study.metrics.edge_thinning import suppress_non_maxima, thin_edges


def _assigned(predicted: np.ndarray, truth: np.ndarray, reach_px: float) -> int:
    """Pairs of the min-cost assignment in which an unpaired pixel costs 100 times the reach."""
    ours, theirs = np.argwhere(predicted), np.argwhere(truth)
    distance = np.linalg.norm(ours[:, None] - theirs[None], axis=-1)
    n, m = distance.shape
    cost = np.full((n + m, n + m), 100 * reach_px)
    cost[:n, :m] = np.where(distance <= reach_px, distance, 1e6)
    cost[n:, m:] = 0
    rows, columns = linear_sum_assignment(cost)
    return int(((rows < n) & (columns < m) & (cost[rows, columns] < 1e6)).sum())


@pytest.mark.parametrize("seed", range(8))
def test_matching_counts_as_many_as_the_min_cost_assignment(seed: int) -> None:
    rng = np.random.default_rng(seed)
    density, reach_px = rng.uniform(0.02, 0.2), rng.uniform(1.0, 4.5)
    predicted, truth = rng.random((2, 28, 36)) < density
    assert n_matched(predicted, truth, reach_px) == _assigned(predicted, truth, reach_px)


def test_a_shifted_line_matches_inside_the_distance_and_not_outside() -> None:
    truth, shifted = np.zeros((2, 20, 30), bool)
    truth[2:18, 10] = shifted[2:18, 13] = True
    assert n_matched(shifted, truth, 3.0) == 16
    assert n_matched(shifted, truth, 2.99) == 0


def test_of_a_doubled_line_half_matches() -> None:
    truth, doubled = np.zeros((2, 20, 30), bool)
    truth[2:18, 10] = doubled[2:18, [9, 11]] = True
    assert n_matched(doubled, truth, 2.0) == 16


def test_nothing_matches_an_empty_map() -> None:
    empty, full = np.zeros((5, 5), bool), np.ones((5, 5), bool)
    assert n_matched(empty, full, 9) == n_matched(full, empty, 9) == 0


def test_thinning_leaves_the_middle_line_of_a_bar() -> None:
    bar = np.zeros((15, 40), bool)
    bar[6:9, 5:35] = True
    line = thin_edges(bar)
    assert line.sum(0).max() == 1
    assert line[7].sum() >= 27


def test_thinning_twice_is_thinning_once_and_keeps_pieces() -> None:
    rng = np.random.default_rng(3)
    blobs = ndimage.gaussian_filter(rng.random((60, 80)), 2) > 0.51
    lines = thin_edges(blobs)
    eight = np.ones((3, 3))
    assert np.array_equal(thin_edges(lines), lines)
    assert not (lines & ~blobs).any()
    assert ndimage.label(lines, eight)[1] == ndimage.label(blobs, eight)[1]


@pytest.mark.parametrize("degrees", [0, 30, 45, 90, 120])
def test_maxima_of_a_soft_line_lie_on_the_line(degrees: float) -> None:
    rows, columns = np.indices((60, 60)) - 29.5
    angle = np.radians(degrees)
    away = rows * np.cos(angle) + columns * np.sin(angle)
    maxima = suppress_non_maxima(np.exp(-(away**2) / 8), dim_border_px=0) > 0.01
    inside = np.hypot(rows, columns) < 20
    assert np.abs(away[maxima & inside]).max() <= 0.75
    longest = 40 * max(abs(np.cos(angle)), abs(np.sin(angle)))  # pixels of a drawn line
    assert (maxima & inside).sum() >= longest - 2


def test_edges_fade_at_the_border_where_convolutions_invent_them() -> None:
    flat = np.full((40, 40), 0.8)
    maxima = suppress_non_maxima(flat)
    assert maxima[0].max() == 0
    assert maxima[20, 20] == pytest.approx(0.8)


def _counts(matched: list[int], predicted: list[int], n_truth: int) -> EdgeCounts:
    return EdgeCounts(np.array(matched), np.array(predicted), n_truth)


def test_a_prediction_equal_to_the_truth_scores_one() -> None:
    truth = np.zeros((60, 80), bool)
    truth[10:50, 40] = True
    truth[30, 8:72] = True
    scores = EdgeScores()
    scores.add(edge_counts(truth.astype(float), truth, 9))
    score = scores.score()
    assert score.ods > 0.95
    assert score.ois > 0.95


def test_scores_are_those_of_a_curve_by_hand() -> None:
    scores = EdgeScores()
    # Recall 0.8, 0.4; precision 0.4, 1.
    scores.add(_counts([80, 40], [200, 40], 100))
    score = scores.score()
    # On the line between the thresholds F is largest where it is counted.
    share = np.linspace(0, 1, 100)
    p, r = 0.4 + 0.6 * share, 0.8 - 0.4 * share
    assert score.ods == pytest.approx((2 * p * r / (p + r)).max())
    assert score.ois == pytest.approx(2 * 0.4 / 1.4)
    assert score.r50 == pytest.approx(0.8 - 0.4 * (0.1 / 0.6))
    # Forty-one points from recall 0.40 to 0.80, precision falls from 1 to 0.4 on a line.
    assert score.ap == pytest.approx(41 * 0.7 / 100)


def test_each_picture_has_a_separate_threshold_in_ois() -> None:
    scores = EdgeScores()
    scores.add(_counts([90, 50], [100, 50], 100))
    scores.add(_counts([90, 90], [300, 100], 100))
    assert scores.score().ois == pytest.approx(0.9)
    assert scores.score().ods < 0.9
