from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.normal_maps import MIN_Z, normals_from_picture, perturbed_normals, tangents


def test_bytes_are_gltfs_normals_of_unit_length() -> None:
    pixels = np.array([[[128, 128, 255], [255, 128, 128], [0, 0, 0]]], np.uint8)
    normals = normals_from_picture(pixels, 1.0)[0]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=0.006)
    assert normals[1, 0] > 0.99
    assert normals[1, 2] >= 0.99 * MIN_Z
    np.testing.assert_array_equal(normals[2], [0, 0, 1])  # black is no normal


def test_the_scale_multiplies_the_slopes() -> None:
    slope = np.array([0.2, -0.1, 1.0])
    pixels = np.round((slope / np.linalg.norm(slope) + 1) * 127.5).astype(np.uint8)[None, None]
    half = normals_from_picture(pixels, 0.5)[0, 0]
    np.testing.assert_allclose(half[:2] / half[2], 0.5 * slope[:2], atol=0.01)
    np.testing.assert_allclose(normals_from_picture(pixels, 0.0)[0, 0], [0, 0, 1], atol=1e-6)


def test_nothing_leans_into_the_surface() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    normals = normals_from_picture(pixels, 3.0)
    assert normals[..., 2].min() > 0.99 * MIN_Z / np.hypot(1, MIN_Z)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)


@pytest.mark.parametrize("mirrored", [False, True])
def test_tangents_are_along_u_and_v_for_any_triangle(mirrored: bool) -> None:
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(50, 3, 3))
    u_axis, v_axis = np.array([-1.0 if mirrored else 1.0, 0, 0]), np.array([0, 1.0, 0])
    corners[..., 2] = 0
    uvs = np.stack([corners @ u_axis, corners @ v_axis], -1)
    dp_du, side, is_defined = tangents(corners, uvs)
    front = np.sign(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2])
    normals = front[:, None] * np.array([0, 0, 1.0])
    towards_u, towards_v = (
        perturbed_normals(normals, dp_du, side, np.tile(m, (50, 1)))
        for m in ([0.6, 0, 0.8], [0, 0.6, 0.8])
    )
    assert is_defined.all()
    np.testing.assert_allclose(towards_u, 0.6 * u_axis + 0.8 * normals, atol=1e-9)
    np.testing.assert_allclose(towards_v, 0.6 * v_axis + 0.8 * normals, atol=1e-9)


def test_triangles_whose_texture_has_no_area_have_no_tangent() -> None:
    corners = np.random.default_rng(2).normal(size=(2, 3, 3))
    uvs = np.zeros((2, 3, 2))
    uvs[1] = [[0, 0], [1, 1], [2, 2]]
    assert not tangents(corners, uvs)[2].any()
