"""A home at another time: joints and whole items follow their motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import House, MaterialKind, geometry_from_house
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.motions import Motion
from pbrs_farm.geometry.moving import MovingHouse, house_at
from tests.inputs.cupboards import box_item, cupboard
from tests.truth.hits import house

QUARTER = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)  # 90 degrees about y: +x goes to -z


def home(*motions: Motion) -> House:
    """A cupboard with a drawer, and a brick of 20 cm with its middle at (2, 0.1, 0)."""
    items = cupboard(JointKind.PRISMATIC), box_item("brick", (1.9, 0.0, -0.1), (2.1, 0.2, 0.1))
    return replace(house(), items=items, motions=motions)


PULL = Motion("cupboard", "front", (0.0, 2.0), ((0.0,), (0.4,)))
SLIDE = Motion(
    "brick", "", (0.0, 1.0), ((2, 0.1, 0, 1, 0, 0, 0), (3, 0.1, 0, *QUARTER)), (2.0, 0.1, 0.0)
)
PUSH = Motion("cupboard", "", (0.0, 1.0), ((0, 0, 0, 1, 0, 0, 0), (0, 0, 1, 1, 0, 0, 0)))


def test_a_drawer_is_out_by_its_key_and_the_rest_is_shared() -> None:
    rest = home(PULL)
    later = house_at(rest, 1.0)
    (body, front), was = later.items[0].surfaces, rest.items[0].surfaces
    assert body is was[0]
    assert later.items[1] is rest.items[1]
    assert front.positions == pytest.approx(was[1].positions + np.array([0, 0, 0.2]))
    assert later.items[0].joints[0].value == pytest.approx(0.2)


def test_an_item_moves_and_turns_with_its_box() -> None:
    later = house_at(home(SLIDE), 1.0).items[1]
    assert later.bounds == pytest.approx(np.array([[2.9, 0, -0.1], [3.1, 0.2, 0.1]]), abs=1e-6)
    assert later.oriented_box.centre == pytest.approx([3.0, 0.1, 0.0], abs=1e-6)
    assert later.oriented_box.axes[:, 0] == pytest.approx([0, 0, -1], abs=1e-9)


def test_a_drawer_follows_its_item() -> None:
    rest = home(PULL, PUSH)
    later = house_at(rest, 1.0).items[0]
    assert later.surfaces[0].positions == pytest.approx(
        rest.items[0].surfaces[0].positions + np.array([0, 0, 1])
    )
    assert later.surfaces[1].positions == pytest.approx(
        rest.items[0].surfaces[1].positions + np.array([0, 0, 1.2])
    )
    assert later.joints[0].point == pytest.approx((0, 0, 1))


def test_triangles_at_a_time_are_those_of_the_house_then() -> None:
    rest = home(PULL, SLIDE)
    moving = MovingHouse(rest, geometry_from_house(rest))
    then, geometry = moving.at(1.5)
    np.testing.assert_array_equal(geometry.positions, geometry_from_house(then).positions)
    # The front of the cupboard moves, and the whole brick.
    n = [len(s.faces) for item in rest.items for s in item.surfaces]
    np.testing.assert_array_equal(moving.moving_faces, np.repeat([False, True, True], n))


def test_faces_are_mapped_from_one_time_to_another() -> None:
    rest = home(PULL, SLIDE)
    moving = MovingHouse(rest, geometry_from_house(rest))
    numbers, matrices = moving.face_motions(0.5, 1.0)
    a, b = (moving.at(t)[1] for t in (0.5, 1.0))
    for face, number in enumerate(numbers):
        corners = a.positions[a.faces[face]] @ matrices[number][:3, :3].T + matrices[number][:3, 3]
        assert corners == pytest.approx(b.positions[b.faces[face]], abs=1e-6)
    assert matrices[0] == pytest.approx(np.eye(4))
    assert (numbers[~moving.moving_faces] == 0).all()


def test_panes_are_left_out_in_every_pose() -> None:
    rest = home(PULL, SLIDE)
    pane = replace(rest.materials[0], kind=MaterialKind.PANE)
    window = box_item("window", (0, 1, 0), (1, 2, 0.01))
    surfaces = tuple(replace(s, material=1) for s in window.surfaces)
    rest = replace(
        rest, items=(replace(window, surfaces=surfaces), *rest.items),
        materials=(rest.materials[0], pane),
    )  # fmt: skip
    then, geometry = MovingHouse.of(rest, with_panes=False).at(1.5)
    expected = geometry_from_house(then, with_panes=False)
    np.testing.assert_array_equal(geometry.positions, expected.positions)
    assert len(geometry.positions) < len(geometry_from_house(then).positions)
