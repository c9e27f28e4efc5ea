"""near_any_triangle against the nearest of all triangles."""

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pbrs_farm.sample.clearance import near_any_triangle
from tests.hypothesis_profiles import examples
from tests.raycast.scenes import geometry, soup


@settings(max_examples=examples(15), deadline=None)
@given(seed=st.integers(0, 10_000), reach=st.floats(0.01, 0.5))
def test_points_are_near_exactly_when_the_nearest_triangle_is(seed: int, reach: float) -> None:
    g = soup(40, seed)
    points = np.random.default_rng(seed).uniform(-3, 3, (60, 3))
    triangles = g.positions[g.faces].astype(np.float64)
    distances = [
        np.linalg.norm(
            trimesh.triangles.closest_point(triangles, np.broadcast_to(p, (40, 3))) - p, axis=1
        ).min()
        for p in points
    ]
    near = near_any_triangle(points, g, reach)
    decided = np.abs(np.array(distances) - reach) > 1e-9
    np.testing.assert_array_equal(near[decided], (np.array(distances) <= reach)[decided])


def test_no_clearance_or_no_triangle_means_nothing_is_near() -> None:
    points = np.zeros((2, 3))
    assert not near_any_triangle(points, geometry(np.zeros((0, 3, 3))), 0.1).any()
    assert not near_any_triangle(points, geometry(np.zeros((1, 3, 3))), 0.0).any()
    broken = geometry(np.full((1, 3, 3), np.nan))
    assert not near_any_triangle(points, broken, 0.1).any()
