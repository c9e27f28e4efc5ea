"""Triangles seen from above: the cells that they cover or touch."""

from __future__ import annotations

import numpy as np

from pbrs_farm.geometry.plan_grid import PlanGrid, cells_over, covered, covered_by_each


def test_touched_cells_include_those_of_upright_faces() -> None:
    grid = PlanGrid(np.zeros(2), 0.0, 0.1, (10, 10))
    upright = np.array([[[0.05, 0, 0.55], [0.95, 0, 0.55], [0.05, 1, 0.55]]])
    assert covered(grid, upright, touched=True)[5].all()
    assert not covered(grid, upright).any()
    hits = cells_over(grid, upright, touched=True)
    assert hits.low.min() == 0
    assert hits.high.max() == 1


def test_groups_of_faces_cover_the_union_of_their_faces() -> None:
    grid = PlanGrid(np.zeros(2), 0.3, 0.1, (20, 20))
    groups = list(np.random.default_rng(4).uniform(0, 2, (3, 5, 3, 3)))
    alone = [covered(grid, group) for group in groups]
    np.testing.assert_array_equal(covered_by_each(grid, groups), alone)
