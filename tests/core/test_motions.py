"""Motions between their keys, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.motions import Motion, fault_of_motion

DRAWER = Motion("desk", "drawer 1", (1.0, 3.0), ((0.1,), (0.5,)))
HALF_TURN = (0.0, 0.0, 1.0, 0.0)  # 180 degrees about y
# An item with its pivot at (1, 0, 0) that rises 2 m and turns by 180 degrees in 4 s.
FLIGHT = Motion("mug", "", (0.0, 4.0), ((1, 0, 0, 1, 0, 0, 0), (1, 2, 0, *HALF_TURN)), (1.0, 0, 0))


@pytest.mark.parametrize(
    ("time_s", "value"), [(0, 0.1), (1, 0.1), (2, 0.3), (2.5, 0.4), (3, 0.5), (9, 0.5)]
)
def test_a_joint_moves_evenly_between_keys_and_stays_beyond_them(
    time_s: float, value: float
) -> None:
    assert DRAWER.value_at(time_s) == pytest.approx(value)


def test_a_body_moves_with_its_pivot_and_turns_about_it() -> None:
    points = np.array([[1.0, 0, 0], [1.5, 0, 0]])
    assert FLIGHT.matrix_at(0.0) == pytest.approx(np.eye(4))
    # Half-way it has turned by 90 degrees about y, which takes +x to -z.
    assert transform_points(FLIGHT.matrix_at(2.0), points) == pytest.approx(
        np.array([[1.0, 1, 0], [1.0, 1, -0.5]])
    )
    assert transform_points(FLIGHT.matrix_at(4.0), points) == pytest.approx(
        np.array([[1.0, 2, 0], [0.5, 2, 0]])
    )


def test_a_turn_takes_the_shorter_arc() -> None:
    c, s = np.cos(np.radians(5)), np.sin(np.radians(5))
    # The same turn of 10 degrees with the opposite of its two quaternions.
    motion = Motion("mug", "", (0.0, 1.0), ((0, 0, 0, 1, 0, 0, 0), (0, 0, 0, -c, 0, -s, 0)))
    angle = np.degrees(np.arccos(motion.matrix_at(0.5)[0, 0]))
    assert angle == pytest.approx(5)


@pytest.mark.parametrize(
    ("motion", "fault"),
    [
        (Motion("a", "leaf", (0.0, 0.0), ((0.0,), (1.0,))), "ascend"),
        (Motion("a", "leaf", (0.0,), ((0.0,), (1.0,))), "1 times and 2 rows"),
        (Motion("a", "", (0.0,), ((0.0,),)), "other than 7"),
        (Motion("a", "leaf", (0.0,), ((float("nan"),),)), "not a finite number"),
        (Motion("a", "", (0.0,), ((0, 0, 0, 2, 0, 0, 0),)), "length 1"),
        (Motion("a", "", (), ()), "0 times"),
    ],
)
def test_faults_of_a_motion_are_reported(motion: Motion, fault: str) -> None:
    assert fault in fault_of_motion(motion)
    assert fault_of_motion(DRAWER) == fault_of_motion(FLIGHT) == ""
