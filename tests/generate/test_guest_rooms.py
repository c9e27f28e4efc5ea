"""Small rooms cut from larger ones: strips and corners that leave both a valid size."""

from __future__ import annotations

import pytest

from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.guest_rooms import cut_guests, daylight_m, hosts_of
from pbrs_farm.generate.programme import Programme, RoomWish
from pbrs_farm.generate.slicing_goals import STEP_M, Brief, IntRect, shared_length

ALL_LIT = (True, True, True, True)
# A living room on the left, a bedroom at the top right, the hall below it.
LIVING, BEDROOM, HALL = (0, 0, 100, 140), (100, 0, 190, 100), (100, 100, 190, 140)


def cut(small: RoomWish, bedroom: IntRect = BEDROOM) -> tuple[set[int], list[tuple[IntRect, ...]]]:
    rooms = (
        RoomWish(RoomType.LIVING, 30), RoomWish(RoomType.BEDROOM, 16), small,
        RoomWish(RoomType.HALL, 8), RoomWish(RoomType.BATHROOM, 6),
    )  # fmt: skip
    programme = Programme(rooms)
    parts: list[tuple[IntRect, ...]] = [(LIVING,), (bedroom,), (), (HALL,), ()]
    brief = Brief((), (), 0, 190, 140, ALL_LIT)
    return cut_guests(parts, programme, {2: 1}, brief, None), parts


def area(rects: tuple[IntRect, ...]) -> float:
    return sum((x1 - x0) * (z1 - z0) for x0, z0, x1, z1 in rects) * STEP_M**2


@pytest.mark.parametrize("type_", [RoomType.STORE, RoomType.WARDROBE, RoomType.WC])
def test_a_guest_and_the_rest_of_its_host_fill_the_hosts_floor(type_: RoomType) -> None:
    uncut, parts = cut(RoomWish(type_, 2.4))
    assert uncut == set()
    (guest,) = parts[2]
    assert area(parts[1]) + area(parts[2]) == pytest.approx(area((BEDROOM,)))
    # The walls around it reduce its area.
    assert 2.4 <= area(parts[2]) <= 2.4 * 1.45
    assert any(shared_length(guest, rest) > 0 for rest in parts[1])


def test_a_store_and_its_host_both_keep_a_door_to_the_hall() -> None:
    _uncut, parts = cut(RoomWish(RoomType.STORE, 2.4))
    for rects in (parts[1], parts[2]):
        assert max(shared_length(r, HALL) for r in rects) * STEP_M >= 1.1


def test_a_room_too_small_for_a_guest_keeps_its_floor() -> None:
    small = (100, 45, 155, 100)
    uncut, parts = cut(RoomWish(RoomType.WARDROBE, 3.4), small)
    assert uncut == {2}
    assert parts[1] == (small,)


def test_a_room_that_must_adjoin_another_is_cut_from_none() -> None:
    rooms = (
        RoomWish(RoomType.LIVING, 30), RoomWish(RoomType.KITCHEN, 9), RoomWish(RoomType.STORE, 2),
        RoomWish(RoomType.BATHROOM, 6), RoomWish(RoomType.HALL, 8),
    )  # fmt: skip
    assert hosts_of(Programme(rooms)) == {2: 1}
    assert hosts_of(Programme(rooms, adjacent=((2, (0,)),))) == {}


@pytest.mark.parametrize("area", [10.0, 17.0, 23.2, 45.0])
def test_the_wall_that_a_room_is_promised_holds_its_glass(area: float) -> None:
    # A French window of 2.1 m between the halves of the outer walls, 35 cm from each.
    width = daylight_m(area) - 0.26 - 2 * 0.35
    assert width * 2.1 >= area / 8
