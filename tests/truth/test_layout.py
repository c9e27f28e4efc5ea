import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import Room

ROOM = Room("0_0", "box", "0", np.array([[-2.0, -4], [2, -4], [2, 1], [-2, 1]]), 0.0, 2.5)


def camera() -> Camera:
    intrinsics = Intrinsics.from_hfov(80, 60, np.pi / 2)
    return Camera.look(intrinsics, np.array([0, 1.25, 0.0]), np.array([0, 0, -1.0]))


def test_corners_project_to_their_pixels_and_those_behind_the_eye_to_none():
    rows = truth.layout_table(ROOM, camera(), np.full((60, 80), 10.0, np.float32))
    assert [(r["corner"], r["at"]) for r in rows[:2]] == [(0, "floor"), (1, "floor")]
    assert len(rows) == 8
    assert rows[0]["world"] == [-2.0, 0.0, -4.0]
    assert rows[0]["pixel"] == pytest.approx([40 - 20, 30 + 12.5])
    assert rows[4]["pixel"] == pytest.approx([40 - 20, 30 - 12.5])
    assert rows[2]["pixel"] is None
    assert not rows[2]["visible"]


def test_a_corner_is_visible_unless_occluded():
    depth_z = np.full((60, 80), 4.0, np.float32)
    depth_z[:, 40:] = 2.0
    rows = truth.layout_table(ROOM, camera(), depth_z)
    assert rows[0]["visible"]
    assert not rows[1]["visible"]


def test_a_corner_beyond_the_picture_is_not_visible_but_has_a_pixel():
    wide = Room("0_0", "w", "0", np.array([[-9.0, -4], [9, -4], [0, 1]]), 0.0, 2.5)
    row = truth.layout_table(wide, camera(), np.full((60, 80), 10.0, np.float32))[0]
    assert row["pixel"][0] < 0
    assert not row["visible"]
