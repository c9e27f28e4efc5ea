"""Joints turn and slide their parts, and follow the item they belong to."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.frames import rotation_y, transform_points
from pbrs_farm.core.joints import Joint, JointKind

# A door of 0.8 m along +x from its hinge at (1, 0, 2); it opens towards +z.
DOOR = Joint("door 1", JointKind.REVOLUTE, (1.0, 0.0, 2.0), (0.0, -1.0, 0.0), upper=np.pi / 2)
EDGE = np.array([[1.8, 0.5, 2.0]])


def test_a_hinge_turns_anticlockwise_about_its_axis() -> None:
    assert transform_points(DOOR.motion(np.pi / 2), EDGE) == pytest.approx(
        np.array([[1.0, 0.5, 2.8]])
    )
    s = 0.8 * np.sqrt(0.5)
    half = transform_points(DOOR.motion(np.pi / 4), EDGE)
    assert half == pytest.approx(np.array([[1 + s, 0.5, 2 + s]]))


def test_a_motion_begins_at_the_parts_pose() -> None:
    drawer = Joint("drawer 1", JointKind.PRISMATIC, (0, 0, 0), (0.0, 0.0, 1.0), 0.4, value=0.3)
    assert transform_points(drawer.motion(0.0), EDGE) == pytest.approx(EDGE - [0, 0, 0.3])
    assert drawer.share == pytest.approx(0.75)


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_joint_follows_an_item_that_is_placed_scaled_or_mirrored(mirror: float) -> None:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_y(0.7) @ np.diag([2.0 * mirror, 1.5, 3.0])
    matrix[:3, 3] = [4.0, 0.5, -2.0]
    # Opening then placing equals placing then opening: hinge and edge are along scaled axes.
    placed = DOOR.placed(matrix)
    shut = transform_points(matrix, EDGE)
    opened = transform_points(placed.motion(np.pi / 2), shut)
    hinge = transform_points(matrix, np.array([[1.0, 0.5, 2.0]]))
    front = rotation_y(0.7) @ [0.0, 0.0, 1.0]
    assert opened - hinge == pytest.approx(1.6 * front[None])

    slide = Joint("drawer 1", JointKind.PRISMATIC, (0, 0, 0), (0, 0, 1), 0.4, mass_kg=2.0)
    pulled = slide.placed(matrix)
    assert pulled.upper == pytest.approx(1.2)
    assert pulled.axis == pytest.approx(front)
    assert pulled.mass_kg == pytest.approx(2.0 * 9.0)
