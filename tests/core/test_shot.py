"""Ids of views: built ids are parsed again, partners differ in one part, and seeds are shared by definition."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, Intrinsics, RigPlace, View
from pbrs_farm.core.shot import Shot, room_of_id, view_id

EYES = ("", "right", "far_right", "top-2")
SHOTS = st.one_of(
    st.builds(Shot.of_frame, st.integers(0, 200_000), st.sampled_from(EYES)),
    st.builds(Shot, st.builds(view_id, st.sampled_from(["0_1", "out"]), st.integers(0, 5)),
              st.none(), st.sampled_from(EYES)),
)  # fmt: skip


@given(SHOTS)
def test_an_id_is_parsed_into_its_shot(shot: Shot) -> None:
    assert Shot.of_id(shot.id, EYES) == shot
    rig = {"instant": shot.first.id, "camera": shot.eye or "left"}
    assert Shot.of_row(shot.id, {"rig": rig}) == shot


def test_ids_have_their_stored_form() -> None:
    assert Shot("0_1_2", eye="right").id == "0_1_2_right"
    assert Shot.of_frame(12).id == "frame_00012"
    assert Shot.of_frame(12, "top").id == "frame_00012_top"
    assert Shot.of_frame(12, "top").partner(1).id == "frame_00013_top"
    assert Shot.of_frame(12, "top").partner(-1, eye="").id == "frame_00011"


def test_without_the_names_of_its_rig_an_ending_belongs_to_the_take() -> None:
    assert Shot.of_id("0_1_2_right") == Shot("0_1_2_right")
    assert Shot.of_row("0_1_2_right", {}) == Shot("0_1_2_right")


def test_a_view_knows_its_camera_of_the_rig() -> None:
    camera = Camera(Intrinsics.from_hfov(8, 6), np.eye(4))
    place = RigPlace("rig", "right", "0_1_2", None)  # type: ignore[arg-type]
    assert View("0_1_2_right", "0_1", 2, camera, rig=place).shot == Shot("0_1_2", eye="right")
    assert View("0_1_2", "0_1", 2, camera, rig=place).shot == Shot("0_1_2")


@pytest.mark.parametrize(
    ("per", "name"), [("view", "frame_00004_right"), ("eye", "clip_right"), ("take", "clip")]
)
def test_seeds_are_shared_by_the_frames_or_the_cameras_too(per: str, name: str) -> None:
    shot = Shot.of_frame(4, "right")
    assert shot.seed("h", "tone", 3, per=per) == keys.seed("h", name, "tone", 3)  # type: ignore[arg-type]


def test_the_room_of_a_view_that_has_no_file_is_the_longest_its_id_begins_with() -> None:
    assert room_of_id("0_1_2_right", ["0", "0_1", "1_1"]) == "0_1"
    assert room_of_id("0_1_2", []) == "0_1"
