"""Articulated objects of a Habitat scene: placement of links, and their joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.robot.urdf import robot_from_urdf
from tests.inputs.habitat_files import written
from tests.read.gltf.gltf_scenes import Scene
from tests.read.habitat.habitat_sets import dataset

# A cupboard 0.8 m wide: its door is hinged at its left front edge, its drawer slides forward (-z).
URDF = """<robot name="cupboard">
  <link name="root"/>
  <link name="body"><visual><geometry><mesh filename="body.glb"/></geometry></visual></link>
  <joint name="to_body" type="fixed"><parent link="root"/><child link="body"/></joint>
  <link name="door"><visual><origin xyz="0.2 0 0"/><geometry><mesh filename="leaf.glb" scale="0.4 0.6 0.02"/></geometry></visual></link>
  <joint name="hinge" type="revolute"><parent link="body"/><child link="door"/>
    <origin xyz="-0.4 0.3 -0.3"/><axis xyz="0 1 0"/><limit lower="0" upper="1.6"/></joint>
  <link name="drawer"><visual><geometry><mesh filename="leaf.glb" scale="0.4 0.2 0.4"/></geometry></visual></link>
  <joint name="rail" type="prismatic"><parent link="body"/><child link="drawer"/>
    <origin xyz="0.2 0.3 0"/><axis xyz="0 0 1"/><limit lower="-0.35" upper="0"/></joint>
</robot>"""


def scene(folder: Path, urdf: str = URDF, **row: Any) -> Path:
    cube = Scene()
    cube.node("mesh", mesh=cube.box([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]))
    body = Scene()
    body.node("mesh", mesh=body.box([-0.4, 0, -0.3], [0.4, 0.6, 0.3]))
    written(folder / "urdf/cupboard/leaf.glb", cube.glb())
    written(folder / "urdf/cupboard/body.glb", body.glb())
    written(folder / "urdf/cupboard/cupboard.urdf", urdf.encode())
    instance = {"template_name": "cupboard", "translation": [2, 0, 1.5]} | row
    return dataset(folder, articulated_object_instances=[instance])


def house(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def cupboard(path: Path) -> Item:
    return next(i for i in house(path).items if i.name == "cupboard")


def bounds(item: Item, part: str) -> list[list[float]]:
    points = np.concatenate([s.positions for s in item.surfaces if s.part == part])
    return [points.min(0).tolist(), points.max(0).tolist()]


def test_joints_place_links_and_give_their_motion(tmp_path: Path) -> None:
    parts = cupboard(scene(tmp_path))
    assert parts.nyu40 == 3
    assert bounds(parts, "") == pytest.approx(np.array([[1.6, 0, 1.2], [2.4, 0.6, 1.8]]), abs=1e-6)
    # Its box reaches half a depth beyond the body's middle, 0.3 m.
    shut = np.array([[1.6, 0, 1.19], [2.0, 0.6, 1.21]])
    assert bounds(parts, "door") == pytest.approx(shut, abs=1e-6)
    joints = {joint.part: joint for joint in parts.joints}
    assert joints["door"].kind is JointKind.REVOLUTE
    assert joints["door"].point == pytest.approx((1.6, 0.3, 1.2))
    assert (joints["door"].axis, joints["door"].upper) == ((0, 1, 0), 1.6)
    # A rail with a negative range opens from 0.
    assert joints["drawer"].axis == pytest.approx((0, 0, -1))
    assert (joints["drawer"].lower, joints["drawer"].upper) == (0, 0.35)


@pytest.mark.parametrize(
    "row",
    [
        {"initial_joint_pose": [np.pi / 2, -0.2]},
        {"initial_joint_pose": {"rail": -0.2, "hinge": [np.pi / 2]}},
        {"initial_joint_pose": [np.pi / 2, -0.2], "link_order": "urdf_order"},
    ],
)
def test_a_pose_opens_them(tmp_path: Path, row: dict[str, Any]) -> None:
    parts = cupboard(scene(tmp_path, **row))
    # A quarter turn about y takes +x to -z: the open leaf is in front of the hinge.
    turned = np.array([[1.59, 0, 0.8], [1.61, 0.6, 1.2]])
    assert bounds(parts, "door") == pytest.approx(turned, abs=1e-6)
    drawn = np.array([[2.0, 0.2, 1.1], [2.4, 0.4, 1.5]])
    assert bounds(parts, "drawer") == pytest.approx(drawn, abs=1e-6)
    values = {joint.part: joint.value for joint in parts.joints}
    assert values == pytest.approx({"door": np.pi / 2, "drawer": 0.2})


def test_shut_again_it_is_as_without_a_pose(tmp_path: Path) -> None:
    opened = cupboard(scene(tmp_path / "a", initial_joint_pose=[1.0, -0.2]))
    joint = next(j for j in opened.joints if j.part == "door")
    points = np.concatenate([s.positions for s in opened.surfaces if s.part == "door"])
    shut = points @ joint.motion(0.0)[:3, :3].T + joint.motion(0.0)[:3, 3]
    door_bounds = bounds(cupboard(scene(tmp_path / "b")), "door")
    assert [shut.min(0).tolist(), shut.max(0).tolist()] == pytest.approx(
        np.array(door_bounds), abs=1e-5
    )


def test_an_object_scales_and_turns_with_its_joints(tmp_path: Path) -> None:
    half = float(np.sqrt(0.5))
    parts = cupboard(scene(tmp_path, uniform_scale=0.5, rotation=[half, 0, half, 0]))
    joints = {joint.part: joint for joint in parts.joints}
    # A quarter turn about y takes (x, y, z) to (z, y, -x).
    assert joints["door"].point == pytest.approx((2 - 0.15, 0.15, 1.5 + 0.2), abs=1e-6)
    assert joints["drawer"].axis == pytest.approx((-1, 0, 0), abs=1e-6)
    assert joints["drawer"].upper == pytest.approx(0.175)


def test_the_pose_of_a_slide_is_in_metres_at_any_scale(tmp_path: Path) -> None:
    parts = cupboard(scene(tmp_path, uniform_scale=0.5, initial_joint_pose=[1.0, -0.1]))
    joints = {joint.part: joint for joint in parts.joints}
    assert joints["drawer"].value == pytest.approx(0.1)
    assert joints["drawer"].upper == pytest.approx(0.175)
    assert joints["door"].value == pytest.approx(1.0)


def test_a_config_names_its_urdf(tmp_path: Path) -> None:
    path = scene(tmp_path, template_name="kitchen/cabinet_3")
    written(tmp_path / "urdf/cabinet_3.ao_config.json", {"urdf_filepath": "cupboard/cupboard.urdf"})
    assert any(i.name == "cabinet_3" and len(i.joints) == 2 for i in house(path).items)


def test_missing_parts_are_notes(tmp_path: Path) -> None:
    read_house = house(scene(tmp_path, template_name="elsewhere"))
    assert [n.kind for n in read_house.notes if "articulated" in n.place] == ["missing-model"]


def test_a_change_of_the_urdf_or_its_models_is_seen(tmp_path: Path) -> None:
    path = scene(tmp_path)
    before = resolve(str(path)).companions
    written(tmp_path / "urdf/cupboard/leaf.glb", (tmp_path / "urdf/cupboard/body.glb").read_bytes())
    between = resolve(str(path)).companions
    written(tmp_path / "urdf/cupboard/cupboard.urdf", URDF.replace("1.6", "1.5").encode())
    assert len({before, between, resolve(str(path)).companions}) == 3


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("<robot", "<sdf", "not valid XML"),
        ('child link="door"', 'child link="dor"', "its child is not a link"),
        ('child link="drawer"', 'child link="door"', "has two parents"),
        (
            'parent link="root"/><child link="body"',
            'parent link="door"/><child link="body"',
            "cycle",
        ),
        ('axis xyz="0 1 0"', 'axis xyz="0 0 0"', "no direction"),
        ('axis xyz="0 1 0"', 'axis xyz="0 nan 0"', "finite numbers"),
        ('upper="1.6"', 'upper="wide"', "finite numbers"),
    ],
)
def test_a_damaged_urdf_is_named_with_its_place(
    tmp_path: Path, old: str, new: str, text: str
) -> None:
    with pytest.raises(BadHouse, match=text) as error:
        house(scene(tmp_path, URDF.replace(old, new)))
    assert "cupboard.urdf" in str(error.value)


def test_a_pose_of_words_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadHouse, match=r"articulated_object_instances\[0\]\.initial_joint_pose"):
        house(scene(tmp_path, initial_joint_pose=["wide"]))


def test_entities_are_refused() -> None:
    text = b'<!DOCTYPE r [<!ENTITY a "b">]><robot><link name="&a;"/></robot>'
    with pytest.raises(BadHouse, match="not valid XML"):
        robot_from_urdf(text, "x.urdf")
