"""Distances of sets of pictures against explicit sums over pairs, and statistics of a picture."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pbrs_farm.study.comparing.picture_facts import facts_of
from pbrs_farm.study.comparing.set_distance import (
    Grouped,
    groups_to_draw,
    kernel_distance,
    nearest_of,
    shared_histogram,
    shared_of_halves,
)

OURS = Grouped(np.random.default_rng(3).normal(size=(7, 5)), ("a", "a", "b", "c", "c", "c", "d"))
THEIRS = Grouped(np.random.default_rng(4).normal(0.6, 1, size=(4, 5)), ("x", "y", "d", "z"))


def _mean_kernel(a: Grouped, b: Grouped) -> float:
    """Sum over all pairs of pictures of different groups."""
    values = [
        (float(x @ y) / 5 + 1) ** 3
        for (x, g), (y, h) in itertools.product(
            zip(a.rows, a.groups, strict=True), zip(b.rows, b.groups, strict=True)
        )
        if g != h
    ]
    return float(np.mean(values))


def test_the_kernel_distance_is_over_pairs_of_different_groups() -> None:
    expected = (
        _mean_kernel(OURS, OURS) + _mean_kernel(THEIRS, THEIRS) - 2 * _mean_kernel(OURS, THEIRS)
    )
    distance = kernel_distance(OURS, THEIRS)
    assert distance.value == pytest.approx(1000 * expected)
    assert distance.low < distance.value < distance.high


def test_a_set_is_at_no_distance_from_itself_and_the_order_does_not_count() -> None:
    assert kernel_distance(OURS, OURS).value == pytest.approx(0, abs=1e-9)
    ab, ba = kernel_distance(OURS, THEIRS), kernel_distance(THEIRS, OURS)
    assert ab.value == pytest.approx(ba.value)


def test_the_distance_of_equal_distributions_is_zero_on_average() -> None:
    values = []
    for seed in range(60):
        rows = np.random.default_rng(seed).normal(size=(12, 4))
        names = tuple(map(str, range(12)))
        values.append(kernel_distance(Grouped(rows[:6], names[:6]), Grouped(rows[6:], names[6:])).value)  # fmt: skip
    # No bias: the mean is within three of its standard errors.
    assert abs(np.mean(values)) < 3 * np.std(values) / np.sqrt(len(values))


def test_an_interval_over_few_groups_is_wider_than_over_many_pictures() -> None:
    dice = np.random.default_rng(5)
    rows = np.repeat(dice.normal(size=(4, 5)), 10, axis=0) + 0.01 * dice.normal(size=(40, 5))
    photographs = Grouped(dice.normal(size=(200, 5)), tuple(f"p{k}" for k in range(200)))
    single = Grouped(rows, tuple(map(str, range(40))))
    homes = Grouped(rows, tuple("abcd"[k // 10] for k in range(40)))
    narrow, wide = (kernel_distance(each, photographs) for each in (single, homes))
    assert wide.high - wide.low > 1.5 * (narrow.high - narrow.low)


def test_shared_histograms_are_sums_of_minima_of_means() -> None:
    a = Grouped(np.array([[1.0, 0, 0], [0, 1, 0]]), ("a", "b"))
    b = Grouped(np.array([[0.2, 0.2, 0.6]]), ("x",))
    assert shared_histogram(a, b).value == pytest.approx(0.2 + 0.2)
    overlap = shared_histogram(a, a)
    assert overlap.value == pytest.approx(1)
    assert 0 <= overlap.low <= 1 == pytest.approx(overlap.high)


def test_halves_of_equal_pictures_share_all_and_too_few_groups_have_no_halves() -> None:
    rows = np.tile([0.25, 0.75], (6, 1))
    assert shared_of_halves(Grouped(rows, tuple("abcdef"))) == pytest.approx(1)
    assert shared_of_halves(Grouped(rows, tuple("aabbcc"))) is None
    disjoint = Grouped(np.eye(4), tuple("abcd"))
    assert shared_of_halves(disjoint) == pytest.approx(0)


def test_pictures_are_drawn_singly_below_three_groups() -> None:
    assert groups_to_draw(["a", "a", "b"], ["1", "2", "3"]) == ("1", "2", "3")
    assert groups_to_draw(["a", "b", "c"], ["1", "2", "3"]) == ("a", "b", "c")


def test_the_nearest_may_be_another_of_the_same_set() -> None:
    rows = np.array([[0.0, 0], [3, 4], [3, 5]])
    distance, nearest = nearest_of(rows, rows, leave_out_self=True)
    assert nearest.tolist() == [1, 2, 1]
    assert distance.tolist() == pytest.approx([5, 1, 1])


def test_a_wall_straight_ahead_is_all_frontal() -> None:
    colour = np.full((60, 80, 3), (200, 100, 0), np.uint8)
    K = np.array([[70.0, 0, 40], [0, 70, 30], [0, 0, 1]])
    classes = np.ones((60, 80), np.uint8)
    classes[:15] = 0  # without a label
    classes[15:30] = 2
    facts = facts_of("a/1", "a", colour, np.full((60, 80), 2.5), K, classes)
    assert facts.numbers["frontal"] == 1
    assert facts.numbers["depth_m"] == 2.5
    assert facts.numbers["luma"] == pytest.approx((0.2126 * 200 + 0.7152 * 100) / 255, abs=0.005)
    assert facts.numbers["warmth"] == pytest.approx(200 / 255)
    assert facts.numbers["detail"] == 0
    # 2.5 m begins the ninth of 32 bins over 10 m.
    assert facts.histograms["depth"].argmax() == 8
    assert facts.histograms["classes"][[0, 1, 2]].tolist() == pytest.approx([0, 2 / 3, 1 / 3])
    # Red 200, green 100 and blue 0 of four bins of 64 values each.
    assert facts.histograms["colour"].argmax() == 3 * 16 + 1 * 4


def test_without_depth_only_appearance_is_counted() -> None:
    facts = facts_of("a", "a", np.zeros((30, 40, 3), np.uint8))
    assert facts.histograms.keys() == {"colour", "luma"}
    assert "frontal" not in facts.numbers
    # Unknown depth contributes nothing.
    blind = facts_of("a", "a", np.zeros((30, 40, 3), np.uint8), np.zeros((30, 40)), np.eye(3))
    assert "depth" not in blind.histograms
