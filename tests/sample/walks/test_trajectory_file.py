"""A user's trajectory: read in TUM's format, and rejected with file, row and reason."""

import codecs
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.step_cache import camera_file_text
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
        ("1 0 0 2 0 -1 0 1.5 0 0 -1 3", "got 12.*KITTI"),
        ("1 1 1.5 2 1 0 0 zero", "expected numbers"),
        ("1 1 nan 2 1 0 0 0", "y is not finite"),
        ("1 1 1.5 2 0 0 0 0", "not a unit quaternion: its length is 0"),
        ("1 1 1.5 2 1 1 0 0", "not a unit quaternion: its length is 1.414"),
        ("0.5 1 1.5 2 1 0 0 0", "is not after 0.5"),
        ("0.25 1 1.5 2 1 0 0 0", "is not after 0.5"),
    ],
)
def test_a_row_that_is_no_pose_is_rejected_with_its_line(row: str, reason: str) -> None:
    with pytest.raises(BadInput, match=reason) as caught:
        poses_from_tum(f"0.5 1 1.5 2 {ALONG_Z}\n{row}\n", "way.txt")
    assert "way.txt: line 2" in str(caught.value)


def test_decreasing_stamps_are_shown_in_their_written_form() -> None:
    rows = f"1305031102.2091 1 1.5 2 {ALONG_Z}\n1305031102.2091 1 1.5 2 {ALONG_Z}\n"
    with pytest.raises(BadInput, match=r"time 1305031102\.2091 is not after 1305031102\.2091 of"):
        poses_from_tum(rows, "way.txt")


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        (("1305031102175800064", "1305031102209133312"), (1305031102.1758, 1305031102.209133312)),
        (("1305031102175800", "1305031102209133"), (1305031102.1758, 1305031102.209133)),
        (("1305031102175.8", "1305031102209"), (1305031102.1758, 1305031102.209)),
        (("1305031102.1758", "1305031102.2091"), (1305031102.1758, 1305031102.2091)),
        (("0", "9000"), (0.0, 9000.0)),
    ],
)
def test_the_size_of_stamps_since_1970_gives_their_unit(
    stamps: tuple[str, str], expected: tuple[float, float]
) -> None:
    poses = poses_from_tum("".join(f"{t} 1 1.5 2 {ALONG_Z}\n" for t in stamps), "way.txt")
    np.testing.assert_allclose([pose.time_s for pose in poses], expected, rtol=0, atol=3e-7)


def test_stamps_of_an_unknown_unit_are_refused() -> None:
    rows = "".join(f"{k * 33_333_333} 1 1.5 2 {ALONG_Z}\n" for k in range(3))
    with pytest.raises(BadInput, match=r"way\.txt: line 2: rows are 3\.33333e\+07 apart"):
        poses_from_tum(rows, "way.txt")


def test_a_row_that_names_the_columns_is_passed_over() -> None:
    rows = f"timestamp,tx,ty,tz,qx,qy,qz,qw\n0.5,1,1.5,2,{ALONG_Z.replace(' ', ',')}\n"
    (pose,) = poses_from_tum(rows, "way.csv")
    assert (pose.line, pose.time_s) == (2, 0.5)


def test_a_byte_order_mark_and_ends_of_lines_of_windows_change_nothing(tmp_path: Path) -> None:
    rows = f"0.5 1 1.5 2 {ALONG_Z}\n0.6 1 1.5 2 {ALONG_Z}\n"
    (tmp_path / "way.txt").write_bytes(codecs.BOM_UTF8 + rows.replace("\n", "\r\n").encode())
    fields = CameraFields(source="trajectory", file=str(tmp_path / "way.txt"))
    poses = poses_from_tum(camera_file_text(fields), fields.file)
    assert [pose.time_s for pose in poses] == [0.5, 0.6]


def test_a_file_without_a_row_is_rejected() -> None:
    with pytest.raises(BadInput, match="has no row"):
        poses_from_tum("# nothing\n", "way.txt")


def test_an_eye_inside_a_wall_is_refused_with_its_row() -> None:
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
