"""Unread parts of a glTF scene are noted; a window of several nodes is one opening."""

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.read.gltf.scene import read_gltf
from pbrs_farm.repair import repair
from tests.read.gltf.gltf_scenes import Scene, read, two_rooms
from tests.repair.embree import EmbreeOccluder

HOLE = [
    [[0, 0, 0], [0, 2.6, 0], [1, 2.6, 0], [1, 0, 0]],
    [[3, 0, 0], [3, 2.6, 0], [4, 2.6, 0], [4, 0, 0]],
    [[1, 0, 0], [1, 0.9, 0], [3, 0.9, 0], [3, 0, 0]],
    [[1, 2.1, 0], [1, 2.6, 0], [3, 2.6, 0], [3, 2.1, 0]],
]


def notes_text(scene: Scene) -> str:
    notes = [n for n in read(scene).notes if n.kind == "unread-part"]
    return "; ".join(n.text for n in notes)


def test_each_unread_part_is_noted_once() -> None:
    scene = two_rooms()
    for _ in range(3):
        scene.node("chair", mesh=scene.box([1, 0, 1], [1.5, 1, 1.5]))
    scene.meshes[-1]["primitives"][0]["targets"] = [{}]
    scene.meshes[-2]["primitives"][0]["mode"] = 1
    scene.nodes[-1]["skin"] = 0
    scene.more = {"extensionsUsed": ["EXT_own_shapes", "KHR_lights_punctual"]}
    text = notes_text(scene)
    assert "EXT_own_shapes is not supported" in text
    assert "KHR_lights_punctual" not in text
    assert "have morph targets" in text
    assert "have points or lines" in text
    assert "have a skin" in text
    assert notes_text(two_rooms()) == ""


def test_a_mesh_without_data_is_reported_as_compressed() -> None:
    scene = two_rooms()
    data = scene.glb()
    bad = data.replace(b'"bufferView":0,', b'"bufferVie_":0,', 1)
    with pytest.raises(BadHouse, match="its mesh is compressed"):
        read_gltf(bad, "draco.glb", fields=ReadFields())


@pytest.mark.parametrize("size", [100.0, 0.01])
def test_a_scene_in_other_units_is_refused_with_its_size(size: float) -> None:
    scene = Scene()
    quads = np.array([[[0, 0, 0], [0, 3, 0], [3, 3, 0], [3, 0, 0]]]) * size
    scene.node("thing", mesh=scene.mesh(quads.tolist()))
    with pytest.raises(BadHouse, match=f"it is {3 * size:g} m large, but glTF is in metres"):
        read_gltf(scene.glb(), "cm.glb", fields=ReadFields())


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_window_of_frame_and_pane_fills_the_hole_of_its_wall(turn: float) -> None:
    scene = Scene()
    sides = [
        [[0, 0, 0], [0, 0, 3], [4, 0, 3], [4, 0, 0]],
        [[0, 2.6, 0], [4, 2.6, 0], [4, 2.6, 3], [0, 2.6, 3]],
        [[0, 0, 3], [0, 2.6, 3], [0, 2.6, 0], [0, 0, 0]],
        [[4, 0, 0], [4, 2.6, 0], [4, 2.6, 3], [4, 0, 3]],
        [[4, 0, 3], [4, 2.6, 3], [0, 2.6, 3], [0, 0, 3]],
    ]
    inward = [q[::-1] for q in (*HOLE, *sides[2:])] + sides[:2]
    room = scene.node("Room", mesh=scene.mesh(inward))
    frame = scene.node("frame", mesh=scene.box([1, 0.9, -0.05], [1.1, 2.1, 0]))
    pane = scene.node("pane", mesh=scene.box([1.1, 0.9, -0.03], [3, 2.1, -0.02]))
    window = scene.node("Window_1", children=[frame, pane])
    rotation = [0.0, float(np.sin(turn / 2)), 0.0, float(np.cos(turn / 2))]
    scene.node("House", rotation=rotation, children=[room, window])
    house = read(scene)
    assert [o.is_window for o in house.openings] == [True]
    _, report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
