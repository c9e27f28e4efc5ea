"""Pieces that fill a free wall have its length and the room's height, and are never in front of a door."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import Item
from pbrs_farm.dress.filled_walls import KINDS, fill_wall
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.room_floor import RoomFloor
from pbrs_farm.dress.space import house_space
from pbrs_farm.dress.space.wall_faces import WallFace
from pbrs_farm.furnishings.things.families import with_families
from pbrs_farm.read.builtin.builtin_home import builtin_home

CATALOGUE = with_families(EMPTY)


def filled(seed: int, share: float = 3.0) -> tuple[MutableHouse, list[tuple[Item, RoomFloor]]]:
    """Pieces added to the built-in home, each with its room's free floor before; share 3 makes all chances 1."""
    house, pieces = MutableHouse(builtin_home(), seed), []
    space = house_space(house)
    for room in space.rooms:
        before = len(house.items)
        floor, free = RoomFloor.of(house, space, room), RoomFloor.of(house, space, room)
        if floor is not None and free is not None:
            fill_wall(house, CATALOGUE, floor, "furniture", share)
            pieces += [(item, free) for item in house.items[before:]]
    return house, pieces


def test_a_filled_wall_has_no_space_beside_the_piece() -> None:
    _, pieces = filled(1)
    assert pieces
    for item, floor in pieces:
        low, high = item.bounds
        plan = shapely.box(low[0], low[2], high[0], high[2])
        assert shapely.contains(floor.free, plan), "in the room, and in no wall"
        assert not shapely.intersects(floor.kept, plan), "nobody needs the floor there"
        wide = float((high - low)[[0, 2]].max())
        assert wide >= 1.3
        ceiling = float(floor.room.ceiling_y(np.array([[(low[0] + high[0]) / 2, (low[2] + high[2]) / 2]]))[0])  # fmt: skip
        assert min(ceiling - 0.02, 2.7) - float(high[1]) == pytest.approx(0, abs=0.01)
        # A hand's width longer and it would not fit.
        face = max(floor.faces, key=lambda f: _covers(f, item))
        s = face.s_of(np.asarray(item.bounds))
        y = floor.room.room.floor_y
        longer = face.free_m(float(s.min()) - 0.1, float(s.max()) + 0.1, y + 0.1, y + 2.0)
        assert longer < 0.9 or wide > 4.3


def _covers(face: WallFace, item: Item) -> float:
    out = face.out_of(np.asarray(item.bounds))
    s = face.s_of(np.asarray(item.bounds))
    return float(np.ptp(s)) if -0.01 < out.min() < 0.05 else -1.0


def test_equal_seeds_fill_equal_walls_and_a_share_of_zero_none() -> None:
    first, two = (house.items for house, _ in (filled(2), filled(2)))
    assert [i.id for i in first] == [i.id for i in two]
    assert all(np.array_equal(a.bounds, b.bounds) for a, b in zip(first, two, strict=True))
    assert filled(2, share=0.0)[1] == []


def test_every_kind_is_a_group_of_the_catalogue() -> None:
    assert all(CATALOGUE.of(group) for group in KINDS)
