"""The paper's rules (section 3.1), held by every winner and recomputed from the geometry."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import ItemKind
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.eye_probes import enclosed
from pbrs_farm.sample.house_sampler import sample_cameras
from tests.hypothesis_profiles import examples
from tests.inputs.camera_rules import assert_rules
from tests.sample.sampled_rooms import QUICK, box, counter_of, furnished, room_house, shell


def test_winners_of_the_builtin_home_keep_every_rule() -> None:
    assert assert_rules(builtin_home(), QUICK, 0) >= 8


@settings(max_examples=examples(6), deadline=None, suppress_health_check=list(HealthCheck))
@given(width=st.floats(2.5, 6), depth=st.floats(4, 6), seed=st.integers(0, 2**32 - 1))
def test_winners_of_any_furnished_room_keep_every_rule(
    width: float, depth: float, seed: int
) -> None:
    assert_rules(furnished(width, depth), QUICK, seed)


def test_no_candidate_inside_a_wardrobe_is_kept() -> None:
    house = furnished()
    sampling = sample_cameras(house, QUICK, 3, counter_of(house))
    trace = sampling.traces[0]
    low, high = house.items[-1].bounds
    inside = ((trace.candidates.eye > low) & (trace.candidates.eye < high)).all(1)
    assert inside.sum() > 10
    refused = {Verdict(v) for v in np.unique(trace.verdict[inside])}
    assert refused <= {Verdict.ENCLOSED, Verdict.NEAR_OBSTACLE}
    assert Verdict.ENCLOSED in refused


def test_only_eyes_that_a_box_holds_are_looked_around_from() -> None:
    house = furnished()
    count, wardrobe = counter_of(house), house.items[-1].bounds.mean(0)
    n_boxes: list[int] = []

    def watched(cameras: Sequence[Camera]) -> NDArray[np.uint32]:
        n_boxes.append(len(cameras))
        return count(cameras)

    free = np.array([[1.0, 1.5, 1.0], [1.5, 1.5, 1.0]])
    eyes = np.concatenate([free[:1], wardrobe[None], free[1:]])
    assert enclosed(house, eyes, watched).tolist() == [False, True, False]
    assert n_boxes == [6]  # the faces of one cube


def test_no_candidate_inside_a_thick_wall_that_the_room_overlaps_is_kept() -> None:
    thick = box((1.5, 0, 0), (2.1, 2.5, 3), ItemKind.WALL, "thick wall")
    house = room_house([*shell(4, 3), thick], 4, 3)
    trace = sample_cameras(house, QUICK, 0, counter_of(house)).traces[0]
    x = trace.candidates.eye[:, 0]
    verdicts = set(trace.verdict[(x > 1.5) & (x < 2.1)].tolist())
    assert verdicts <= {Verdict.ENCLOSED, Verdict.NEAR_OBSTACLE, Verdict.NOT_ABOVE_FLOOR}


def test_no_candidate_above_a_low_ceiling_is_kept() -> None:
    items = [i for i in shell(4, 3) if i.kind is not ItemKind.CEILING]
    items.append(box((0, 1.2, 0), (4, 1.25, 3), ItemKind.CEILING, "low ceiling"))
    house = room_house(items, 4, 3, 1.2)
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    assert not sampling.views
    place = sampling.report.refused
    assert place["not_above_floor"] > 100
    assert "few_objects" not in place


def test_a_view_of_two_objects_is_refused_and_of_three_is_kept() -> None:
    def views(n: int) -> int:
        pieces = [box((3.5, 0, 0.3 + k), (3.9, 1.2, 0.8 + k), name=f"b{k}") for k in range(n)]
        house = room_house([*shell(4, 4), *pieces], 4, 4)
        sampling = sample_cameras(house, QUICK, 0, counter_of(house))
        assert sampling.report.refused["few_objects"] > 0
        return len(sampling.views)

    assert views(2) == 0
    assert views(3) >= 1


def test_an_unlit_room_gets_no_camera_with_a_reason() -> None:
    house = room_house(furnished().items, 4, 5, lit_by=())
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    assert not sampling.views
    assert "lights" in sampling.report.rooms[0].reason


@pytest.mark.parametrize("corners", [0, 2, 4])
def test_a_room_without_area_gets_no_camera_with_a_reason(corners: int) -> None:
    flat = np.stack([np.linspace(0, 3, corners), np.zeros(corners)], axis=1)
    house = room_house(furnished().items, 4, 5, polygon=flat)
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    assert not sampling.views
    assert "area" in sampling.report.rooms[0].reason


def test_an_empty_room_names_the_rule_that_refused_its_candidates() -> None:
    house = room_house(shell(4, 3), 4, 3)
    report = sample_cameras(house, QUICK, 0, counter_of(house)).report
    assert report.n_views == 0
    for sector in report.rooms[0].sectors:
        assert "few objects" in sector.reason
        assert sector.winner_score is None


def test_every_candidate_is_counted_once() -> None:
    house = furnished()
    report = sample_cameras(house, QUICK, 0, counter_of(house)).report
    for sector in report.rooms[0].sectors:
        assert sector.n_candidates == 8 * 10
        assert sum(sector.refused.values()) + sector.n_kept == sector.n_candidates


def test_the_other_rooms_do_not_change_a_rooms_views() -> None:
    house = builtin_home()
    together = sample_cameras(house, QUICK, 0, counter_of(house)).views
    alone = replace(house, rooms=house.rooms[1:])
    views = sample_cameras(alone, QUICK, 0, counter_of(alone)).views
    of_room = [v for v in together if v.room_id == "0_1"]
    assert [v.id for v in views] == [v.id for v in of_room]
    for a, b in zip(views, of_room, strict=True):
        np.testing.assert_array_equal(a.camera.world_from_camera, b.camera.world_from_camera)


def test_another_seed_gives_other_viewpoints() -> None:
    house = furnished()
    first = sample_cameras(house, QUICK, 0, counter_of(house)).traces[0].candidates
    second = sample_cameras(house, QUICK, 1, counter_of(house)).traces[0].candidates
    assert (first.eye != second.eye).all(1).all()
