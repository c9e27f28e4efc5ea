"""Ways 0.6 m wide: gaps that let a person through, to half a centimetre on either side."""

from __future__ import annotations

import pytest

from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    Rect,
    RoomType,
)
from pbrs_farm.generate.furnish.room_space import FurnishSpace, room_space
from pbrs_farm.generate.furnish.walk_bitmap import WalkMap

W, D = 5.0, 3.0


def room() -> FurnishSpace:
    """A room with a door at each end of its length."""
    corners = ((0.0, 0.0), (W, 0.0), (W, D), (0.0, D))
    walls = tuple(
        PlanWall(a, b, 0.02) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    )
    doors = (
        PlanOpening(OpeningKind.DOOR, 1, D / 2, 0.9, 2.1, 0.0, 0),
        PlanOpening(OpeningKind.DOOR, 3, D / 2, 0.9, 2.1, 0.0, 0),
    )
    plan = Plan((PlanRoom(RoomType.HALL, "Hall", corners),), walls, doors, 2.5)
    return room_space(plan, 0)


def is_joined(bodies: list[Rect]) -> bool:
    walk = WalkMap(room())
    return walk.reached(walk.with_bodies(walk.free, bodies), ()) is not None


@pytest.mark.parametrize("offset", [0.0, 0.013, 0.024, 0.037])
@pytest.mark.parametrize(("gap", "passes"), [(0.5, False), (0.58, False), (0.65, True)])
def test_a_gap_between_two_bodies_has_its_exact_width(
    offset: float, gap: float, passes: bool
) -> None:
    low = 1.0 + offset
    bodies = [(2.0, 0.0, 3.0, low), (2.0, low + gap, 3.0, D)]
    assert is_joined(bodies) is passes


@pytest.mark.parametrize(("apart", "passes"), [(0.36, False), (0.5, True)])
def test_corners_are_passed_on_their_diagonal(apart: float, passes: bool) -> None:
    # Equal in both directions: 0.51 m and 0.71 m between the corners.
    low, right = 1.4, 2.5
    bodies = [(1.5, 0.0, right, low), (right + apart, low + apart, 3.6, D)]
    assert is_joined(bodies) is passes


def test_a_wall_has_its_exact_distance() -> None:
    assert not is_joined([(2.0, 0.0, 3.0, D - 0.57)])
    assert is_joined([(2.0, 0.0, 3.0, D - 0.66)])


def test_the_free_floor_before_a_door_is_wider_than_the_door() -> None:
    widths = [z1 - z0 for _x0, z0, _x1, z1 in room().doors.tolist()]
    assert widths == pytest.approx([0.92, 0.92])
