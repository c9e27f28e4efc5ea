"""Families of plans."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.made_home import PLANS
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.layout import easier_programmes
from pbrs_farm.generate.plan_families import plan_families
from pbrs_farm.generate.programme import Programme, RoomWish, Wishes
from pbrs_farm.generate.slicing_goals import Brief, IntRect, Rules, SliceLeaf


def test_every_family_with_a_name_is_drawn_by_at_least_one_seed_in_twenty() -> None:
    families = plan_families()
    assert set(families) == set(PLANS)
    assert sum(family.weight for family in families.values()) == pytest.approx(1.0)
    assert min(family.weight for family in families.values()) >= 0.05


def test_shares_of_bedrooms_and_blind_sides_add_up() -> None:
    for name, family in plan_families().items():
        assert sum(family.bedroom_shares) == pytest.approx(1.0), name
        assert sum(family.blind_shares) == pytest.approx(1.0), name


def test_a_window_and_a_door_fit_below_the_lowest_ceiling_of_their_family() -> None:
    for name, family in plan_families().items():
        tops = (family.window.sill + family.window.height, family.french_height, family.door_height)
        assert max(tops) + 0.1 < min(family.heights), name


def test_a_home_without_place_for_its_court_is_tried_with_a_corner_left_out() -> None:
    wishes = (RoomWish(RoomType.LIVING, 20.0), RoomWish(RoomType.HALL, 6.0))
    steps = easier_programmes(Programme(wishes, notch=8.0, is_court=True))
    assert [(p.notch > 0, p.is_court) for _, p in steps[:3]] == [
        (True, True), (True, False), (False, False),
    ]  # fmt: skip


@pytest.mark.slow
def test_a_japanese_bedroom_is_entered_from_the_living_room() -> None:
    plan = drawn_plan(np.random.default_rng(1), Wishes((1, 1), plans="japanese"))
    types = [room.type for room in plan.rooms]
    bedroom = types.index(RoomType.BEDROOM)
    ways = {types[k] for o in plan.openings_of(bedroom) for k in (o.room, o.other) if k is not None}
    assert RoomType.LIVING in ways
    assert RoomType.HALL not in ways
    assert plan.height in plan_families()["japanese"].heights


def test_where_there_is_no_living_room_bedrooms_are_entered_from_the_hall() -> None:
    upper = Programme((RoomWish(RoomType.BEDROOM, 12.0),), is_upper=True, plans="japanese")
    assert upper.entered_from(RoomType.BEDROOM) == (RoomType.HALL,)


@pytest.mark.parametrize(
    ("court", "fits"),
    [
        ((60, 0, 100, 40), True),  # in the middle of a side
        ((0, 0, 60, 40), False),  # in a corner
        ((60, 60, 100, 100), False),  # inside
        ((60, 0, 130, 40), False),  # with an arm of 1.5 m beside it
    ],
)
def test_a_court_leaves_out_the_middle_of_one_side(court: IntRect, *, fits: bool) -> None:
    leaf = SliceLeaf(4.0, 0.5, is_court=True)
    brief = Brief((leaf,), (), 0, 160, 160, (True, True, True, True))
    _cost, unmet = Rules(brief).judge([court])
    assert (unmet == 0) == fits
