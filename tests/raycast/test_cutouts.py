"""Rays continue behind holes in surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.cutouts import CutOut
from pbrs_farm.core.house import Geometry
from pbrs_farm.raycast.caster import Caster
from tests.raycast.scenes import camera, geometry, wall

VARIANTS = ["llvm_ad_rgb", "scalar_rgb"]


def square(z: float, half: float = 1.0) -> NDArray[np.float64]:
    return wall(z, half)


def scene(*layers: tuple[float, int]) -> Geometry:
    """Squares across the axis at z, each with a material; uv 0..1 over its middle 2 m."""
    soup = geometry(np.concatenate([square(z) for z, _ in layers]))
    pairs = np.repeat(np.arange(len(layers)), 2)
    object.__setattr__(soup, "face_item", (pairs + 1).astype(np.uint32))
    object.__setattr__(soup, "face_material", np.array([m for _, m in layers], np.int32)[pairs])
    object.__setattr__(soup, "uvs", ((soup.positions[:, :2] + 1) / 2).astype(np.float32))
    return soup


def chequered(cutoff: float = 0.5, low: int = 0, high: int = 255) -> CutOut:
    """A picture whose left half is a hole and right half is solid."""
    alpha = np.full((8, 8, 1), high, np.uint8)
    alpha[:, :4] = low
    return CutOut(alpha, cutoff)


def near_camera() -> Camera:
    """A camera at 2 m: the squares at z = 0 fill part of the picture."""
    return camera(80, 60, eye=(0, 0, 2))


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_first_hit_is_the_first_that_is_not_cut_out(variant: str) -> None:
    sheets = scene((0, 1), (-1, 0))
    caster = Caster(sheets, cut_outs={1: chequered()}, variant=variant)
    cam = near_camera()
    hit = caster.hit_record(cam)
    _, rays = cam.rays()
    near = rays[..., :2] * 2  # intersections with z = 0
    far = rays[..., :2] * 3
    on_near, on_far = (np.abs(p).max(-1) < 0.99 for p in (near, far))
    # The picture repeats: the outer half texel at the left edge is between hole and leaf.
    left, right = (near[..., 0] < -0.01) & (near[..., 0] > -0.9), near[..., 0] > 0.01
    right &= near[..., 0] < 0.9
    assert (hit.item[on_near & left & on_far] == 2).all()
    assert (hit.item[on_near & right] == 1).all()
    assert np.allclose(hit.depth_z[on_near & left & on_far], 3)
    assert np.allclose(hit.depth_z[on_near & right], 2)
    assert (hit.item[on_near & left & (np.abs(far).max(-1) > 1.01)] == 0).all()
    assert (on_near & left & on_far).sum() > 100
    assert np.array_equal(caster.item_buffer(cam), hit.item)


def test_cutoffs_of_one_picture_differ() -> None:
    sheets, cam = scene((0, 1)), near_camera()
    hit_masks = [
        int((Caster(sheets, cut_outs={1: chequered(c, 90, 200)}).item_buffer(cam) == 1).sum())
        for c in (0.2, 0.5, 0.9)
    ]
    assert hit_masks[2] == 0
    assert 0.4 * hit_masks[0] < hit_masks[1] < 0.6 * hit_masks[0]


def test_rays_pass_sheet_after_sheet_and_stop_at_solids() -> None:
    sheets = [(-0.1 * k, 1) for k in range(12)]
    caster = Caster(scene(*sheets, (-1.5, 0)), cut_outs={1: chequered()})
    t, face = caster.first_hit(
        np.array([[-0.5, 0, 2.0], [0.5, 0, 2]]), np.array([[0, 0, -2.0]] * 2)
    )
    assert (face // 2).tolist() == [12, 0]
    assert np.allclose(t, [1.75, 1])


def test_a_leaf_flat_on_a_wall_hides_no_part_of_it() -> None:
    for gap in (0.0, 1e-6, 1e-5):
        caster = Caster(scene((0, 1), (-gap, 0)), cut_outs={1: chequered()})
        buffer = caster.item_buffer(near_camera())
        _, rays = near_camera().rays()
        near = rays[..., :2] * 2
        assert (buffer[np.abs(near).max(-1) < 0.99] > 0).all()
        assert (buffer[(np.abs(near).max(-1) < 0.9) & (near[..., 0] < -0.05)] == 2).all()


def test_the_largest_distance_holds_behind_a_hole() -> None:
    caster = Caster(scene((0, 1), (-1, 0), (-2, 1)), cut_outs={1: chequered()})
    origins = np.array([[-0.5, 0, 1.0]] * 3)
    reach = np.array([0.5, 1.5, 2.5])
    t, face = caster.first_hit(origins, np.array([[0, 0, -1.0]] * 3), reach)
    assert face.tolist()[:2] == [-1, -1]
    assert face[2] // 2 == 1
    assert np.allclose(t[2], 2)
    assert np.isinf(t[:2]).all()


def test_counts_are_those_of_the_pictures() -> None:
    caster = Caster(scene((0, 1), (-1, 0)), cut_outs={1: chequered()})
    away = camera(80, 60, eye=(0, 0, 2), towards=(0, 0, 1))
    cameras = [near_camera(), away, camera(40, 30, eye=(0.3, 0, 2)), near_camera()]
    counts = caster.item_counts(cameras)
    for row, cam in zip(counts, cameras, strict=True):
        expected = np.bincount(caster.item_buffer(cam).ravel(), minlength=3)
        assert np.abs(row.astype(int) - expected).max() <= 2
        assert row.sum() == expected.sum()
    wide = replace(away, intrinsics=away.intrinsics.zoomed(0.5))
    cameras = [near_camera().with_size(80, 60), wide, away]
    depth, items = caster.item_pictures(cameras)
    for k, cam in enumerate(cameras):
        hit = caster.hit_record(cam)
        assert (items[k] != hit.item).sum() <= 2
        same = items[k] == hit.item
        np.testing.assert_allclose(depth[k][same], hit.depth_z[same], rtol=1e-4)


def test_faces_that_are_skipped_may_have_holes() -> None:
    sheets = scene((0.5, 0), (0, 1), (-1, 0))
    caster = Caster(sheets, cut_outs={1: chequered()})
    skip = np.array([True, True, *[False] * 4])
    assert set(np.unique(caster.hit_record(near_camera()).item)) == {1}
    assert set(np.unique(caster.hit_record(near_camera(), skip_faces=skip).item)) == {0, 2, 3}


def test_without_holes_rays_are_traced_once_by_the_same_tracer() -> None:
    sheets = scene((0, 1), (-1, 0))
    assert type(Caster(sheets, cut_outs={5: chequered()}).tracer) is type(Caster(sheets).tracer)
