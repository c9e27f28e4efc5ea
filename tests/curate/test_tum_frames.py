"""Frames of the TUM RGB-D benchmark: pairing of pictures, and choice of frames."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import has_depth, pairs_in, photo_from_pair
from pbrs_farm.curate.tum_frames import camera_of_sequence, frames_of
from tests.curate.tum_sequence import write_sequence

SECONDS = 1305031102.0


def _taken(folder: Path) -> list[tuple[float, float]]:
    """Seconds after the first colour and depth of each frame, rounded to hundredths."""
    return [
        (round(float(rgb.stem) - SECONDS, 2), round(float(depth.stem) - SECONDS, 2))
        for rgb, depth in frames_of(folder)
    ]


def test_pairs_are_each_others_nearest_within_two_hundredths(tmp_path: Path) -> None:
    rgb = [SECONDS + s for s in (0, 2, 4, 6, 6.01)]
    depth = [SECONDS + s for s in (0.01, 2.03, 4.01, 3.99, 6.01)]
    # 2 and 2.03 are too far apart; of 6 and 6.01 only the latter has depth; 3.99 or 4.01 is 4's.
    times = _taken(write_sequence(tmp_path, rgb, depth))
    assert [time for time, _ in times] == [0, 4, 6.01]
    assert times[1][1] in (3.99, 4.01)


def test_a_frame_is_taken_after_the_camera_has_moved_or_turned(tmp_path: Path) -> None:
    rgb = [SECONDS + s / 10 for s in range(6)]
    half = math.radians(11) / 2
    turned = f"0 {math.sin(half)} 0 {math.cos(half)}"
    poses = [
        f"{rgb[0]} 0 0 0 0 0 0 1",
        f"{rgb[1]} 0.06 0 0 0 0 0 1",  # 6 cm: not yet
        f"{rgb[2]} 0.11 0 0 0 0 0 1",  # 11 cm from the first: taken
        f"{rgb[3]} 0.17 0 0 0 0 0 -1",  # the same rotation with the opposite sign, 6 cm away: not yet
        f"{rgb[4]} 0.17 0 0 {turned}",  # turned by 11 degrees: taken
        # Without a pose, and less than a second later: skipped.
    ]
    assert [time for time, _ in _taken(write_sequence(tmp_path, rgb, rgb, poses=poses))] == [0, 0.2, 0.4]  # fmt: skip


def test_without_poses_a_frame_a_second_is_taken(tmp_path: Path) -> None:
    rgb = [SECONDS + s / 4 for s in range(10)]
    assert [time for time, _ in _taken(write_sequence(tmp_path, rgb, rgb))] == [0, 1, 2]


def test_depth_is_in_units_of_a_fifth_of_a_millimetre(tmp_path: Path) -> None:
    times = [SECONDS, SECONDS + 2]
    sequence = write_sequence(tmp_path / "rgbd_dataset_freiburg2_desk", times, times, depth_m=1.5)
    assert has_depth(tmp_path)
    pairs = pairs_in(tmp_path)
    assert [pair.id for pair in pairs] == [f"{sequence.name}/{time:.6f}" for time in times]
    photo = photo_from_pair(pairs[0], depth_scale=None, sun_rgbd=False)
    assert photo.depth_mm[0, 0] == 1500
    # The user's units take precedence.
    assert photo_from_pair(pairs[0], depth_scale=1000, sun_rgbd=False).depth_mm[0, 0] == 7500


@pytest.mark.parametrize(
    ("name", "fx"),
    [("rgbd_dataset_freiburg1_desk", 517.3), ("fr2_xyz", 520.9), ("Freiburg3", 535.4), ("desk", None), ("fr12", None), ("zephyr1x", None)],
)  # fmt: skip
def test_the_sequences_name_gives_the_camera(tmp_path: Path, name: str, fx: float | None) -> None:
    K = camera_of_sequence(write_sequence(tmp_path / name, [0.0], [0.0]))
    assert (K and K[0]) == fx


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("rgb.txt", "1.0 rgb/none.png", "line 1: no such file rgb/none.png"),
        ("depth.txt", "# depth\n1.0", "line 2: expected `seconds file`"),
        ("rgb.txt", "# nothing", "lists no picture"),
        ("groundtruth.txt", "1.0 0 0 0 0 0 1", "line 1: expected `seconds tx ty tz"),
        ("groundtruth.txt", "1.0 0 0 0 0 0 0 0", "line 1: expected `seconds tx ty tz"),
    ],
)  # fmt: skip
def test_a_broken_list_is_named_with_its_line(
    tmp_path: Path, file: str, text: str, said: str
) -> None:
    write_sequence(tmp_path, [1.0], [1.0])
    (tmp_path / file).write_text(text)
    with pytest.raises(BadInput) as caught:
        frames_of(tmp_path)
    assert file in str(caught.value)
    assert said in str(caught.value)


def test_lists_of_other_times_are_no_pairs(tmp_path: Path) -> None:
    write_sequence(tmp_path, [1.0], [5.0])
    with pytest.raises(BadInput, match=r"depth\.txt.*no picture within 0\.02 s"):
        pairs_in(tmp_path)
