"""The preset `photo`: preferences of its score, and no two similar views."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.house import House, ItemKind, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.sample import photo_sampler
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.camera_source import Sampling
from pbrs_farm.sample.eye_probes import EnclosureLimits, enclosure_limits
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.photo_choice import MOST_WORSE
from pbrs_farm.sample.photo_sampler import PhotoSampler
from pbrs_farm.sample.photo_score import (
    FOREGROUND,
    PhotoShares,
    cut_shares,
    foreground_cost,
    framing_cost,
    furniture_points,
    item_roles,
    photo_score,
    photo_shares,
)
from pbrs_farm.sample.view_overlap import DEPTH_SIZE, overlap, shared_part
from tests.sample.sampled_rooms import box, furnished, room_house, shell

FIELDS: CameraFields = recipe_from_name("fast").cameras.model_copy(
    update={
        "score_width_px": 80, "score_height_px": 60, "coarse_width_px": 40, "coarse_height_px": 30,
        "cell_m": 0.5,
    }
)  # fmt: skip


def sampled(house: House, **fields: object) -> Sampling:
    caster = Caster(geometry_from_house(house))
    changed = FIELDS.model_copy(update=fields)
    return sample_cameras(house, changed, 0, caster.item_counts, caster.item_pictures)


def with_classes(house: House) -> House:
    """The furnished room with the classes of its items' names."""
    nyu40 = {"table": 7, "chair": 5, "cupboard": 3, "bed": 4, "wardrobe": 3}
    kinds = {ItemKind.WALL: 1, ItemKind.FLOOR: 2, ItemKind.CEILING: 22}
    return house.with_items(
        [replace(i, nyu40=nyu40.get(i.name, kinds.get(i.kind, 0))) for i in house.items]
    )


def shares(**changes: float) -> PhotoShares:
    """A good view of one room with some shares changed."""
    plain = {
        "furniture": 0.4, "opening": 0.05, "largest": 0.2, "wall": 0.3, "floor": 0.1,
        "n_objects": 5, "n_classes": 6, "median_m": 2.5, "cut": 0.0, "close_cut": 0.0,
    }  # fmt: skip
    columns = {k: np.array([v]) for k, v in (plain | changes).items()}
    near = np.zeros((1, len(FOREGROUND)))
    return PhotoShares(**columns, foreground=near, nyu13=np.zeros((1, 14)))


@pytest.mark.parametrize(
    "worse",
    [
        {"opening": 0.4}, {"largest": 0.6}, {"wall": 0.8}, {"floor": 0.0}, {"furniture": 0.1},
        {"n_objects": 2}, {"n_classes": 3}, {"median_m": 0.8}, {"median_m": 6.0},
    ],
)  # fmt: skip
def test_a_view_is_worth_less(worse: dict[str, float]) -> None:
    assert photo_score(shares(**worse))[0] < photo_score(shares())[0]


def test_steep_and_close_views_cost_if_likeness_counts() -> None:
    def cost(tilt_deg: float = 10.0, **changes: float) -> float:
        return float(framing_cost(shares(**changes), np.array([tilt_deg]))[0])

    assert cost() == 0
    assert cost(tilt_deg=16.0) == pytest.approx(0.2)
    assert cost(opening=0.16) == pytest.approx(0.15)
    assert cost(median_m=1.4) == pytest.approx(0.4)


def test_objects_before_the_lens_cost_more_the_nearer_they_are() -> None:
    house = room_house([box((0, 0, 0), (1, 1, 1)), *shell(3, 3)], 3, 3)
    counts = np.ones((5, len(house.items) + 1), np.uint32)
    # A hundred pixels each: ten of them far, at 1 m, at 0.7 m, at 0.5 m, and all but one at 0.5 m.
    depth = np.full((5, 100), 3.0, np.float32)
    depth[1, :10], depth[2, :10], depth[3, :10], depth[4, :99] = 1.0, 0.7, 0.5, 0.5
    cost = foreground_cost(photo_shares(counts, depth, item_roles(house), 0.01))
    assert cost[:2].tolist() == [0, 0]
    assert (np.diff(cost[1:]) > 0.1).all()


def test_a_close_item_that_the_edge_cuts_costs_by_its_share_of_the_picture() -> None:
    house = room_house([box((0, 0, 0), (1, 1, 1)), *shell(3, 3)], 3, 3)
    roles, points = item_roles(house), furniture_points(house)
    wall = 1 + next(k for k, i in enumerate(house.items) if i.kind is ItemKind.WALL)
    # Four pictures of a box: at the edge and close, at the edge and far, in the middle and close, and a
    # close wall in its place. The whole box is inside each.
    camera = Camera.look(
        Intrinsics.from_hfov(10, 10, 1.0), np.array((0, 0.5, 4)), np.array((0.0, 0, -1))
    )
    items, depth = np.zeros((4, 10, 10), np.uint32), np.full((4, 10, 10), 3.0, np.float32)
    items[:2, :5, :4], items[2, 3:7, 3:8], items[3, :5, :4] = 1, 1, wall
    depth[0, 4, 3], depth[2, 3:7, 3:8], depth[3, :5, :4] = 0.9, 0.9, 0.9
    cut, close_cut = cut_shares([camera] * 4, depth, items, roles, points)
    assert close_cut.tolist() == [0.2, 0, 0, 0]
    assert cut.tolist() == [0, 0, 0, 0]
    assert photo_score(shares(close_cut=0.2))[0] < photo_score(shares())[0] - MOST_WORSE
    assert photo_score(shares(close_cut=0.05))[0] == photo_score(shares())[0]
    empty, close_empty = cut_shares([], depth[:0], items[:0], roles, points)
    assert empty.shape == close_empty.shape == (0,)


def test_furniture_costs_by_its_part_outside_the_picture_at_any_distance() -> None:
    house = room_house([box((4, 0, 0), (5, 1, 1)), *shell(9, 9)], 9, 9)
    lens = Intrinsics.from_hfov(40, 30, 1.0)
    # From 3 m: the box in the middle, a fifth of it outside, half of it, nearly all.
    xs = (4.5, 5.7, 6.13, 6.7)
    cameras = [Camera.look(lens, np.array((x, 0.5, 3.5)), np.array((0.0, 0, -1))) for x in xs]
    depth, items = Caster(geometry_from_house(house)).item_pictures(cameras)
    cut, close_cut = cut_shares(cameras, depth, items, item_roles(house), furniture_points(house))
    assert (close_cut == 0).all()
    assert cut[:2].tolist() == [0, 0]
    assert 0.2 < cut[2] / (items[2] == 1).mean() < 0.45
    assert cut[3] / (items[3] == 1).mean() > 0.7
    assert foreground_cost(shares(cut=0.2))[0] > MOST_WORSE
    assert foreground_cost(shares(cut=0.03))[0] == 0


def test_doors_curtains_and_built_in_parts_are_no_furniture() -> None:
    names = {"door": 8, "window": 9, "curtain": 16, "blinds": 13, "pillar": 38, "sofa": 6}
    items = [replace(box((0, 0, 0), (1, 1, 1), name=n), nyu40=c) for n, c in names.items()]
    roles = item_roles(room_house([*items, *shell(3, 3)], 3, 3))
    assert np.flatnonzero(roles.furniture).tolist() == [6]
    assert np.flatnonzero(roles.opening).tolist() == [1, 2]


def test_shares_are_those_of_the_pixels() -> None:
    house = room_house([replace(box((0, 0, 0), (1, 1, 1)), nyu40=5), *shell(3, 3)], 3, 3)
    counts = np.zeros((1, len(house.items) + 1), np.uint32)
    counts[0, :5] = 10, 30, 20, 0, 40  # nothing, chair, floor, ceiling, a wall
    depth = np.array([[0, 1, 2, 3]], np.float32)
    rows = photo_shares(counts, depth, item_roles(house), 0.01)
    assert (rows.furniture[0], rows.floor[0], rows.wall[0]) == (0.3, 0.2, 0.4)
    assert (rows.n_objects[0], rows.n_classes[0], rows.median_m[0]) == (1, 1, 2.0)
    assert rows.nyu13[0, NYU13_NAMES.index("chair")] == 0.3
    assert rows.nyu13[0].sum() == pytest.approx(1)
    assert photo_shares(counts, depth / 2, item_roles(house), 0.01).foreground[0].max() == 0.25
    # Without a candidate there are no shares, and no warning (warnings are errors here).
    none = photo_shares(counts[:0], np.zeros((0, 0), np.float32), item_roles(house), 0.01)
    assert none.foreground.shape[0] == 0


def test_a_view_shares_all_with_itself_and_nothing_with_its_back() -> None:
    house = furnished()
    caster = Caster(geometry_from_house(house))
    intrinsics = Intrinsics.from_hfov(*DEPTH_SIZE)
    eye = np.array([2.0, 1.5, 2.5])
    ahead, back, near = (
        Camera.look(intrinsics, camera, np.array(to))
        for camera, to in (
            (eye, (0.0, -0.2, 1.0)),
            (eye, (0.0, -0.2, -1.0)),
            (eye + np.array([0, -0.1, 0.5]), (0.0, -0.2, 1.0)),
        )
    )
    a, b, c = caster.depth_pictures([ahead, back, near])
    assert overlap(ahead, a, ahead, a) == 1.0
    assert overlap(ahead, a, back, b) < 0.02
    assert shared_part(near, c, ahead, a) > 0.85 > shared_part(ahead, a, near, c)


def test_a_point_behind_an_obstacle_is_not_shared() -> None:
    intrinsics = Intrinsics.from_hfov(*DEPTH_SIZE)
    camera = Camera.look(intrinsics, np.zeros(3), np.array([0.0, 0.0, -1.0]))
    far, near = (np.full(DEPTH_SIZE[::-1], z, np.float32) for z in (4.0, 2.0))
    assert shared_part(camera, far, camera, near) == 0.0
    assert shared_part(camera, np.zeros_like(far), camera, near) == 0.0


def test_depth_pictures_are_the_hit_records_depth() -> None:
    house = furnished()
    caster = Caster(geometry_from_house(house))
    camera = sampled(with_classes(house)).views[0].camera.with_size(*DEPTH_SIZE)
    assert np.allclose(caster.depth_pictures([camera])[0], caster.hit_record(camera).depth_z)


def test_views_of_a_furnished_room_show_furniture_and_no_two_the_same() -> None:
    house = with_classes(furnished(4.0, 5.0))
    sampling = sampled(house)
    assert len(sampling.views) >= 2
    caster = Caster(geometry_from_house(house))
    cameras = [view.camera.with_size(*DEPTH_SIZE) for view in sampling.views]
    depth = caster.depth_pictures(cameras)
    for i in range(len(cameras)):
        for j in range(i):
            assert overlap(cameras[i], depth[i], cameras[j], depth[j]) <= 0.8
    for view in sampling.views:
        assert view.score >= FIELDS.min_room_score
        assert sum(view.objects.values()) > 0.1 * 80 * 60


def test_views_of_one_spot_count_once_across_rooms() -> None:
    house = with_classes(furnished())
    caster = Caster(geometry_from_house(house))
    sampler = PhotoSampler(
        house, FIELDS, 0, caster.item_counts, caster.item_pictures, geometry_from_house(house)
    )
    candidates = sampler.room_candidates(house.rooms[0])
    twin = replace(
        candidates, room=replace(candidates.room, id="0_1"), verdict=candidates.verdict.copy()
    )
    chosen = sampler.choose([candidates, twin])
    assert any(chosen.values())
    for sector in range(FIELDS.n_sectors):
        doubled = set(chosen.get(("0_0", sector), [])) & set(chosen.get(("0_1", sector), []))
        assert not doubled
    assert (twin.verdict == Verdict.NEAR_DUPLICATE).any()


def test_an_empty_room_has_one_view_and_the_others_are_weak() -> None:
    sampling = sampled(room_house(shell(4, 4), 4, 4), min_room_score=0.05)
    assert len(sampling.views) == 1
    assert sampling.report.refused["below_min_score"] > 0
    assert not sampled(room_house(shell(4, 4), 4, 4), min_room_score=0.5).views


def test_a_view_must_show_the_recipes_number_of_objects() -> None:
    report = sampled(room_house(shell(4, 4), 4, 4), min_objects=1).report
    assert report.n_views == 0
    assert all("few objects" in s.reason for s in report.rooms[0].sectors)


def test_focal_lengths_take_five_values_about_the_fields() -> None:
    views = sampled(with_classes(furnished(6, 6)), per_sector=4, min_score=0.0).views
    plain = Intrinsics.from_hfov(80, 60, FIELDS.hfov_rad).fx
    assert {round(v.camera.intrinsics.fx / plain, 3) for v in views} <= {0.9, 0.95, 1, 1.05, 1.1}
    assert len({v.camera.intrinsics.fx for v in views}) > 1


def test_few_candidates_are_looked_at_in_small_pictures_and_the_best_are_among_them() -> None:
    house = with_classes(furnished(5.0, 6.0))
    geometry = geometry_from_house(house)
    caster, n_looks = Caster(geometry), Counter[tuple[int, int]]()
    fields = FIELDS.model_copy(
        update={"coarse_width_px": 160, "coarse_height_px": 120, "cell_m": 0.25}
    )

    def looked_at(cameras: Sequence[Camera]) -> tuple[F32, NDArray[np.uint32]]:
        i = cameras[0].intrinsics
        n_looks[i.width_px, i.height_px] += len(cameras)
        return caster.item_pictures(cameras)

    sampler = PhotoSampler(house, fields, 0, caster.item_counts, looked_at, geometry)
    tiny = [sampler.room_candidates(house.rooms[0])]
    few = sampler.with_better_scores(tiny)
    assert 0 < 4 * n_looks[96, 72] < n_looks[24, 18]
    # Compare with the choice among all candidates, each rendered as a small picture.
    left_over = np.flatnonzero(np.isfinite(tiny[0].score))
    scored = sampler.scored_from_pictures(tiny[0], left_over, (96, 72))
    by_all, by_few = sampler.choose([scored]), sampler.choose(few)
    score = scored.score
    assert sum(map(len, by_few.values())) == sum(map(len, by_all.values())) > 2
    best = sum(score[k].sum() for k in by_all.values())
    assert sum(score[k].sum() for k in by_few.values()) >= 0.98 * best
    numbers = [number for some in by_few.values() for number in some]
    assert (few[0].score[numbers] == score[numbers]).all()


def test_items_around_an_eye_are_found_once_for_all_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    house, homes_asked = furnished(), list[House]()

    def counted(of: House) -> EnclosureLimits:
        homes_asked.append(of)
        return enclosure_limits(of)

    monkeypatch.setattr(photo_sampler, "enclosure_limits", counted)
    geometry = geometry_from_house(house)
    caster = Caster(geometry)
    sampler = PhotoSampler(house, FIELDS, 0, caster.item_counts, caster.item_pictures, geometry)
    for _ in range(2):
        assert (sampler.room_candidates(house.rooms[0]).verdict == Verdict.NEAR_OBSTACLE).any()
    assert homes_asked == [house]


def test_the_same_house_and_seed_give_the_same_views() -> None:
    house = with_classes(furnished())
    a, b = sampled(house).views, sampled(house).views
    assert [v.id for v in a] == [v.id for v in b]
    assert all(
        (x.camera.world_from_camera == y.camera.world_from_camera).all() for x, y in zip(a, b)
    )
