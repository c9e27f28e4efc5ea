"""Scores of segmentation against counts by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.study.metrics.confusion import Confusion


def test_scores_are_those_of_a_matrix_by_hand() -> None:
    confusion = Confusion(4)
    truth = np.array([[1, 1, 1, 1, 2, 2, 0, 0]])
    predicted = np.array([[1, 1, 1, 2, 2, 3, 4, 1]])
    assert confusion.add(predicted, truth) == pytest.approx(4 / 6)
    score = confusion.score()
    assert score.pixel_accuracy == pytest.approx(4 / 6)
    assert score.mean_accuracy == pytest.approx((3 / 4 + 1 / 2) / 2)
    # Class 3 is predicted once and never true; class 4 only at unlabelled pixels.
    assert score.mean_iou == pytest.approx((3 / 4 + 1 / 3 + 0) / 3)
    assert score.weighted_iou == pytest.approx(4 / 6 * 3 / 4 + 2 / 6 * 1 / 3)
    assert score.n_pixels == 6


def test_two_views_pool_into_one_matrix() -> None:
    rng, pooled, whole = np.random.default_rng(0), Confusion(5), Confusion(5)
    truth, predicted = rng.integers(0, 6, (2, 9, 9)), rng.integers(1, 6, (2, 9, 9))
    for k in range(2):
        pooled.add(predicted[k], truth[k])
    whole.add(predicted.reshape(9, 18), truth.reshape(9, 18))
    assert pooled.score() == whole.score()


def test_a_perfect_prediction_scores_one() -> None:
    confusion, truth = Confusion(40), np.arange(1, 41).reshape(5, 8)
    confusion.add(truth, truth)
    score = confusion.score()
    assert (score.pixel_accuracy, score.mean_iou, score.weighted_iou) == (1, 1, pytest.approx(1))


@pytest.mark.parametrize(("predicted", "truth"), [(1, 41), (0, 3), (41, 3)])
def test_a_class_that_the_net_lacks_is_named(predicted: int, truth: int) -> None:
    with pytest.raises(ValueError, match=r"is not a class of 1 to 40"):
        Confusion(40).add(np.array([[predicted]]), np.array([[truth]]))
