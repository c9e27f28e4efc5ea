"""Stairs of a room: their place, and the floor needed to step on and off."""

from dataclasses import replace

import shapely

from pbrs_farm.core.house import ItemKind
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space.flights import Flights, flights_of
from tests.dress.furniture import boards, house, room

STEPS = 10


def flights(floor_y: float = 0.0) -> Flights:
    """Ten steps of 0.25 m that rise by 0.2 m along x, from x = 0.5."""
    boxes = [
        ([0.5 + 0.25 * k, 0.2 * (k + 1) - 0.03, 1.0], [0.75 + 0.25 * k, 0.2 * (k + 1), 1.9])
        for k in range(STEPS)
    ]
    stairs = replace(boards("stairs", boxes, 38), kind=ItemKind.STAIRS)
    stair_room = replace(room(), floor_y=floor_y, ceiling_y=floor_y + 2.5)
    return flights_of(
        MutableHouse(house(stairs), 1), stair_room, shapely.Polygon(stair_room.polygon)
    )


def test_the_floor_before_the_first_step_is_kept_and_that_at_the_side_of_the_last_is_not() -> None:
    stairs = flights()
    assert stairs.before.contains(shapely.Point(0.0, 1.45))
    assert not stairs.before.intersects(shapely.Point(2.9, 2.2))
    assert abs(stairs.under.area - STEPS * 0.25 * 0.9) < 0.05


def test_upstairs_the_last_step_is_kept_clear_and_the_stairs_are_below() -> None:
    stairs = flights(2.0)
    assert stairs.before.contains(shapely.Point(3.5, 1.45))
    assert not stairs.before.intersects(shapely.Point(0.2, 1.45))
    assert stairs.under.is_empty


def test_a_room_without_stairs_keeps_nothing() -> None:
    bare_room = room()
    stairs = flights_of(MutableHouse(house(), 1), bare_room, shapely.Polygon(bare_room.polygon))
    assert stairs.under.is_empty
    assert stairs.before.is_empty
