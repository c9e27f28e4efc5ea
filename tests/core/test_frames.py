"""Transforms: which are invertible."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.frames import is_flattening, rotation_x, rotation_y


@pytest.mark.parametrize("scale", [1e-12, 1e-5, 1.0, 1e6])
def test_a_scale_of_any_size_flattens_nothing_and_a_lost_direction_does(scale: float) -> None:
    turn = rotation_x(0.3) @ rotation_y(1.1)
    assert not is_flattening(turn * scale)
    assert not is_flattening(turn @ np.diag([scale, -scale, scale * 1e-9]))
    assert is_flattening(turn @ np.diag([scale, scale, 0.0]) @ turn.T)
    assert is_flattening(np.diag([scale, scale, scale * 1e-12]))
    assert is_flattening(np.zeros((3, 3)))


def test_in_a_plane_as_in_space() -> None:
    assert not is_flattening(np.diag([1e-4, 1e-4]))
    assert is_flattening(np.array([[1.0, 2.0], [2.0, 4.0]]))
