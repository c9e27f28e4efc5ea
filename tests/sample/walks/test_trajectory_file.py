"""A user's trajectory: read as TUM writes it, and rejected with file, row and reason."""

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.sample.walks.trajectory_file import poses_from_tum, trajectory_views
from tests.sample.sampled_rooms import room_house, shell

ALONG_Z = "1 0 0 0"  # a half turn about x: y down, looking along -z


def test_a_row_is_a_time_and_a_pose_of_opencv_axes() -> None:
    (pose,) = poses_from_tum(f"# t x y z q\n\n0.5 1 1.5 2 {ALONG_Z}\n", "a.txt")
    assert (pose.line, pose.time_s) == (3, 0.5)
    expected = np.eye(4)
    expected[:3, 3] = 1, 1.5, 2
    np.testing.assert_allclose(pose.world_from_camera, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("1 2 3", "expected 8 numbers, got 3"),
        ("1 1 1.5 2 1 0 0 zero", "expected numbers"),
        ("1 1 nan 2 1 0 0 0", "y is not finite"),
        ("1 1 1.5 2 0 0 0 0", "no rotation: its length is 0"),
        ("1 1 1.5 2 1 1 0 0", "no rotation: its length is 1.414"),
        ("0.5 1 1.5 2 1 0 0 0", "is not after 0.5"),
        ("0.25 1 1.5 2 1 0 0 0", "is not after 0.5"),
    ],
)
def test_a_row_that_is_no_pose_is_rejected_with_its_line(row: str, reason: str) -> None:
    with pytest.raises(BadInput, match=reason) as caught:
        poses_from_tum(f"0.5 1 1.5 2 {ALONG_Z}\n{row}\n", "way.txt")
    assert "way.txt: line 2" in str(caught.value)


def test_a_file_without_a_row_is_rejected() -> None:
    with pytest.raises(BadInput, match="holds no row"):
        poses_from_tum("# nothing\n", "way.txt")


def test_an_eye_inside_a_wall_is_told_with_its_row_and_one_in_the_room_is_not() -> None:
    house = room_house(shell(3, 3, wall=0.3), 3, 3)
    geometry = geometry_from_house(house)
    cast = Caster(geometry).first_hit
    rows = f"0 1 1.5 2 {ALONG_Z}\n1 1.1 1.5 2 {ALONG_Z}\n"
    views = trajectory_views(house, poses_from_tum(rows, "w"), "w", CameraFields(), geometry, cast)
    assert [(v.id, v.room_id, v.time_s) for v in views] == [
        ("frame_00000", "0_0", 0.0),
        ("frame_00001", "0_0", 1.0),
    ]
    inside = poses_from_tum(f"{rows}2 -0.15 1.5 2 {ALONG_Z}\n", "w")
    with pytest.raises(BadInput, match=r"w: line 3: the camera at -0.15.*inside a wall"):
        trajectory_views(house, inside, "w", CameraFields(), geometry, cast)
