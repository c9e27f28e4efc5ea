"""Furnished homes by seed."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.generate.drawn_home import DrawnHome, drawn_home
from pbrs_farm.generate.floor_plan import PlanRoom, RoomType
from pbrs_farm.generate.programme import Wishes
from tests.generate.furnish.shelves import plain_catalogue


@pytest.mark.parametrize("seed", [9, 12, 29])
def test_a_drawn_home_breaks_no_gate(seed: int) -> None:
    home = drawn_home(np.random.default_rng(seed), plain_catalogue())
    assert home.broken == ()


def test_the_same_seed_gives_the_same_home() -> None:
    wishes = Wishes((0, 1))
    first = drawn_home(np.random.default_rng(4), plain_catalogue(), wishes=wishes)
    assert drawn_home(np.random.default_rng(4), plain_catalogue(), wishes=wishes) == first


def _rooms(home: DrawnHome) -> list[tuple[PlanRoom, set[str]]]:
    """Each room with the groups of what stands in it."""
    return [
        (room, {p.piece.group for p in storey.pieces if p.room == number})
        for storey in home.storeys
        for number, room in enumerate(storey.plan.rooms)
    ]


@pytest.mark.parametrize("storeys", [1, 2])
def test_an_office_is_a_small_bedroom_with_a_desk_for_a_bed(storeys: int) -> None:
    wishes = Wishes((3, 3), storeys=storeys, offices=1)
    home = drawn_home(np.random.default_rng(5), plain_catalogue(), wishes=wishes)
    rooms = _rooms(home)
    ((office, stands),) = [row for row in rooms if row[0].type is RoomType.OFFICE]
    bedrooms = [room for room, _ in rooms if room.type is RoomType.BEDROOM]
    assert home.broken == ()
    assert office.name == "Office"
    assert "desk" in stands
    assert "bed" not in stands
    assert len(bedrooms) == 2
    assert max(room.area for room in bedrooms) >= office.area


def test_offices_leave_the_largest_bedroom_and_have_names_of_their_own() -> None:
    wishes = Wishes((3, 3), offices=2)
    home = drawn_home(np.random.default_rng(6), plain_catalogue(), wishes=wishes)
    rooms = [room for room, _ in _rooms(home)]
    assert {r.name for r in rooms if r.type is RoomType.OFFICE} == {"Office 1", "Office 2"}
    assert [r.type for r in rooms].count(RoomType.BEDROOM) == 1
