"""Points spread over triangles."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.geometry.surface_points import surface_points


@pytest.mark.parametrize("seed", range(12))
def test_points_in_a_box_are_those_that_lie_in_it_of_all_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(30, 3, 3)) * 10 ** rng.uniform(-2, 0.5)
    if seed % 2:  # walls: flat across an axis, on a lattice
        corners[:, :, seed % 3] = 1.0
        corners = np.round(corners, 1)
    middle = corners[3, 1]
    box = np.stack([middle - 0.2, middle + 0.3])
    points = surface_points(corners, 0.015)
    inside = ((points > box[0]) & (points < box[1])).all(1)
    box_points = surface_points(corners, 0.015, box)
    assert len(box_points) > 0
    np.testing.assert_array_equal(box_points, points[inside])


def test_a_part_of_a_wall_has_the_points_of_its_cells() -> None:
    wall = np.array([[[0, 0, 0], [6, 0, 0], [0, 3, 0]]], np.float64)
    points = surface_points(wall, 0.015, np.array([[1.0, 1.0, -1.0], [1.1, 1.2, 1.0]]))
    assert ((points > [1, 1, -1]) & (points < [1.1, 1.2, 1])).all()
    # Cells are 15 mm wide at the base and narrow towards the apex.
    assert len(points) == pytest.approx(0.1 * 0.2 / 0.015**2 / (1 - 1.1 / 3), rel=0.25)
