"""Published camera files and a user's own: read and rejected."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import PAPER_HFOV_RAD, Camera
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lenses import Lens
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.sample.camera_file import cameras_from_file_text
from pbrs_farm.sample.room_camera_file import cameras_from_text, with_names
from pbrs_farm.sample.stored_cameras import stored_views, views_from_cameras
from tests.sample.sampled_rooms import QUICK, counter_of

Z_UP_FROM_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
LINE = "1.5 1.55 2  0.6929 -0.19612 0.6929  0.1386 0.98058 0.1386  0.5534 0.433896  540"


def test_a_published_line_gives_the_published_intrinsics_and_pose() -> None:
    (line,) = cameras_from_text(LINE + "\n\n", "room_camera.txt", 640, 480)
    camera = line.camera
    assert camera.intrinsics.fx == pytest.approx(517.97, abs=0.005)
    assert camera.intrinsics.fy == camera.intrinsics.fx
    assert line.score == 540
    np.testing.assert_allclose(camera.eye, [1.5, 1.55, 2])
    assert math.degrees(math.asin(-camera.towards[1])) == pytest.approx(11.31, abs=0.01)
    rotation = camera.world_from_camera[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("1 2 3", "12 numbers"),
        (LINE.replace("540", "many"), "expected numbers"),
        (LINE.replace("1.5 ", "nan "), "finite"),
        (LINE.replace("0.5534", "1.7"), "half angle"),
        ("0 0 0  0 1 0  0 1 0  0.5 0.4  1", "parallel"),
    ],
)
def test_a_line_that_is_no_camera_is_rejected_with_its_number(line: str, reason: str) -> None:
    with pytest.raises(BadInput, match=reason) as caught:
        cameras_from_text(f"{LINE}\n{line}\n", "room_camera.txt", 640, 480)
    assert "room_camera.txt: line 2" in str(caught.value)


def test_a_users_camera_has_opencvs_numbers_and_is_refused_where_they_fold() -> None:
    row = {"eye": [1, 1.5, 2], "towards": [0, 0, -1], "distortion": [0.1, 0, 0, 0, 0, 0.05, 0, 0]}
    ((camera, _room),) = cameras_from_file_text(json.dumps([row]), "cams.json", 320, 240)
    assert camera.intrinsics.lens.model == "opencv"
    for numbers, words in (
        ([1, 2, 3], "4, 5, 8, 12 or 14"),
        ([-1.5, 0, 0, 0], "folds the picture"),
    ):
        text = json.dumps([row | {"distortion": numbers}])
        with pytest.raises(BadInput, match=f"cams.json: .*{words}"):
            cameras_from_file_text(text, "cams.json", 320, 240)


def test_a_users_file_gives_cameras_by_look_or_by_matrix() -> None:
    text = """[
      {"eye": [1, 1.5, 2], "towards": [0, 0, -1], "hfov_rad": 1.2, "room": "0_1"},
      {"world_from_camera": [[1,0,0,1],[0,1,0,1.5],[0,0,1,2],[0,0,0,1]]}
    ]"""
    (look, room), (matrix, no_room) = cameras_from_file_text(text, "cams.json", 320, 240)
    np.testing.assert_allclose(look.world_from_camera, matrix.world_from_camera, atol=1e-12)
    hfov = 2 * math.atan(0.5 * 320 / matrix.intrinsics.fx)
    assert hfov == pytest.approx(PAPER_HFOV_RAD)
    assert cameras_from_file_text(LINE, "room_camera.txt", 640, 480)[0][0].eye[0] == 1.5
    assert (room, no_room) == ("0_1", None)


def test_each_camera_has_its_k_and_may_use_opencvs_axes() -> None:
    text = """[
      {"world_from_camera_opencv": [[1,0,0,1],[0,-1,0,1.5],[0,0,-1,2],[0,0,0,1]],
       "K": [[600,0,650],[0,610,350],[0,0,1]], "width_px": 1280, "height_px": 720},
      {"world_from_camera": [[1,0,0,1],[0,1,0,1.5],[0,0,1,2],[0,0,0,1]], "hfov_rad": 1.0}
    ]"""
    (first, _), (second, _) = cameras_from_file_text(text, "cams.json", 640, 480)
    np.testing.assert_allclose(first.world_from_camera, second.world_from_camera, atol=1e-12)
    # A point projects to the place given by K of the whole picture, for any drawn size.
    point = np.array([[1.2, 1.6, 0.0]])
    x, y = first.with_size(1280, 720).pixels_of(point)[0]
    assert (x, y) == pytest.approx((650 + 600 * 0.2 / 2, 350 - 610 * 0.1 / 2))
    assert first.intrinsics.fx != second.intrinsics.fx


@pytest.mark.parametrize(
    "text",
    [
        '[{"eye": [1, 2, 3], "towards": [0, 0, 1], "K": [[9,0,4],[0,9,4],[0,0,1]]}]',
        '[{"eye": [1, 2, 3], "towards": [0, 0, 1], "width_px": 8, "height_px": 8}]',
        '[{"eye": [1, 2, 3], "towards": [0, 0, 1], "K": [[0,0,4],[0,9,4],[0,0,1]], "width_px": 8,'
        ' "height_px": 8}]',
        '[{"world_from_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],'
        ' "world_from_camera_opencv": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]',
        '[{"eye": [1, 2, 3]}]',
        '[{"eye": [1, 2, 3], "towards": [0, 1, 0]}]',
        '[{"eye": [1, 2], "towards": [0, 0, 1]}]',
        '[{"world_from_camera": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]',
        '[{"world_from_camera": [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]',
        '[{"eye": [1, 2, 3], "towards": [0, 0, 1], "fov": 3}]',
        "[",
        "",
        "[]",
    ],
)
def test_a_users_file_that_gives_no_pose_is_rejected(text: str) -> None:
    with pytest.raises(BadInput, match=r"cams\.json"):
        cameras_from_file_text(text, "cams.json", 320, 240)


def test_stored_cameras_become_views_of_their_rooms() -> None:
    house = builtin_home()
    views, notes = stored_views(house, QUICK, counter_of(house))
    assert not notes
    assert [v.room_id for v in views] == ["0_0", "0_1"]
    for view, stored in zip(views, house.cameras, strict=True):
        assert view.origin == "stored"
        np.testing.assert_allclose(view.camera.eye, stored.eye)
        assert view.score == sum(view.objects.values()) > 0
    assert len({v.id for v in views}) == 2


def test_the_name_of_a_published_camera_gives_its_room() -> None:
    text = with_names(f"{LINE}\n\n{LINE}\n", "Room#0_1_2\nRoom#9_9_0\n", "names")
    published = cameras_from_file_text(text, "room_camera.txt", 640, 480)
    assert [room for _, room in published] == ["0_1", "9_9"]
    house = builtin_home()
    x, _, z = house.rooms[0].polygon.mean(0)[[0, 0, 1]]
    inside = replace(
        published[0][0], world_from_camera=moved(published[0][0].world_from_camera, x, z)
    )
    views = views_from_cameras(
        house, [(inside, "0_1"), (inside, "9_9")], QUICK, counter_of(house), origin="file"
    )
    assert [v.room_id for v in views] == ["0_1", "0_0"]
    with pytest.raises(BadInput, match="1 names for 2 cameras"):
        with_names(f"{LINE}\n{LINE}\n", "Room#0_1_2\n", "names")


def moved(world_from_camera: np.ndarray, x: float, z: float) -> np.ndarray:
    """The pose with its eye moved to x, z."""
    pose = world_from_camera.copy()
    pose[[0, 2], 3] = x, z
    return pose


@pytest.mark.parametrize("text", ["[" + "{}," * 10_001 + "{}]", "1 2 3\n" * 10_001])
def test_a_file_of_too_many_cameras_is_rejected_before_any_is_built(text: str) -> None:
    with pytest.raises(BadInput, match="the maximum is 10000"):
        cameras_from_file_text(text, "mine", 64, 48)


def test_transforms_json_gives_the_cameras_before_its_transform() -> None:
    pose = Camera.look_at((1, 1.5, 2), (2, 1.2, 0), size=(640, 480), hfov_deg=60).world_from_camera
    frame = {"file_path": "images/a.png", "transform_matrix": (Z_UP_FROM_Y_UP @ pose).tolist()}
    optics = {"w": 640, "h": 480, "fl_x": 500.0, "fl_y": 510.0, "cx": 310.0, "cy": 250.0}
    exported = {"camera_model": "PINHOLE", "applied_transform": Z_UP_FROM_Y_UP[:3].tolist(),
                "frames": [frame | optics]}  # fmt: skip
    published = optics | {"frames": [frame], "aabb_scale": 4}
    blender = {"camera_angle_x": 0.9, "frames": [frame]}
    for value in (exported, published, blender):
        ((camera, room),) = cameras_from_file_text(json.dumps(value), "transforms.json", 320, 240)
        np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-9)
        assert room is None
        if value is not blender:
            assert camera.intrinsics.fx == pytest.approx(250)
            assert camera.intrinsics.cy == pytest.approx(125)
        else:
            assert camera.intrinsics.fx == pytest.approx(160 / math.tan(0.45))
    ((bent, _),) = cameras_from_file_text(
        json.dumps(published | {"k1": 0.1, "p2": 0.01}), "transforms.json", 320, 240
    )
    assert bent.intrinsics.lens == Lens("radtan", (0.1, 0, 0, 0.01, 0))
    for wrong in ({"k4": 0.1}, {"camera_model": "OPENCV_FISHEYE"}):
        with pytest.raises(BadInput, match="has a lens other than PINHOLE"):
            cameras_from_file_text(json.dumps(published | wrong), "transforms.json", 320, 240)
    flat = exported | {"applied_transform": [[0.0] * 4] * 3}
    with pytest.raises(BadInput, match=r"transforms.json: .*applied_transform is flat"):
        cameras_from_file_text(json.dumps(flat), "transforms.json", 320, 240)
    with pytest.raises(BadInput, match=r"frames\[0\].transform_matrix"):
        cameras_from_file_text('{"frames": [{}]}', "transforms.json", 320, 240)
