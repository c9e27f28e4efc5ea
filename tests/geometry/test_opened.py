"""Doors and drawers at other joint values, and their obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import points_bounds
from pbrs_farm.geometry.opened import free_value, item_at
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from tests.inputs.cupboards import DEEP, WIDE, box_item, cupboard


def test_a_part_moves_and_the_body_stays_and_the_box_holds_both() -> None:
    shut = cupboard(JointKind.PRISMATIC)
    pulled = item_at(shut, "front", 0.3)
    np.testing.assert_array_equal(pulled.surfaces[0].positions, shut.surfaces[0].positions)
    assert pulled.surfaces[1].positions[:, 2] == pytest.approx(
        shut.surfaces[1].positions[:, 2] + 0.3
    )
    assert pulled.joints[0].value == 0.3
    assert pulled.oriented_box.half[2] * 2 == pytest.approx(0.5 + DEEP + 0.3, abs=1e-6)
    again = item_at(pulled, "front", 0.0)
    assert again.surfaces[1].positions == pytest.approx(shut.surfaces[1].positions, abs=1e-6)


def test_a_door_swings_to_the_front_about_its_edge() -> None:
    opened = item_at(cupboard(JointKind.REVOLUTE), "front", np.pi / 2)
    low, high = points_bounds(opened.surfaces[1].positions)
    # It is parallel to z now, its inner side to the right, with unchanged thickness.
    assert low == pytest.approx([0.0015, 0.002, DEEP], abs=1e-6)
    assert high == pytest.approx([0.0015 + DEEP, 0.698, DEEP + WIDE - 0.003], abs=1e-6)


@pytest.mark.parametrize("gap", [0.05, 0.2, 0.33])
def test_a_drawer_stops_at_an_obstacle(gap: float) -> None:
    drawer, chair = (
        cupboard(JointKind.PRISMATIC),
        box_item("chair", (0.2, 0, DEEP + gap), (0.5, 0.4, 2)),
    )
    value, by = free_value(SceneTriangles([drawer, chair]), 0, "front", 0.4)
    assert value == pytest.approx(gap - 0.004, abs=0.002)
    assert by == "chair"


@pytest.mark.parametrize("angle_deg", [20.0, 45.0, 80.0])
def test_a_door_stops_at_the_angle_of_an_obstacle(angle_deg: float) -> None:
    door, r, a = cupboard(JointKind.REVOLUTE), 0.4, np.radians(angle_deg)
    # A thin post: the door's outer face, which contains the hinge, touches it at the post's angle.
    post_place = np.array([0.0015 + r * np.cos(a), 0.0, DEEP + r * np.sin(a)])
    x, _y, z = post_place
    post = box_item("post", (x - 0.002, 0, z - 0.002), (x + 0.002, 1, z + 0.002))
    value, by = free_value(SceneTriangles([door, post]), 0, "front", np.radians(110))
    assert by == "post"
    assert np.degrees(value) == pytest.approx(angle_deg, abs=1.5)


def test_an_unobstructed_part_opens_fully() -> None:
    door = cupboard(JointKind.REVOLUTE)
    beside = [
        cupboard(JointKind.REVOLUTE, -WIDE, "left"), cupboard(JointKind.PRISMATIC, WIDE, "right"),
        box_item("top", (-1, 0.7, -0.5), (2, 0.74, 0.04)), box_item("floor", (-2, -0.1, -1), (3, 0, 3)),
        box_item("behind", (-1, 0, -0.6), (2, 2, -0.5)),
    ]  # fmt: skip
    scene = SceneTriangles([door, *beside])
    assert free_value(scene, 0, "front", np.radians(110)) == (np.radians(110), "")


def test_a_door_at_a_side_wall_opens_by_ninety_degrees() -> None:
    door, wall = cupboard(JointKind.REVOLUTE), box_item("wall", (-0.1, 0, -1), (0, 2.5, 3))
    value, by = free_value(SceneTriangles([door, wall]), 0, "front", np.radians(110))
    assert 85 < np.degrees(value) <= 90.2
    assert by == "wall"


def test_shutting_is_never_stopped() -> None:
    door = item_at(cupboard(JointKind.REVOLUTE), "front", 1.0)
    wall = box_item("wall", (0.1, 0, 0.1), (0.2, 1, 0.3))
    assert free_value(SceneTriangles([door, wall]), 0, "front", 0.0) == (0.0, "")


def test_a_sibling_stops_a_part_only_when_open() -> None:
    chest = cupboard(JointKind.PRISMATIC)
    bar = box_item("bar", (0.1, 0.2, DEEP + 0.002), (0.5, 0.4, DEEP + 0.012)).surfaces[0]
    slide = Joint("bar", JointKind.PRISMATIC, (0, 0, 0), (0, 0, 1), 0.3)
    both_fronts = replace(
        chest, surfaces=(*chest.surfaces, replace(bar, part="bar")), joints=(*chest.joints, slide)
    )
    assert free_value(SceneTriangles([both_fronts]), 0, "front", 0.4) == (0.4, "")
    value, by = free_value(SceneTriangles([item_at(both_fronts, "bar", 0.2)]), 0, "front", 0.4)
    assert value == pytest.approx(0.202 - 0.004, abs=0.002)
    assert by == both_fronts.id
