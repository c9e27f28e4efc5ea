"""Angular errors against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrs_farm.study.metrics.angular import AngularErrors, angles_deg


def _unit(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _turned(normals: np.ndarray, degrees: float) -> np.ndarray:
    """Each normal turned by an angle about a random axis."""
    axis = np.cross(normals, _unit(normals.shape[:-1], 1))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = math.radians(degrees)
    return np.cos(angle) * normals + np.sin(angle) * axis


def test_normals_turned_by_thirty_degrees_err_by_thirty() -> None:
    truth, errors = _unit((20, 30)), AngularErrors()
    assert errors.add(_turned(truth, 30) * 7.5, truth, np.ones((20, 30), bool)) == pytest.approx(30)
    score = errors.score()
    assert score.mean_deg == pytest.approx(30, abs=1e-6)
    assert score.median_deg == pytest.approx(30, abs=0.006)
    assert (score.below_11_25, score.below_22_5) == (0, 0)


def test_shares_count_the_pixels_below_each_threshold() -> None:
    truth, errors = _unit((4, 10)), AngularErrors()
    rows = [_turned(truth[k], degrees) for k, degrees in enumerate((5, 15, 25, 90))]
    errors.add(np.stack(rows), truth, np.ones((4, 10), bool))
    score = errors.score()
    assert (score.below_11_25, score.below_22_5, score.below_30) == (0.25, 0.5, 0.75)
    assert score.mean_deg == pytest.approx((5 + 15 + 25 + 90) / 4)
    assert score.median_deg == pytest.approx(20, abs=0.006)


def test_pixels_without_truth_do_not_count() -> None:
    truth, valid, errors = _unit((2, 8)), np.zeros((2, 8), bool), AngularErrors()
    valid[0] = True
    predicted = np.concatenate([truth[:1], -truth[1:]])
    errors.add(predicted, truth, valid)
    assert errors.score().n_pixels == 8
    assert errors.score().mean_deg == pytest.approx(0, abs=1e-5)


def test_pooling_weighs_views_by_their_pixels() -> None:
    truth, errors = _unit((1, 12)), AngularErrors()
    valid = np.arange(12)[None] < 9
    errors.add(_turned(truth, 10), truth, valid)
    errors.add(_turned(truth, 50), truth, ~valid)
    assert errors.score().mean_deg == pytest.approx((9 * 10 + 3 * 50) / 12)


def test_the_median_is_that_of_numpy() -> None:
    truth, predicted, errors = _unit((40, 50)), _unit((40, 50), 2), AngularErrors()
    errors.add(predicted, truth, np.ones((40, 50), bool))
    exact = np.median(angles_deg(predicted, truth))
    assert errors.score().median_deg == pytest.approx(exact, abs=0.006)


def test_a_prediction_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        angles_deg(np.array([np.nan, 0, 0]), np.array([1.0, 0, 0]))


def test_without_a_pixel_there_is_no_score() -> None:
    assert math.isnan(AngularErrors().score().mean_deg)


def test_small_errors_and_their_root_mean_square_are_computed() -> None:
    angles = np.radians([0.0, 4.0, 6.0, 10.0])
    predicted = np.stack([np.sin(angles), np.zeros(4), np.cos(angles)], -1)[None]
    truth = np.broadcast_to([0.0, 0.0, 1.0], predicted.shape)
    errors = AngularErrors()
    errors.add(predicted, truth, np.ones((1, 4), bool))
    score = errors.score()
    assert (score.below_5, score.below_7_5, score.below_11_25) == (0.5, 0.75, 1.0)
    assert score.rms_deg == pytest.approx(np.sqrt((16 + 36 + 100) / 4))
