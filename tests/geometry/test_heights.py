"""Heights of triangles below and above points, against known planes."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.geometry.heights import heights_in, highest_below, lowest_above

# A slope y = 1 + x / 2 over the unit square, a level square at 3 above it, and an upright triangle.
SLOPE = np.array(
    [[[0, 1, 0], [1, 1.5, 0], [1, 1.5, 1]], [[0, 1, 0], [1, 1.5, 1], [0, 1, 1]]], float
)
LEVEL = np.array([[[0, 3, 0], [1, 3, 0], [1, 3, 1]], [[0, 3, 0], [1, 3, 1], [0, 3, 1]]], float)
UPRIGHT = np.array([[[0.2, 0, 0.2], [0.2, 9, 0.2], [0.8, 9, 0.8]]], float)
ALL = np.concatenate([SLOPE, LEVEL, UPRIGHT])
PLACES = np.array([[0.0, 0.0], [0.5, 0.25], [1.0, 1.0], [1.1, 0.5]])


def test_the_highest_below_is_the_top_without_a_limit() -> None:
    assert highest_below(PLACES, ALL).tolist() == [3, 3, 3, -np.inf]


def test_a_limit_per_point_hides_higher_faces_but_not_touching_ones() -> None:
    heights = highest_below(PLACES, ALL, np.array([3.0, 2.0, 1.0, 9.0]))
    assert heights == pytest.approx([3, 1.25, -np.inf, -np.inf])


def test_the_lowest_face_above_excludes_those_that_touch_the_limit() -> None:
    assert lowest_above(PLACES, ALL, 0.0) == pytest.approx([1, 1.25, 1.5, np.inf])
    assert lowest_above(PLACES, ALL, np.array([1.0, 1.0, 3.0, 0.0])) == pytest.approx(
        [3, 1.25, np.inf, np.inf]
    )


def test_many_places_and_triangles_are_taken_in_parts() -> None:
    rng = np.random.default_rng(1)
    places, many = rng.random((3000, 2)), np.tile(SLOPE, (400, 1, 1))
    assert highest_below(places, many) == pytest.approx(1 + places[:, 0] / 2)
    assert lowest_above(places, many, -5.0) == pytest.approx(1 + places[:, 0] / 2)


def test_a_height_is_no_number_beyond_the_triangles_edges() -> None:
    heights = heights_in(PLACES, SLOPE[[0, 0, 0, 0]])
    assert heights[:3] == pytest.approx([1, 1.25, 1.5])
    assert np.isnan(heights[3])
    assert heights_in(PLACES[3:], SLOPE[:1], edge=0.2) == pytest.approx([1.55])


def test_nothing_has_no_heights() -> None:
    assert highest_below(PLACES, ALL[:0]).tolist() == [-np.inf] * 4
    assert lowest_above(np.zeros((0, 2)), ALL, 0.0).shape == (0,)
