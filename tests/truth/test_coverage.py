from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.cutouts import CutOut
from pbrs_farm.core.house import Item, ItemKind, Material, Surface, geometry_from_house
from pbrs_farm.raycast.caster import Caster
from tests.truth.hits import camera, house


def by_rays(points: np.ndarray, faces: np.ndarray, view: Camera) -> np.ndarray:
    """Coverage by testing every ray against every triangle."""
    origin, directions = view.rays()
    origin, d = origin.astype(float), directions.reshape(-1, 3).astype(float)
    hit = np.zeros(len(d), bool)
    for face in faces:
        a, b, c = points[face].astype(float)
        p = np.cross(d, c - a)
        det = p @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = p @ (origin - a) / det
            q = np.cross(origin - a, b - a)
            v, t = d @ q / det, q @ (c - a) / det
            hit |= (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return hit.reshape(directions.shape[:2])


@pytest.mark.parametrize("seed", range(8))
def test_coverage_equals_ray_hits_near_far_and_across_the_eye(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 2, (30, 3)).astype(np.float32)
    faces = rng.integers(0, 30, (6, 3)).astype(np.int32)
    item = Item("x", "x", ItemKind.OBJECT, "0", (Surface("s", points, faces, 0),))
    view = Camera.look(
        Intrinsics(41, 33, 25.0, 30.0, 19.0, 17.5),
        np.array([0.1, 0.2, 1.0]),
        np.array([0.3, -0.2, -1.0]),
    )
    assert (truth.coverage(item, view) == by_rays(points, faces, view)).mean() > 0.998


def test_visible_fraction_is_the_share_that_is_not_hidden():
    # The square is 4 pixels wide (0.5 m of half width at 2 m, 8 pixels for 4 m) and half hidden.
    scene = house(5, z=-2.0, half=1.0)
    assert truth.coverage(scene.items[0], camera()).sum() == 16
    ids = np.zeros((6, 8), np.uint32)
    ids[1:5, 2:4] = 1
    row = truth.view_table(ids, scene, camera())["instances"][0]
    assert row["visible_fraction"] == pytest.approx(0.5)


def test_an_item_without_faces_covers_nothing():
    empty = Surface("s", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), 0)
    for surfaces in ((), (empty,)):
        assert not truth.coverage(Item("x", "x", ItemKind.OBJECT, "0", surfaces), camera()).any()


def test_a_triangle_with_nan_is_left_out():
    points = np.array([[0, 0, -1], [1, 0, -1], [np.nan, 1, -1]], np.float32)
    surface = Surface("s", points, np.array([[0, 1, 2]], np.int32), 0)
    assert not truth.coverage(Item("x", "x", ItemKind.OBJECT, "0", (surface,)), camera()).any()


def leaf(cutoff: float = 0.5) -> tuple[Item, dict[int, CutOut]]:
    """A slanted square before the camera whose left half is a hole in its picture."""
    points = np.array([[-1, -1, -2], [1, -1, -3], [1, 1, -3], [-1, 1, -2]], np.float32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    surface = Surface("s", points, np.array([[0, 1, 2], [0, 2, 3]], np.int32), 3, uvs)
    alpha = np.full((4, 16, 1), 200, np.uint8)
    alpha[:, :8] = 90
    return Item("x", "x", ItemKind.OBJECT, "0", (surface,)), {3: CutOut(alpha, cutoff)}


def test_an_item_covers_nothing_in_its_holes():
    view = Camera.look(Intrinsics.from_hfov(160, 120), np.zeros(3), np.array([0, 0, -1.0]))
    item, holes = leaf()
    whole, visible = truth.coverage(item, view), truth.coverage(item, view, holes)
    # The left half of the square is the hole, except for half a texel at the edge, because the
    # picture repeats.
    edge = int(np.flatnonzero(whole.any(0))[0])
    assert edge < 20
    assert not visible[:, edge + 8 : 79].any()
    assert np.array_equal(visible[:, 82:140], whole[:, 82:140])
    assert np.array_equal(truth.coverage(item, view, leaf(0.2)[1]), whole)
    assert not truth.coverage(item, view, leaf(0.9)[1]).any()
    assert np.array_equal(truth.coverage(item, view, {7: holes[3]}), whole)


def test_coverage_of_a_single_item_equals_the_hits_of_its_rays():
    view = Camera.look(Intrinsics.from_hfov(160, 120), np.zeros(3), np.array([0.1, 0.05, -1.0]))
    item, holes = leaf()
    home = replace(house(), items=(item,), materials=(Material("m"),) * 4)
    caster = Caster(geometry_from_house(home), cut_outs=holes)
    assert np.array_equal(truth.coverage(item, view, holes), caster.item_buffer(view) == 1)
    row = truth.view_table(caster.item_buffer(view), home, view, cut_outs=holes)["instances"][0]
    assert row["visible_fraction"] == 1.0
