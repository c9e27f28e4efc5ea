"""Joints of UsdPhysics: limits, axes, scaled bodies, bodies on moving bodies, joints that are not read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.house import Item
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve

pytest.importorskip("pxr")

_ROOM = """#usda 1.0
(
    defaultPrim = "Room"
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "Room" {
    def Cube "Floor" {
        double size = 1
        float3 xformOp:scale = (400, 400, 10)
        double3 xformOp:translate = (0, 0, -5)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }
    def Xform "Cabinet" (kind = "component") {
        %s
    }
}
"""


def body(name: str, at: tuple[float, float, float], size: float = 20, scale: float = 1) -> str:
    return f"""def Xform "{name}" (prepend apiSchemas = ["PhysicsRigidBodyAPI"]) {{
        double3 xformOp:translate = {at}
        float3 xformOp:scale = ({scale}, {scale}, {scale})
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        def Cube "shape" {{
            double size = {size}
        }}
    }}"""


def joint(kind: str, name: str, first: str, second: str, more: str) -> str:
    ends = [
        f"rel physics:body{k} = </Room/Cabinet/{p}>" for k, p in enumerate((first, second)) if p
    ]
    return f'def Physics{kind}Joint "{name}" {{\n' + "\n".join([*ends, more]) + "\n}"


def cabinet(folder: Path, *parts: str) -> tuple[Item, list[str]]:
    path = folder / "room.usda"
    path.write_text(_ROOM % "\n".join(parts))
    house = read_house(resolve(str(path)), ReadFields())
    (item,) = [i for i in house.items if i.name == "Cabinet"]
    return item, [n.text for n in house.notes if n.place == "joints"]


def test_hinges_and_slides_have_their_limits_axes_and_values(tmp_path: Path) -> None:
    hinge = """uniform token physics:axis = "Z"
        point3f physics:localPos0 = (-50, 0, 0)
        point3f physics:localPos1 = (-10, 0, 0)
        float physics:lowerLimit = -95
        float physics:upperLimit = 0"""
    slide = """uniform token physics:axis = "Y"
        point3f physics:localPos0 = (0, -20, 100)
        float physics:lowerLimit = -30
        float physics:upperLimit = 0"""
    item, notes = cabinet(
        tmp_path,
        body("body", (0, 0, 50)),
        body("door", (-40, 0, 50)),
        body("drawer", (0, -35, 150), scale=2, size=5),
        joint("Revolute", "hinge", "body", "door", hinge),
        joint("Prismatic", "slide", "body", "drawer", slide),
    )
    door, drawer = item.joints
    assert (door.part, door.kind) == ("door", JointKind.REVOLUTE)
    np.testing.assert_allclose(door.point, (-0.5, 0.5, 0), atol=1e-6)
    np.testing.assert_allclose(door.axis, (0, -1, 0), atol=1e-6)
    assert (door.lower, door.upper) == pytest.approx((0, np.radians(95)), abs=1e-6)
    assert door.value == pytest.approx(0, abs=1e-6)
    # 15 of 30 cm out, along -y, which is +z of the home.
    np.testing.assert_allclose(drawer.axis, (0, 0, 1), atol=1e-6)
    assert (drawer.lower, drawer.upper, drawer.value) == pytest.approx((0, 0.3, 0.15), abs=1e-6)
    assert notes == []


def test_a_handle_on_a_door_moves_with_the_door(tmp_path: Path) -> None:
    limits = "float physics:lowerLimit = 0\nfloat physics:upperLimit = 60"
    item, _notes = cabinet(
        tmp_path,
        body("body", (0, 0, 50)),
        body("door", (40, 0, 50)),
        body("door_handle", (60, 0, 50), size=2),
        joint("Revolute", "hinge", "body", "door", limits),
        joint("Revolute", "turn", "door", "door_handle", limits),
    )
    assert [j.part for j in item.joints] == ["door"]
    of_door = np.vstack([s.positions for s in item.surfaces if s.part == "door"])
    np.testing.assert_allclose((of_door[:, 0].min(), of_door[:, 0].max()), (0.3, 0.61), atol=1e-6)


def test_joints_without_a_range_are_counted_in_a_note(tmp_path: Path) -> None:
    item, notes = cabinet(
        tmp_path,
        body("body", (0, 0, 50)),
        body("ball", (40, 0, 50)),
        body("wheel", (60, 0, 50)),
        joint("Spherical", "ball_joint", "body", "ball", ""),
        joint("Revolute", "wheel_joint", "body", "wheel", ""),
        joint("Fixed", "fixed", "", "body", ""),
    )
    assert not item.joints
    (note,) = notes
    assert note.startswith("2 have no range")


LIMITS = "float physics:lowerLimit = 0\nfloat physics:upperLimit = 60"


def test_joints_of_a_mirrored_body_are_counted_in_a_note(tmp_path: Path) -> None:
    item, notes = cabinet(
        tmp_path,
        body("body", (0, 0, 50)),
        body("door", (40, 0, 50), scale=-1),
        body("flat", (60, 0, 50), scale=0),
        joint("Revolute", "hinge", "body", "door", LIMITS),
        joint("Revolute", "other", "body", "flat", LIMITS),
    )
    assert not item.joints
    (note,) = notes
    assert note.startswith("2 have no range")
    assert "mirrored" in note


def test_bodies_that_carry_each_other_stay_in_the_home(tmp_path: Path) -> None:
    item, _notes = cabinet(
        tmp_path,
        body("left", (0, 0, 50)),
        body("right", (60, 0, 50)),
        joint("Revolute", "hinge", "left", "right", LIMITS),
        joint("Revolute", "back", "right", "left", LIMITS),
    )
    assert np.ptp(item.bounds[:, 0]) == pytest.approx(0.8, abs=1e-6)
    assert item.joints
