"""Parts that CoACD has grown are brought back into the model: what rests on them does not hover."""

from __future__ import annotations

import numpy as np

from pbrs_farm.geometry.convex_parts import _within


def test_points_of_a_grown_part_lie_on_the_model_and_the_others_stay() -> None:
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    grown = 0.5 + 1.02 * (cube - 0.5)
    inside = np.array([[0.5, 0.5, 0.5], [0.2, 0.9, 0.1]])
    found = _within(np.concatenate([grown, inside]), cube)
    np.testing.assert_allclose(found[:8], cube, atol=2e-6)
    np.testing.assert_array_equal(found[8:], inside)


def test_a_flat_model_leaves_its_parts_as_they_are() -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)
    np.testing.assert_array_equal(_within(flat + 0.1, flat), flat + 0.1)
