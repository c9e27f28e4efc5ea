"""The distance between the contents of views and of photographs, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.sample.photo_choice import NYUV2_SHARES, share_distance

PHOTOGRAPHS = np.array([NYUV2_SHARES.get(name, 0.0) for name in NYU13_NAMES])


def only(name: str) -> F64:
    """Pictures with a single class."""
    return np.eye(len(NYU13_NAMES))[NYU13_NAMES.index(name)]


def test_photographs_are_like_photographs() -> None:
    assert share_distance(PHOTOGRAPHS) == pytest.approx(0, abs=1e-12)


def test_scale_and_unlabelled_pixels_change_no_distance() -> None:
    some = PHOTOGRAPHS + 0.3 * only("wall")
    assert share_distance(some) == pytest.approx(share_distance(40 * some + 7 * only("none")))


def test_a_class_that_no_photograph_shows_is_as_far_as_can_be() -> None:
    assert share_distance(only("television")) == pytest.approx(2)
    assert share_distance(np.zeros(len(NYU13_NAMES))) == 2


def test_the_distance_of_bare_walls_is_twice_the_other_classes_of_photographs() -> None:
    wall = NYUV2_SHARES["wall"] / sum(NYUV2_SHARES.values())
    assert share_distance(only("wall")) == pytest.approx(2 * (1 - wall))


def test_each_row_has_a_separate_distance() -> None:
    rows = np.stack([PHOTOGRAPHS, only("wall"), only("floor")])
    assert share_distance(rows) == pytest.approx([float(share_distance(row)) for row in rows])
