"""Hundreds of overlapping rooms are refused with one line, in every format."""

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.rooms import MAX_OVERLAPS, MAX_ROOMS, check_outlines
from pbrs_farm.read.gltf.scene import Beside, read_gltf
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.gltf.gltf_scenes import Scene, two_rooms
from tests.read.suncg.suncg_root import HOUSE, room, write_room, write_root

SQUARE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])


def test_storeys_over_each_other_and_rooms_side_by_side_are_read() -> None:
    storeys = {str(k): [SQUARE + np.array([3.0 * i, 0.0]) for i in range(40)] for k in range(10)}
    check_outlines(storeys, "tower.sh3d")


def test_a_room_too_many_is_refused() -> None:
    with pytest.raises(BadHouse, match="501 rooms, at most"):
        check_outlines(
            {"0": [SQUARE + np.array([4.0 * i, 0.0]) for i in range(MAX_ROOMS + 1)]}, "vast.sh3d"
        )


def test_overlapping_rooms_of_a_gltf_scene_are_refused() -> None:
    rows = [{"polygon": (SQUARE + 0.01 * k).tolist()} for k in range(40)]
    beside = Beside(rooms=json.dumps({"rooms": rows}).encode())
    with pytest.raises(BadHouse, match=f"scene.glb.*780 pairs of rooms overlap.*{MAX_OVERLAPS}"):
        read_gltf(two_rooms().glb(), "scene.glb", fields=ReadFields(), beside=beside)


def test_overlapping_floors_of_a_gltf_scene_are_refused() -> None:
    scene = Scene()
    for k in range(40):
        x = 0.01 * k
        scene.node("floor", mesh=scene.mesh([[[x, 0, 0], [x, 0, 3], [x + 3, 0, 3], [x + 3, 0, 0]]]))
    with pytest.raises(BadHouse, match="780 pairs of rooms overlap"):
        read_gltf(scene.glb(), "scene.glb", fields=ReadFields())


def test_overlapping_rooms_of_a_suncg_house_are_refused(tmp_path: Path) -> None:
    write_root(tmp_path)
    path = tmp_path / f"house/{HOUSE}/house.json"
    plain = json.loads(path.read_text())
    for k in range(40):
        name = f"fr_0rm_{50 + k}"
        plain["levels"][0]["nodes"].append(room(f"0_{50 + k}", name, [], []))
        write_room(tmp_path, name, f"0_{50 + k}", 0.01 * k, 3.0, {})
    path.write_text(json.dumps(plain))
    with pytest.raises(BadHouse, match="pairs of rooms overlap"):
        read_suncg(tmp_path, HOUSE, ReadFields())
