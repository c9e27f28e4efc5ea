"""Tolerance of a tracked point's place: exactly the error of 32-bit floats."""

import numpy as np
import pytest

from pbrs_farm.check.track_checks import place_slack_px


@pytest.mark.parametrize("depth_m", [0.0046, 0.05, 1.0, 6.0])
def test_a_vertex_of_32_bits_moves_a_place_by_less_than_is_allowed(depth_m: float) -> None:
    # A camera 3 m from the origin looks along z at points beside its axis, f = 600 px.
    points = np.array([[0.8, 0.3, 3 + depth_m], [-0.21, 0.7, 3 + depth_m]])
    exact = 600 * points[:, :2] / (points[:, 2:] - 3)
    rounded = points.astype(np.float32).astype(np.float64)
    stored = (600 * rounded[:, :2] / (rounded[:, 2:] - 3)).astype(np.float32)
    depth = np.full(2, depth_m)
    assert (np.abs(stored - exact).max(1) <= place_slack_px(exact, depth)).all()


def test_a_point_a_twentieth_of_a_pixel_off_is_reported() -> None:
    assert place_slack_px(np.array([[320.0, 240.0]]), np.array([1.0]))[0] < 0.05
