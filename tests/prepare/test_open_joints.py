"""Doors and drawers left open: drawn by a seed, limited by obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import House, Item
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.geometry.opened import item_at
from pbrs_farm.prepare.open_joints import STOPPED, left_open, opened
from pbrs_farm.prepare.passes import PASS
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.inputs.cupboards import box_item, cupboard


def house_of(*items: Item) -> House:
    return replace(builtin_home(), items=items)


def values(house: House) -> list[float]:
    return [joint.value for item in house.items for joint in item.joints]


def many(n: int = 60) -> House:
    """A row of chests, a metre apart."""
    return house_of(*(cupboard(JointKind.PRISMATIC, 1.0 * k, f"chest {k}") for k in range(n)))


def test_nothing_is_opened_at_a_share_of_zero() -> None:
    house = many()
    assert left_open(house, 0.0, 1) is house


@pytest.mark.quick(1)
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_about_the_given_share_is_opened_each_by_its_drawn_amount(share: float) -> None:
    far = np.array(values(left_open(many(200), share, 1)))
    assert np.mean(far > 0) == pytest.approx(share, abs=0.08)
    drawn = far[far > 0] / 0.4
    assert drawn.min() >= 0.15
    assert drawn.max() - drawn.min() > 0.5


def test_a_seed_opens_the_same_and_another_others() -> None:
    assert values(left_open(many(), 0.3, 1)) == values(left_open(many(), 0.3, 1))
    assert values(left_open(many(), 0.3, 1)) != values(left_open(many(), 0.3, 2))


def test_open_parts_stay_unchanged() -> None:
    house = house_of(item_at(cupboard(JointKind.PRISMATIC), "front", 0.05))
    assert values(left_open(house, 1.0, 1)) == [0.05]


def test_obstacles_are_reported() -> None:
    house = house_of(cupboard(JointKind.PRISMATIC), box_item("chair", (0, 0, 0.2), (0.6, 1, 0.5)))
    after = opened(house, 0, "front", 1.0)
    assert values(after)[0] == pytest.approx(0.18 - 0.004, abs=0.002)
    (note,) = [n for n in after.notes if n.kind == STOPPED]
    assert note.place == "cupboard/front"
    assert note.text == "is open by 0.18 m of 0.40 m: chair blocks it"


def test_two_fronts_that_meet_in_a_corner_do_not_pass_through_each_other() -> None:
    door = cupboard(JointKind.REVOLUTE)
    drawer = replace(item_at(cupboard(JointKind.PRISMATIC, -0.6, "beside"), "front", 0.4))
    # The hinge is at the left: at 90 degrees it is beside the drawer, and stops.
    after = opened(house_of(door, drawer), 0, "front", 1.0)
    assert 85 < np.degrees(values(after)[0]) < 91


def test_the_pass_is_for_lived_in_homes_of_recipes_that_ask_for_it() -> None:
    source = resolve("builtin")
    (lived_in,) = variants(source, [1])
    fast = recipe_from_name("fast")
    assert fast.dress.open_share == 0.1
    assert PASS["open"].is_needed(lived_in, fast)
    assert not PASS["open"].is_needed(source, fast)
    assert not PASS["open"].is_needed(lived_in, recipe_from_name("paper"))
    assert not PASS["open"].is_needed(lived_in, Recipe())
    # It changes only homes with opened parts: dressing does not depend on it.
    open_share = recipe_from_name("fast", {"dress.open_share": "0.5"})
    assert PASS["dress"].depends(lived_in, fast) == PASS["dress"].depends(lived_in, open_share)
    assert PASS["open"].depends(lived_in, fast) != PASS["open"].depends(lived_in, open_share)
