"""A person's walk: through open doors, clear of obstacles, within speed and turn limits, reproducible."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, RepairFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair
from pbrs_farm.sample.camera_map import camera_map
from pbrs_farm.sample.camera_source import Sampling
from pbrs_farm.sample.clearance import near_any_triangle
from pbrs_farm.sample.walks.walk_sampler import sample_walk
from pbrs_farm.sample.walks.walk_space import shut_doors, walk_spaces
from tests.sample.sampled_rooms import box, room_house, shell

FIELDS = CameraFields(source="walk", walk_frames=400, walk_fps=20)


@pytest.fixture(scope="module")
def shut() -> House:
    return repair(builtin_home(), RepairFields())[0]


@pytest.fixture(scope="module")
def opened(shut: House) -> House:
    """The small home with the leaf of its inner door removed."""
    return shut.with_items(i for i in shut.items if i.id != "door_inner")


def walk_of(house: House, fields: CameraFields = FIELDS, seed: int = 3) -> Sampling:
    geometry = geometry_from_house(house)
    return sample_walk(house, fields, seed, geometry, Caster(geometry).first_hit)


@pytest.fixture(scope="module")
def walk(opened: House) -> Sampling:
    return walk_of(opened)


def poses(sampling: Sampling) -> np.ndarray:
    return np.stack([view.camera.world_from_camera for view in sampling.views])


def test_an_open_door_joins_two_rooms_and_a_shut_one_separates_them(
    opened: House, shut: House
) -> None:
    (space,), (parted,) = walk_spaces(opened), walk_spaces(shut)
    assert {d.name: d.is_open for d in space.doors}["opening_door_inner"]
    assert any("door_inner" in name for name in shut_doors(parted))
    assert set(space.room[space.region]) - {-1} == {0, 1}
    assert len(set(parted.room[parted.region]) - {-1}) == 1


def test_a_room_without_a_ceiling_is_walked_only_if_there_is_no_other(shut: House) -> None:
    living, bedroom = shut.rooms
    outdoors = replace(shut, rooms=(replace(living, has_ceiling=False), bedroom))
    (space,) = walk_spaces(outdoors)
    assert set(space.room[space.region]) - {-1} == {1}
    (space,) = walk_spaces(replace(outdoors, rooms=outdoors.rooms[:1]))
    assert set(space.room[space.region]) - {-1} == {0}


def test_the_walk_passes_the_open_door_and_lists_the_shut_ones(walk: Sampling) -> None:
    assert {view.room_id for view in walk.views} == {"0_0", "0_1"}
    assert "door_front" in " ".join(walk.report.notes)


def test_frames_are_numbered_and_timed(walk: Sampling) -> None:
    assert [view.frame for view in walk.views] == list(range(400))
    assert walk.views[10].time_s == pytest.approx(0.5)
    assert walk.views[10].id == "frame_00010"


def test_no_frame_is_faster_or_turns_more_than_it_may(walk: Sampling) -> None:
    pose = poses(walk)
    step = np.linalg.norm(np.diff(pose[:, :3, 3], axis=0), axis=1)
    assert step.max() <= FIELDS.walk_speed_mps / FIELDS.walk_fps + 1e-9
    relative = np.swapaxes(pose[:-1, :3, :3], 1, 2) @ pose[1:, :3, :3]
    cosine = (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    turned = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    assert turned.max() <= FIELDS.walk_turn_dps / FIELDS.walk_fps + 1e-6
    assert turned.sum() > 90  # it looks around
    assert step.sum() > 3


def test_a_shaken_walk_keeps_both_limits_and_shakes(opened: House, walk: Sampling) -> None:
    shaken = walk_of(opened, FIELDS.model_copy(update={"walk_shake": 1.0}))
    pose = poses(shaken)
    step = np.linalg.norm(np.diff(pose[:, :3, 3], axis=0), axis=1)
    assert step.max() <= FIELDS.walk_speed_mps / FIELDS.walk_fps + 1e-9
    height = pose[:, 1, 3]
    assert np.ptp(height) > 0.005 > np.ptp(poses(walk)[:, 1, 3])


def test_eyes_keep_ten_centimetres_from_everything_at_a_persons_height(
    opened: House, walk: Sampling
) -> None:
    eyes = poses(walk)[:, :3, 3]
    assert not near_any_triangle(eyes, geometry_from_house(opened), 0.10).any()
    assert ((eyes[:, 1] >= 1.5) & (eyes[:, 1] <= 1.6)).all()


def test_tilt_is_that_of_photographs_of_rooms(walk: Sampling) -> None:
    tilt = np.degrees(np.arcsin(poses(walk)[:, 1, 2]))
    assert 0 < np.median(tilt) < 16
    assert tilt.min() > -6
    assert tilt.max() < 24


def test_the_same_seed_walks_the_same_way_and_another_another(
    opened: House, walk: Sampling
) -> None:
    np.testing.assert_array_equal(poses(walk_of(opened)), poses(walk))
    assert not np.allclose(poses(walk_of(opened, seed=4)), poses(walk))


def test_a_full_room_has_no_walk_with_a_reason() -> None:
    full = room_house([*shell(3, 3), box((0.3, 0, 0.3), (2.7, 1, 2.7))], 3, 3)
    sampling = walk_of(full)
    assert sampling.views == ()
    assert "nowhere to walk" in sampling.report.why_none


def test_a_tiny_region_gives_all_frames_on_the_spot() -> None:
    # 0.9 m square: a person's centre has 0.3 m of freedom.
    sampling = walk_of(room_house(shell(0.95, 0.95), 0.95, 0.95))
    assert len(sampling.views) == 400


def test_a_hole_in_the_floor_is_not_walked_over() -> None:
    parts = [i for i in shell(4, 3) if "floor" not in i.name]
    parts += [
        box((-0.1, -0.1, -0.1), (1.5, 0, 3.1), parts[0].kind, "left"),
        box((2.5, -0.1, -0.1), (4.1, 0, 3.1), parts[0].kind, "right"),
    ]
    (space,) = walk_spaces(room_house(parts, 4, 3))
    xx, _zz = space.grid.middles
    assert not (space.region & (xx > 1.6) & (xx < 2.4)).any()


def test_the_map_draws_the_walk_as_one_line(opened: House, walk: Sampling) -> None:
    marks = camera_map(opened, walk).marks
    lines = [m for m in marks if m.shape == "line" and len(m.points) == 400]
    assert len(lines) == 1
    assert {"start", "end"} <= {m.text for m in marks}
    assert math.isfinite(lines[0].points[0][0])
