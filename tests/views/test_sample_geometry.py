from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.views.normal_axes import AXES, axes_from_axes, decode_normal
from pbrs_farm.views.sample_changes import crop, flip, resize, with_axes
from pbrs_farm.views.view_sample import Sample

FROM_CAMERA = np.diag([1.0, 1.0, 1.0])


def plane_sample(axes: str = "opencv", size: tuple[int, int] = (40, 30)) -> Sample:
    """A view of the plane n . p = -2 (OpenCV axes), with its normals and depths."""
    width, height = size
    k = np.array([[35, 0, 19.0], [0, 35, 14.0], [0, 0, 1]], np.float32)
    n = np.array([0.3, -0.5, -0.8124038], np.float32)
    rays = rays_of(k, size)
    depth = (-2 / (rays @ n)).astype(np.float32)
    normal = np.broadcast_to(n, (height, width, 3)).copy()
    valid = np.ones((height, width), bool)
    colour = np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
    sample = Sample(
        "h/v",
        "h",
        "r",
        "mlt_ol",
        k,
        "opencv",
        colour=colour,
        normal=normal,
        valid=valid,
        depth=depth,
    )
    return with_axes(sample, axes)


def rays_of(k: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    u, v = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], -1)


def slopes(sample: Sample) -> np.ndarray:
    """Angle in degrees between the stored normals and those computed from depth and K."""
    points = rays_of(sample.K, sample.size) * sample.depth[..., None]
    n = np.cross(points[1:, :-1] - points[:-1, :-1], points[:-1, 1:] - points[:-1, :-1])
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    stored = with_axes(sample, "opencv").normal[:-1, :-1]
    return np.degrees(np.arccos(np.clip(np.abs((n * stored).sum(-1)), 0, 1)))


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize(
    "change",
    [
        lambda s: s,
        flip,
        lambda s: crop(s, 5, 3, 20, 22),
        lambda s: resize(s, 20, 15),
        lambda s: resize(s, 20, 30),
        lambda s: flip(crop(s, 1, 0, 21, 30)),
    ],
)
def test_normals_stay_those_of_the_points_that_depth_and_k_give(axes, change):
    assert slopes(change(plane_sample(axes))).max() < 0.3


def test_flipping_twice_gives_the_same_bits():
    sample = plane_sample("published")
    twice = flip(flip(sample))
    assert (twice.normal == sample.normal).all()
    assert (twice.colour == sample.colour).all()
    assert (twice.K == sample.K).all()


@pytest.mark.parametrize("axes", AXES)
def test_axes_are_right_handed_and_turn_back(axes):
    assert np.linalg.det(axes_from_axes(axes, "opencv")) == pytest.approx(1)
    turned = with_axes(plane_sample("opencv"), axes)
    assert (with_axes(turned, "opencv").normal == plane_sample("opencv").normal).all()


def test_axes_have_their_named_directions():
    up, forward = np.array([0, 0, 1.0]), np.array([0, 1.0, 0])  # published
    assert (axes_from_axes("opencv", "published") @ up == [0, -1, 0]).all()
    assert (axes_from_axes("opencv", "published") @ forward == [0, 0, 1]).all()
    assert (axes_from_axes("opengl", "published") @ up == [0, 1, 0]).all()
    assert (axes_from_axes("opengl", "published") @ forward == [0, 0, -1]).all()


@pytest.mark.parametrize("axes", AXES)
def test_stored_normals_decode_to_vectors_that_round_to_the_same_bits(axes):
    rng = np.random.default_rng(4)
    n = rng.normal(size=(9, 8, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    valid = rng.random((9, 8)) > 0.2
    stored = np.where(valid[..., None], np.rint((n + 1) * 65535 / 2), 32768).astype(np.uint16)
    decoded = decode_normal(stored, valid, axes)
    published = decoded.astype(np.float64) @ axes_from_axes("published", axes).T
    assert (np.rint((published + 1) * 65535 / 2) == stored).all()
    assert (decoded[~valid] == 0).all()
    assert np.abs(np.linalg.norm(decoded[valid], axis=-1) - 1).max() < 3e-5
    assert decoded[valid] @ axes_from_axes("published", axes).T == pytest.approx(n[valid], abs=2e-5)


def test_a_crop_outside_the_picture_is_told():
    with pytest.raises(BadInput, match="is not inside"):
        crop(plane_sample(), 30, 0, 20, 20)


def test_a_layer_that_is_not_there_stays_away():
    sample = replace(plane_sample(), normal=None, valid=None)
    assert flip(sample).normal is None
    assert set(resize(sample, 10, 10).arrays()) == {"colour", "depth"}
