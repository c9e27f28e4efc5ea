"""Joints of pieces: from the hinges and rails of their models, or from the file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import House
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.read.sweethome3d.home import read_home
from tests.inputs.sh3d_doors import FRAME, HINGED, box, door_of, read
from tests.read.sweethome3d.sh3d_source import home_xml, piece, sh3d


def joint_of_door(house: House) -> Joint:
    (joint,) = door_of(house).joints
    return joint


def leaf(house: House) -> np.ndarray:
    leaf_surfaces = [s for s in door_of(house).surfaces if s.part == "leaf 1"]
    return np.concatenate([s.positions for s in leaf_surfaces]).astype(np.float64)


def test_a_leaf_turns_about_the_hinge_of_its_model() -> None:
    house = read("drawn")
    joint = joint_of_door(house)
    assert (joint.kind, joint.value, joint.upper) == (JointKind.REVOLUTE, 0.0, np.pi / 2)
    assert joint.point[0] == pytest.approx(1.59)
    wide = transform_points(joint.motion(np.pi / 2), leaf(house))
    assert wide[:, 2].max() == pytest.approx(0.03 + 0.81, abs=0.01)


@pytest.mark.parametrize("given", [{}, {"modelMirrored": "true"}, {"angle": "2.0"}])
def test_a_door_read_open_shuts_to_its_drawn_pose(given: dict[str, str]) -> None:
    shut, opened = read("drawn", **given), read("open", **given)
    joint = joint_of_door(opened)
    if "angle" not in given:  # a door that leads into no room stays shut
        assert joint.value == pytest.approx(np.radians(85))
        assert not np.allclose(leaf(opened), leaf(shut), atol=0.1)
    again = transform_points(joint.motion(0.0), leaf(opened))
    assert again == pytest.approx(leaf(shut), abs=1e-5)


def test_a_leaf_that_was_left_out_has_no_joint() -> None:
    chest = piece("x='200' y='40' width='150' depth='40' height='100'")
    assert door_of(read("open", more=chest)).joints == ()


def test_a_part_on_a_rail_slides_along_the_rail() -> None:
    pane = box("sweethome3d_opening_on_rail_1_door", (-0.4, 0, -0.02), (0.0, 2, 0.02), 1)
    rail = box("sweethome3d_rail_1", (-0.4, 2, -0.02), (0.4, 2.02, 0.02), 17)
    joint = joint_of_door(read("drawn", obj=pane + FRAME + rail))
    assert joint.kind is JointKind.PRISMATIC
    assert joint.axis == pytest.approx((1, 0, 0))
    assert joint.upper == pytest.approx(0.4, abs=1e-6)


@pytest.mark.parametrize("hinge_z", [0.262, 0.268, 0.272])
def test_a_cupboards_door_opens_away_from_its_body(hinge_z: float) -> None:
    body = box("carcass", (-0.4, 0, -0.25), (0.4, 2, 0.25), 1)
    front = box("sweethome3d_opening_on_hinge_1_door", (-0.4, 0, 0.26), (0.4, 2, 0.275), 9)
    low, high = (-0.4, 1, hinge_z - 0.002), (-0.39, 1.1, hinge_z + 0.002)
    obj = body + front + box("sweethome3d_hinge_1_1", low, high, 17)
    chest = piece("x='200' y='100' width='80' depth='52.5' height='200'")
    house = read_home(sh3d(home_xml(chest), {"1": obj.encode()}), "test.sh3d")
    (joint,) = house.items[-1].joints
    (surface,) = (s for s in house.items[-1].surfaces if s.part)
    wide = transform_points(joint.motion(np.pi / 2), surface.positions.astype(np.float64))
    assert wide[:, 2].max() > surface.positions[:, 2].max() + 0.7


def joined_house(value: str) -> House:
    inner = f"<property name='pbrs_farm.joints' value='{value}'/>"
    chest = piece("x='200' y='100' width='80' depth='40' height='200'", inner)
    obj = HINGED.encode()
    return read_home(sh3d(home_xml(chest), {"1": obj}), "test.sh3d")


def row(**changes: object) -> str:
    joint = {
        "part": "door 1", "kind": "revolute", "point": [0, 0, 0], "axis": [0, 1, 0], "upper": 1.5,
    } | changes  # fmt: skip
    return json.dumps([joint])


def test_joints_of_the_file_precede_those_of_the_model() -> None:
    house = joined_house(row(upper=1.25, mass_kg=3.0))
    (joint,) = house.items[-1].joints
    assert (joint.part, joint.upper) == ("door 1", 1.25)
    assert {s.part for s in house.items[-1].surfaces} == {"", "door 1"}


@pytest.mark.parametrize(
    "value", ["", "[", "3", row(axis=[0, 2, 0]), row(kind="ball"), row(upper="far"), row(lower=2.0)]
)
def test_invalid_joints_are_refused_with_file_and_piece(value: str) -> None:
    with pytest.raises(BadHouse, match=r"test\.sh3d.*Thing.*pbrs_farm\.joints"):
        joined_house(value)
