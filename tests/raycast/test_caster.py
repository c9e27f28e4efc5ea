"""The ray caster against closed forms, against brute force, and against itself."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry
from pbrs_farm.core.lenses import Lens
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.raycast.hit_records import hit_record_from_faces
from tests.raycast.scenes import camera, geometry, soup, wall

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")


@pytest.fixture(params=VARIANTS)
def variant(request: pytest.FixtureRequest) -> str:
    if request.param == "llvm_ad_rgb":
        from pbrs_farm.raycast.variant import find_llvm

        if find_llvm() is None:
            pytest.skip("no LLVM of version 17 or later")
    return str(request.param)


def brute_force(g: Geometry, view: Camera) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Depth and face of every pixel by testing every triangle (Moeller and Trumbore 1997)."""
    origin, directions = view.rays()
    d = directions.reshape(-1, 1, 3).astype(np.float64)
    a, b, c = (g.positions[g.faces[:, k]].astype(np.float64) for k in range(3))
    p = np.cross(d, c - a)
    det = ((b - a) * p).sum(-1)
    s = origin.astype(np.float64) - a
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (s * p).sum(-1) / det
        q = np.cross(s, b - a)
        v = (d * q).sum(-1) / det
        t = ((c - a) * q).sum(-1) / det
    t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    face = np.where(np.isfinite(t.min(1)), t.argmin(1), -1)
    shape = directions.shape[:2]
    return t.min(1).reshape(shape), face.reshape(shape)


def test_depth_of_a_wall_across_the_axis_is_its_distance_at_every_pixel(variant: str) -> None:
    hit = Caster(geometry(wall(-2.5)), variant=variant).hit_record(camera())
    assert hit.valid.all()
    np.testing.assert_allclose(hit.depth_z, 2.5, rtol=2e-7)
    np.testing.assert_array_equal(hit.geo_normal_world, np.broadcast_to([0, 0, 1], (60, 80, 3)))


def test_every_pixel_agrees_with_testing_every_triangle(variant: str) -> None:
    g, view = soup(300), camera(64, 48, eye=(0, 0.2, 4), towards=(0, -0.1, -1))
    depth, face = brute_force(g, view)
    hit = Caster(g, variant=variant).hit_record(view)
    same = hit.face == face
    assert (~same).sum() <= 2  # rays through an edge
    both_hit = same & (face >= 0)
    assert both_hit.mean() > 0.5
    np.testing.assert_allclose(hit.depth_z[both_hit], depth[both_hit], rtol=1e-5)


def test_a_hit_is_on_its_pixels_ray_and_in_its_triangle() -> None:
    g, view = soup(300, seed=1), camera(64, 48, eye=(0, 0, 4))
    hit = Caster(g).hit_record(view)
    origin, directions = view.rays()
    on_ray = origin + hit.depth_z[..., None] * directions
    valid = hit.valid
    np.testing.assert_allclose(hit.points.position_world[valid], on_ray[valid], atol=2e-6)
    a = g.positions[g.faces[hit.face[valid], 0]]
    off_plane = ((hit.points.position_world[valid] - a) * hit.geo_normal_world[valid]).sum(-1)
    assert np.abs(off_plane).max() < 5e-6
    np.testing.assert_allclose(
        hit.points.uv[valid], hit.points.position_world[valid][:, :2], atol=2e-5
    )


def test_normals_have_unit_length_and_face_the_camera() -> None:
    view = camera(64, 48, eye=(0, 0, 4))
    hit = Caster(soup(300, seed=2)).hit_record(view)
    _origin, directions = view.rays()
    valid = hit.valid
    for normals in (hit.geo_normal_world, hit.points.shading_normal_world):
        np.testing.assert_allclose(np.linalg.norm(normals[valid], axis=-1), 1, atol=1e-6)
        assert not normals[~valid].any()
    assert ((hit.geo_normal_world * directions)[valid].sum(-1) <= 1e-6).all()
    assert ((hit.geo_normal_world * hit.points.shading_normal_world)[valid].sum(-1) >= -1e-6).all()


def test_item_counts_are_the_item_buffers_pixels(variant: str) -> None:
    caster = Caster(soup(200, seed=3), variant=variant)
    views = [camera(37, 29, eye=(0, 0, z)) for z in (-1.0, 1.0, 4.0)] + [camera(16, 16)]
    counts = caster.item_counts(views)
    assert counts.shape == (4, 201)
    assert counts.dtype == np.uint32
    for row, view in zip(counts, views, strict=True):
        expected = np.bincount(caster.item_buffer(view).ravel(), minlength=201)
        assert np.abs(row.astype(int) - expected).sum() <= 2  # rays through an edge


def test_small_pictures_of_many_lenses_are_the_hit_records_depth_and_items(
    variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    caster = Caster(soup(200, seed=3), variant=variant)
    monkeypatch.setattr("pbrs_farm.raycast.tracer.RAYS_PER_LAUNCH", 1500)
    views = [camera(37, 29, eye=(0, 0, z)) for z in (-1.0, 1.0, 4.0)]
    views[1] = replace(views[1], intrinsics=views[1].intrinsics.zoomed(1.2))
    fisheye = replace(
        views[0], intrinsics=replace(views[0].intrinsics, lens=Lens("fisheye", (0.0,) * 4, 0.3))
    )
    for cameras in (views, [*views, fisheye]):
        depth, items = caster.item_pictures(cameras)
        for k, view in enumerate(cameras):
            hit = caster.hit_record(view)
            same = items[k] == hit.item
            assert (~same).sum() <= 2  # rays through an edge
            if view is not fisheye:
                np.testing.assert_allclose(depth[k][same], hit.depth_z[same], rtol=1e-4)


def test_counts_do_not_depend_on_how_cameras_are_batched(monkeypatch: pytest.MonkeyPatch) -> None:
    caster = Caster(soup(50, seed=4))
    views = [camera(20, 15, eye=(0, 0, 0.3 * k)) for k in range(9)]
    whole = caster.item_counts(views)
    monkeypatch.setattr("pbrs_farm.raycast.tracer.RAYS_PER_LAUNCH", 700)
    np.testing.assert_array_equal(caster.item_counts(views), whole)


def test_rays_see_behind_skipped_faces() -> None:
    g = geometry(np.concatenate([wall(-1), wall(-3)]), np.array([1, 1, 2, 2]))
    caster = Caster(g)
    pane = np.array([True, True, False, False])
    assert (caster.hit_record(camera()).item == 1).all()
    behind = caster.hit_record(camera(), skip_faces=pane)
    assert (behind.item == 2).all()
    assert (behind.face >= 2).all()
    assert not caster.hit_record(camera(), skip_faces=np.ones(4, np.bool_)).valid.any()
    assert (caster.hit_record(camera()).item == 1).all()


def test_first_hit_stops_at_the_largest_distance(variant: str) -> None:
    caster = Caster(geometry(wall(-2)), variant=variant)
    origins = np.zeros((3, 3))
    directions = np.array([[0, 0, -1.0], [0, 0, 1.0], [0, 0, -2.0]])
    distance, face = caster.first_hit(origins, directions)
    np.testing.assert_allclose(distance, [2, np.inf, 1], rtol=1e-6)
    assert face[1] == -1
    assert (face[[0, 2]] >= 0).all()
    distance, face = caster.first_hit(origins, directions, np.array([1.9, 9, 1.1]))
    np.testing.assert_allclose(distance, [np.inf, np.inf, 1], rtol=1e-6)
    assert face[0] == -1


def test_without_faces_every_ray_hits_nothing(variant: str) -> None:
    caster = Caster(geometry(np.zeros((0, 3, 3))), variant=variant)
    hit = caster.hit_record(camera(8, 6))
    assert not hit.valid.any()
    assert not hit.item.any()
    np.testing.assert_array_equal(caster.item_counts([camera(8, 6)]), [[48]])
    assert not caster.item_buffer(camera(8, 6)).any()
    distance, _face = caster.first_hit(np.zeros((1, 3)), np.array([[0, 0, -1.0]]))
    assert np.isinf(distance).all()


def test_degenerate_and_non_finite_triangles_are_never_hit(variant: str) -> None:
    line = np.array([[[-1, 0, -1], [1, 0, -1], [3, 0, -1]]])
    broken = np.array([[[np.nan, 0, -1], [1, 0, -1], [0, 1, -1]], [[np.inf] * 3] * 3])
    g = geometry(np.concatenate([line, broken, wall(-2)]))
    hit = Caster(g, variant=variant).hit_record(camera(31, 31))
    assert set(np.unique(hit.face)) == {3, 4}
    np.testing.assert_allclose(hit.depth_z, 2, rtol=1e-6)
    assert np.isfinite(hit.geo_normal_world).all()


def test_depth_stays_within_the_triangle_even_if_its_plane_leaves_it() -> None:
    edge_on = np.array([[[-1, 1e-6, -1], [1, 1e-6, -1], [0, -1e-6, -3]]])
    view = camera(20, 21)
    claimed = np.zeros((21, 20), np.int32)
    hit = hit_record_from_faces(geometry(edge_on), view, claimed)
    assert hit.depth_z.min() >= 1 - 1e-6
    assert hit.depth_z.max() <= 3 + 1e-6
    assert np.isfinite(hit.geo_normal_world).all()


def test_skip_faces_of_another_length_is_refused() -> None:
    caster = Caster(geometry(wall(-2)))
    with pytest.raises(ValueError, match="skip_faces"):
        caster.hit_record(camera(), skip_faces=np.zeros(5, np.bool_))
