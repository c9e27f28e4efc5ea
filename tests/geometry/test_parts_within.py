"""Parts that CoACD has enlarged are shrunk back into the model: items resting on them do not hover."""

from __future__ import annotations

import numpy as np

from pbrs_farm.geometry.convex_parts import clamped_to_hull


def test_points_of_a_grown_part_lie_on_the_model_and_the_others_stay() -> None:
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    grown = 0.5 + 1.02 * (cube - 0.5)
    inside = np.array([[0.5, 0.5, 0.5], [0.2, 0.9, 0.1]])
    inside_points = clamped_to_hull(np.concatenate([grown, inside]), cube)
    np.testing.assert_allclose(inside_points[:8], cube, atol=2e-6)
    np.testing.assert_array_equal(inside_points[8:], inside)


def test_a_flat_model_leaves_its_parts_unchanged() -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)
    np.testing.assert_array_equal(clamped_to_hull(flat + 0.1, flat), flat + 0.1)
