"""A NaN never becomes an index: of a voxel, of a cell of the sun's plane, or from a random number."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.raycast.variant import choose_variant, mitsuba

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

_NAN = float("nan")


def test_a_random_number_that_is_nan_becomes_0() -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.sampler import as_random

    u = as_random(mi.Float([_NAN, -0.5, 0.25, 1.5])).numpy()
    assert u.tolist()[:3] == [0, 0, 0.25]
    assert 0.999 < u[3] < 1


def test_a_point_that_is_nan_gets_a_voxel_of_the_grid() -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid

    grid = VoxelGrid(np.array([[0, 0, 0], [3, 3, 3]], np.float32))
    points = mi.Point3f([_NAN, 9, 9], [9, _NAN, 9], [9, 9, _NAN])
    # A NaN coordinate counts as the lowest coordinate.
    width = round(grid.n_voxels ** (1 / 3))
    expected = [(width**3 - 1) - (width - 1) * stride for stride in (width**2, width, 1)]
    assert grid.voxel(points).numpy().tolist() == expected


def test_a_point_that_is_nan_is_in_no_cell_of_the_sun() -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.sun import SunPlane

    plane = SunPlane(np.array([0.0, 1.0, 0.0]), np.array([[0.0, 0, 0], [2, 0, 2]]))
    cell, inside = plane.cell(mi.Point3f(_NAN, 0, 0), mi.Vector3f(0, 1, 0))
    assert not inside.numpy()[0]
    assert cell.numpy()[0] < plane.n_cells
