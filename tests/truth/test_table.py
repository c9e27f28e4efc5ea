import json

import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.frames import transform_points
from tests.truth.hits import camera, house


def test_each_visible_instance_has_a_row_with_its_pixels_and_box():
    ids = np.zeros((6, 8), np.uint32)
    ids[1:3, 2:6] = 2
    table = truth.view_table(ids, house(5, 35), camera(), with_visible_fraction=False)
    rows = table["instances"]
    assert len(rows) == 1
    assert rows[0]["id"] == 2
    assert rows[0]["item"] == "item1"
    assert rows[0]["class"] == "lamp"
    assert rows[0]["pixels"] == 8
    assert rows[0]["fraction"] == pytest.approx(8 / 48)
    assert rows[0]["box2d"] == [2, 1, 6, 3]
    assert rows[0]["visible_fraction"] is None


def test_an_item_is_truncated_exactly_when_a_vertex_leaves_the_picture():
    # The picture is 90 degrees wide and 6 / 8 of that high: at 2 m it reaches 2 m and 1.5 m.
    inside, across, behind = (house(5, z=z, half=h) for z, h in ((-2, 1.49), (-2, 1.51), (2, 0.1)))
    assert not truth.is_truncated(inside.items[0], camera())
    assert truth.is_truncated(across.items[0], camera())
    assert truth.is_truncated(behind.items[0], camera())


def test_the_table_is_json_and_k_and_pose_project_the_box_onto_the_picture():
    table = json.loads(json.dumps(truth.view_table(np.ones((6, 8), np.uint32), house(5), camera())))
    camera_from_world = np.linalg.inv(np.array(table["world_from_camera_opencv"]))
    centre = np.array(table["instances"][0]["box3d"]["centre"])[None]
    pixel = np.array(table["K"]) @ transform_points(camera_from_world, centre)[0]
    assert (pixel[:2] / pixel[2]).tolist() == pytest.approx([4.0, 3.0])


def test_an_empty_view_has_no_rows():
    assert truth.view_table(np.zeros((6, 8), np.uint32), house(5), camera())["instances"] == []
    assert truth.view_table(np.zeros((6, 8), np.uint32), house(), camera())["instances"] == []
