"""Furnished homes by seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, PlanOpening, PlanRoom, RoomType
from pbrs_farm.generate.generated_home import (
    DrawnHome,
    drawn_home,
    furnish_report,
    generate_home,
    with_other_uses,
    with_rooms_of,
)
from pbrs_farm.generate.plan_families import plan_families
from pbrs_farm.generate.programme import Wishes
from tests.generate.furnish.shelves import plain_catalogue


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", [9, 12, 29])
def test_a_drawn_home_breaks_no_gate(seed: int) -> None:
    home = drawn_home(np.random.default_rng(seed), plain_catalogue())
    assert home.broken == ()


def test_the_same_seed_gives_the_same_home() -> None:
    wishes = Wishes((0, 1))
    first = drawn_home(np.random.default_rng(4), plain_catalogue(), wishes=wishes)
    assert drawn_home(np.random.default_rng(4), plain_catalogue(), wishes=wishes) == first


def _rooms(home: DrawnHome) -> list[tuple[PlanRoom, set[str]]]:
    """Each room with the groups of its furniture."""
    return [
        (room, {p.piece.group for p in storey.pieces if p.room == number})
        for storey in home.storeys
        for number, room in enumerate(storey.plan.rooms)
    ]


@pytest.mark.quick(1)
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


def test_offices_leave_the_largest_bedroom_and_have_distinct_names() -> None:
    wishes = Wishes((3, 3), offices=2)
    home = drawn_home(np.random.default_rng(6), plain_catalogue(), wishes=wishes)
    rooms = [room for room, _ in _rooms(home)]
    assert {r.name for r in rooms if r.type is RoomType.OFFICE} == {"Office 1", "Office 2"}
    assert [r.type for r in rooms].count(RoomType.BEDROOM) == 1


def _row_of_rooms(*rooms: tuple[RoomType, float]) -> Plan:
    """Rooms of these widths in a row, 3 m deep; a bathroom is entered from the previous room."""
    plan_rooms, doors, x = [], [], 0.0
    for number, (type_, width) in enumerate(rooms):
        polygon = ((x, 0.0), (x + width, 0.0), (x + width, 3.0), (x, 3.0))
        plan_rooms.append(PlanRoom(type_, f"{type_.label} {number}", polygon))
        x += width
        if type_ is RoomType.BATHROOM:
            door = PlanOpening(OpeningKind.DOOR, 0, 1.0, 0.8, 2.1, 0.0, number, number - 1)
            doors.append(door)
    return Plan(tuple(plan_rooms), (), tuple(doors), 2.5)


def _offices_of(n: int, *storeys: Plan) -> dict[tuple[int, int], str]:
    return {
        (storey, number): room.name
        for storey, plan in enumerate(with_rooms_of(storeys, RoomType.OFFICE, n))
        for number, room in enumerate(plan.rooms)
        if room.type is RoomType.OFFICE
    }


def test_the_smallest_bedrooms_become_offices_first_those_without_a_bathroom() -> None:
    bed, bath = RoomType.BEDROOM, RoomType.BATHROOM
    plan = _row_of_rooms((bed, 5), (bed, 3), (bath, 2), (bed, 4))
    assert _offices_of(0, plan) == {}
    # The smallest has an ensuite bathroom.
    assert _offices_of(1, plan) == {(0, 3): "Office"}
    assert _offices_of(2, plan) == {(0, 1): "Office 1", (0, 3): "Office 2"}
    # The largest bedroom stays, also if it is the only one without a bathroom.
    largest_first = _row_of_rooms((bed, 3), (bath, 2), (bed, 5))
    assert _offices_of(1, largest_first) == {(0, 0): "Office"}
    upstairs = _row_of_rooms((bed, 2.5), (bed, 6))
    assert _offices_of(2, plan, upstairs) == {(0, 3): "Office 1", (1, 0): "Office 2"}


def test_offices_and_dining_rooms_appear_by_chance_where_a_bedroom_is_spare() -> None:
    bed, kitchen = RoomType.BEDROOM, RoomType.KITCHEN
    plan = replace(_row_of_rooms((bed, 5), (bed, 3), (bed, 4), (kitchen, 3)), family="us")

    def types(seed: int, wishes: Wishes) -> list[RoomType]:
        (drawn,) = with_other_uses((plan,), wishes, np.random.default_rng(seed))
        return [room.type for room in drawn.rooms]

    by_seed = [types(seed, Wishes()) for seed in range(300)]
    family = plan_families()["us"]
    shares = [np.mean([t in row for row in by_seed]) for t in (RoomType.DINING, RoomType.OFFICE)]
    assert shares == pytest.approx([family.dining_room, family.office], abs=0.1)
    # The dining room is beside the kitchen, the office is the smallest bedroom, the largest stays.
    assert [bed, RoomType.OFFICE, RoomType.DINING, kitchen] in by_seed
    assert all(row[0] is bed for row in by_seed)
    # A wish for bedrooms or offices leaves nothing to chance.
    as_wished = [
        types(seed, wishes) for seed in range(20) for wishes in (Wishes((3, 4)), Wishes(offices=0))
    ]
    assert all(row == [bed, bed, bed, kitchen] for row in as_wished)


def test_an_office_without_a_desk_breaks_a_gate() -> None:
    home = drawn_home(np.random.default_rng(5), plain_catalogue(), wishes=Wishes((3, 3), offices=1))
    (storey,) = home.storeys
    without = tuple(p for p in storey.pieces if p.piece.group != "desk")
    assert "Office: no desk" in furnish_report(storey.plan, without, plain_catalogue()).broken


@pytest.mark.parametrize("seed", [1, 3])
def test_a_home_with_an_office_has_a_bedroom_too(seed: int) -> None:
    home = generate_home(MadeHome(seed, offices=1), EMPTY)
    types = [room.type for storey in home.storeys for room in storey.plan.rooms]
    assert types.count(RoomType.OFFICE) == 1
    assert RoomType.BEDROOM in types
