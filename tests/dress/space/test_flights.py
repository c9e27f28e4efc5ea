"""Stairs of a room: where they stand, and where one steps on and off them."""

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
    own = replace(room(), floor_y=floor_y, ceiling_y=floor_y + 2.5)
    return flights_of(MutableHouse(house(stairs), 1), own, shapely.Polygon(own.polygon))


def test_the_floor_before_the_first_step_is_kept_and_that_at_the_side_of_the_last_is_not() -> None:
    found = flights()
    assert found.before.contains(shapely.Point(0.0, 1.45))
    assert not found.before.intersects(shapely.Point(2.9, 2.2))
    assert abs(found.under.area - STEPS * 0.25 * 0.9) < 0.05


def test_upstairs_one_steps_off_at_the_last_step_and_the_stairs_stand_below() -> None:
    found = flights(2.0)
    assert found.before.contains(shapely.Point(3.5, 1.45))
    assert not found.before.intersects(shapely.Point(0.2, 1.45))
    assert found.under.is_empty


def test_a_room_without_stairs_keeps_nothing() -> None:
    own = room()
    found = flights_of(MutableHouse(house(), 1), own, shapely.Polygon(own.polygon))
    assert found.under.is_empty
    assert found.before.is_empty
