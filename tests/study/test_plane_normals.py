"""Normals from depth against known planes."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.study.metrics.angular import angles_deg
from pbrs_farm.study.plane_normals import large_planes, normals_of_depth, smoothed_normals

pytestmark = pytest.mark.study

K = np.array([[150.0, 0, 80], [0, 150.0, 60], [0, 0, 1]])


def _rays() -> np.ndarray:
    u, v = np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5)
    return np.stack([(u - 80) / 150, (v - 60) / 150, np.ones_like(u)], -1)


def _depth_of_plane(normal: np.ndarray, distance_m: float) -> np.ndarray:
    return -distance_m / (_rays() @ normal)


@pytest.mark.parametrize("normal", [(0, 0, -1), (0.5, -0.3, -0.8), (0, -0.8, -0.6)])
def test_a_planes_normal_is_found_everywhere(normal: tuple[float, ...]) -> None:
    unit = np.array(normal) / np.linalg.norm(normal)
    depth = _depth_of_plane(unit, 2.0)
    depth = np.where((depth > 0.3) & (depth < 8), depth, 0)
    fitted, trusted = normals_of_depth(depth, K)
    assert trusted[20:100, 20:140].mean() > 0.7
    assert angles_deg(fitted[trusted], np.broadcast_to(unit, fitted.shape)[trusted]).max() < 0.05


def test_noise_of_a_depth_camera_tilts_normals_by_few_degrees() -> None:
    unit = np.array([0.3, -0.2, -0.93])
    unit /= np.linalg.norm(unit)
    depth = _depth_of_plane(unit, 2.5)
    noisy = 1 / (1 / depth + np.random.default_rng(0).normal(0, 0.0008, depth.shape))
    normal, trusted = normals_of_depth(noisy, K)
    assert trusted.mean() > 0.8
    assert angles_deg(normal[trusted], np.broadcast_to(unit, normal.shape)[trusted]).mean() < 10


def test_two_planes_at_a_step_do_not_mix() -> None:
    depth = np.full((120, 160), 3.0)
    depth[:, 80:] = 2.0
    normal, trusted = normals_of_depth(depth, K)
    assert (
        angles_deg(normal[trusted], np.broadcast_to([0, 0, -1.0], normal.shape)[trusted]).max()
        < 0.01
    )


def test_unknown_or_rough_depth_is_not_trusted() -> None:
    depth = np.full((120, 160), 2.0)
    depth[40:80, 40:80] = 0
    depth[:, 120:] = 2 + np.random.default_rng(1).normal(0, 0.06, (120, 40))
    normal, trusted = normals_of_depth(depth, K)
    assert not trusted[40:80, 40:80].any()
    assert trusted[:, 126:154].mean() < 0.1
    assert (normal[~trusted] == 0).all()


def test_large_planes_are_found_through_noise_and_leave_small_ones_out() -> None:
    planes = np.array([[0, -0.94, -0.34], [0.6, 0, -0.8], [0, 0, -1.0]])
    depths = np.stack([_depth_of_plane(n, d) for n, d in zip(planes, (1.2, 2.5, 1.5), strict=True)])
    depths = np.where(depths > 0, depths, 99)
    nearest = depths[:2].argmin(0)
    nearest[20:35, 40:60] = (
        2  # a picture frame of 1.6 % of the pixels, half a metre before the wall
    )
    depth = np.take_along_axis(depths, nearest[None], 0)[0]
    noisy = 1 / (1 / depth + np.random.default_rng(0).normal(0, 0.0018, depth.shape))
    normal, valid = normals_of_depth(noisy, K)
    fitted = large_planes(noisy, normal, valid, K)
    is_on = fitted.any(-1)
    # Beside the crease, pixels are near both planes.
    assert (angles_deg(fitted[is_on], planes[nearest][is_on]) < 0.1).mean() > 0.97
    assert angles_deg(normal[valid], planes[nearest][valid]).mean() > 5, "the windows are noisy"
    assert not is_on[22:33, 42:58].any()
    assert all(is_on[nearest == k].mean() > 0.6 for k in (0, 1))
    assert not large_planes(noisy, normal, np.zeros_like(valid), K).any()


def test_smoothed_normals_are_means_of_a_square() -> None:
    normal = np.random.default_rng(0).normal(size=(30, 40, 3))
    valid = np.random.default_rng(1).random((30, 40)) > 0.3
    smooth = smoothed_normals(normal, valid, radius=0.05)
    square = (slice(8, 13), slice(18, 23))
    mean = normal[square][valid[square]].sum(0)
    np.testing.assert_allclose(smooth[10, 20], mean / np.linalg.norm(mean), atol=1e-6)
    corner = normal[:3, :3][valid[:3, :3]].sum(0)
    np.testing.assert_allclose(smooth[0, 0], corner / np.linalg.norm(corner), atol=1e-6)
