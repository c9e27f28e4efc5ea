"""Candidates: one per cell and sector, uniform, and dependent only on their names."""

import numpy as np
import pytest
from scipy import stats

from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.candidates import Grid, grid_candidates, uniforms

GRID = Grid(-1.0, 2.0, 4.0, 6.0, base_y=3.0)
FIELDS = CameraFields()


def test_each_cell_has_one_candidate_in_each_sector_inside_both() -> None:
    c = grid_candidates(GRID, FIELDS, (0, "house", "room"))
    assert len(c) == 6 * 20 * 16
    assert len(
        {(*cell, s) for cell, s in zip(c.cell.tolist(), c.sector.tolist(), strict=True)}
    ) == len(c)
    in_cell = (c.eye[:, [0, 2]] - (GRID.x_min, GRID.z_min)) / 0.25 - c.cell
    assert in_cell.min() >= 0
    assert in_cell.max() <= 1 + 1e-9
    azimuth = np.arctan2(c.towards[:, 2], c.towards[:, 0]) % (2 * np.pi)
    np.testing.assert_array_equal((azimuth // (np.pi / 3)).astype(int), c.sector)
    height = c.eye[:, 1] - GRID.base_y
    assert height.min() >= 1.5
    assert height.max() <= 1.6
    np.testing.assert_allclose(np.linalg.norm(c.towards, axis=1), 1)
    np.testing.assert_allclose(np.arcsin(-c.towards[:, 1]), np.deg2rad(11))


def test_position_height_and_azimuth_are_uniform() -> None:
    """Kolmogorov-Smirnov at significance 1e-3 each, 1920 candidates, fixed seed."""
    c = grid_candidates(GRID, FIELDS, (1, "house", "room"))
    azimuth = np.arctan2(c.towards[:, 2], c.towards[:, 0]) % (2 * np.pi)
    in_cell = (c.eye[:, [0, 2]] - (GRID.x_min, GRID.z_min)) / 0.25 - c.cell
    numbers = np.stack(
        [*in_cell.T, (c.eye[:, 1] - 4.5) / 0.1, azimuth / (np.pi / 3) - c.sector], axis=1
    )
    for column in numbers.T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    correlation = np.corrcoef(numbers.T) - np.eye(4)
    assert np.abs(correlation).max() < 4 / np.sqrt(len(c))


def test_the_hash_is_uniform_over_neighbouring_cells_and_keys() -> None:
    """Chi-square over 16 bins at significance 1e-3 each, and no correlation between neighbours."""
    cell = np.stack(np.meshgrid(np.arange(100), np.arange(100)), -1).reshape(-1, 2).astype(np.int32)
    first, second = uniforms(7, cell, 2), uniforms(8, cell, 2)
    for column in (*first.T, *second.T):
        counts, _edges = np.histogram(column, 16, (0, 1))
        assert stats.chisquare(counts).pvalue > 1e-3
    assert abs(np.corrcoef(first[:, 0], second[:, 0])[0, 1]) < 0.04
    assert abs(np.corrcoef(first[:-1, 0], first[1:, 0])[0, 1]) < 0.04


def test_a_cell_keeps_its_candidate_when_the_grid_grows() -> None:
    wider = Grid(GRID.x_min, GRID.z_min, GRID.x_max + 3, GRID.z_max + 2, GRID.base_y)
    small = grid_candidates(GRID, FIELDS, (0, "h", "r"))
    large = grid_candidates(wider, FIELDS, (0, "h", "r"))
    positions = {
        (*c, s): k
        for k, (c, s) in enumerate(zip(large.cell.tolist(), large.sector.tolist(), strict=True))
    }
    same = [
        positions[(*c, s)] for c, s in zip(small.cell.tolist(), small.sector.tolist(), strict=True)
    ]
    np.testing.assert_array_equal(large.eye[same], small.eye)
    np.testing.assert_array_equal(large.towards[same], small.towards)


@pytest.mark.parametrize("other", [(1, "h", "r"), (0, "g", "r"), (0, "h", "q")])
def test_seed_house_and_room_each_change_every_candidate(other: tuple[int, str, str]) -> None:
    a, b = grid_candidates(GRID, FIELDS, (0, "h", "r")), grid_candidates(GRID, FIELDS, other)
    assert (a.eye != b.eye).all()


def test_a_spread_of_tilts_is_normal_and_changes_nothing_else() -> None:
    spread = FIELDS.model_copy(update={"tilt_deg": 8.0, "tilt_sd_deg": 5.0})
    fixed, c = (grid_candidates(GRID, f, (0, "h", "r")) for f in (FIELDS, spread))
    tilt = np.rad2deg(np.arcsin(-c.towards[:, 1]))
    assert np.median(tilt) == pytest.approx(8, abs=0.6)
    assert tilt.min() >= -2 - 1e-9
    assert tilt.max() <= 18 + 1e-9
    inside = np.abs(tilt - 8) < 9.9
    assert stats.kstest(tilt[inside], stats.truncnorm(-1.98, 1.98, 8, 5).cdf).pvalue > 1e-3
    np.testing.assert_array_equal(c.eye, fixed.eye)
    azimuth, same = (np.arctan2(x.towards[:, 2], x.towards[:, 0]) for x in (c, fixed))
    np.testing.assert_allclose(azimuth, same)


def test_a_spread_of_rolls_turns_cameras_about_their_axis_and_moves_nothing_else() -> None:
    rolled = FIELDS.model_copy(update={"roll_sd_deg": 4.0})
    fixed, c = (grid_candidates(GRID, f, (0, "h", "r")) for f in (FIELDS, rolled))
    assert not fixed.roll.any()
    roll = np.rad2deg(c.roll)
    inside = np.abs(roll) < 7.9
    assert stats.kstest(roll[inside], stats.truncnorm(-1.975, 1.975, 0, 4).cdf).pvalue > 1e-3
    np.testing.assert_array_equal(c.eye, fixed.eye)
    np.testing.assert_array_equal(c.towards, fixed.towards)
    # A clockwise roll by r degrees: the horizon falls to the right, so the camera's right points
    # down.
    number = np.array([int(np.argmax(c.roll))])
    level, turned = (x.cameras(number, Intrinsics.from_hfov(64, 48))[0] for x in (fixed, c))
    a, b = level.world_from_camera, turned.world_from_camera
    np.testing.assert_allclose(b[:3, 2], a[:3, 2], atol=1e-12)
    assert float(b[1, 0]) < 0
    angle = np.degrees(np.arccos(float(a[:3, 0] @ b[:3, 0])))
    assert angle == pytest.approx(float(roll.max()))
