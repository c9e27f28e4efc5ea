"""Items on the floor keep clear of doors, ways and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import Item
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.dress.clutter import add_clutter
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import FloorCells, doors_are_joined, house_space
from pbrs_farm.dress.style import style_for
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.dress.furniture import DEPTH, WIDTH, house, solid


def _dressed(seed: int) -> MutableHouse:
    mutable = MutableHouse(builtin_home(), seed)
    add_clutter(mutable, EMPTY, style_for(np.random.default_rng(seed), "nordic"), 1.0)
    return mutable


def _on_floor(mutable: MutableHouse) -> list[Item]:
    floors = {r.id: r.floor_y for r in mutable.source.rooms}
    added = mutable.items[len(mutable.source.items) :]
    return [i for i in added if abs(i.bounds[0, 1] - floors[i.room_id or ""]) < 0.01]


def test_items_on_the_floor_touch_it_inside_their_room() -> None:
    things = [(d, i) for seed in range(3) for d in [_dressed(seed)] for i in _on_floor(d)]
    assert len(things) >= 3
    for mutable, item in things:
        room = mutable.source.room(item.room_id or "")
        assert 0 <= item.bounds[0, 1] - room.floor_y < 0.0005
        (x0, z0), (x1, z1) = item.bounds[:, [0, 2]]
        assert shapely.Polygon(room.polygon).contains(shapely.box(x0, z0, x1, z1))


@pytest.mark.long
def test_no_item_is_before_a_door_and_the_doors_stay_connected() -> None:
    for seed in range(3):
        bare, dressed = MutableHouse(builtin_home(), seed), _dressed(seed)
        space, before = house_space(dressed), house_space(bare)
        footprints = [shapely.box(*i.bounds[:, [0, 2]].ravel()) for i in _on_floor(dressed)]
        for room in space.rooms:
            for door in room.doors:
                side = door.side_of(room.room.id)
                if side is not None:
                    zone = door.before(side).union(door.swing(side))
                    assert not any(zone.intersects(f) for f in footprints)
            was = before.room(room.room.id)
            if doors_are_joined(FloorCells(before, was).bitmap(), was):
                assert doors_are_joined(FloorCells(space, room).bitmap(), room)


def test_boxes_and_bins_are_at_walls_and_not_beside_a_free_table() -> None:
    table = solid("Table", [1.5, 0, 1.0], [2.5, 0.75, 2.0], 7)
    n = 0
    for seed in range(3):
        mutable = MutableHouse(house(table, name="Garage"), seed)
        add_clutter(mutable, EMPTY, style_for(np.random.default_rng(seed), "nordic"), 1.0)
        for item in _on_floor(mutable):
            (x0, z0), (x1, z1) = item.bounds[:, [0, 2]]
            assert min(x0, z0, WIDTH - x1, DEPTH - z1) < 0.35, item.name
            n += 1
    assert n > 3


def test_the_floor_before_a_wardrobe_stays_free() -> None:
    # The front is the box's third axis, +z: a strip of the wardrobe's width, 0.6 m deep.
    wardrobe = solid("Wardrobe", [0.5, 0, 0], [3.5, 2.0, 0.6], 3)
    low = solid("Bed", [0, 0, 1.8], [4, 0.5, 3], 4)
    before = shapely.box(0.5, 0.6, 3.5, 1.2)
    for seed in range(4):
        mutable = MutableHouse(house(wardrobe, low, name="Bedroom"), seed)
        add_clutter(mutable, EMPTY, style_for(np.random.default_rng(seed), "nordic"), 1.0)
        for item in _on_floor(mutable):
            footprint = shapely.box(*item.bounds[:, [0, 2]].ravel())
            assert before.intersection(footprint).area < 1e-4, item.name


def test_the_floor_before_a_drawer_stays_free() -> None:
    # A drawer of a desk, whose class has no fronts, that comes out by 1.1 m.
    body = solid("Desk", [0.5, 0, 0], [3.5, 0.7, 0.6], 14)
    front = replace(solid("", [0.5, 0.2, 0.6], [3.5, 0.6, 0.62]).surfaces[0], part="drawer")
    joint = Joint("drawer", JointKind.PRISMATIC, (0, 0, 0), (0, 0, 1), 1.1)
    desk = replace(body, surfaces=(*body.surfaces, front), joints=(joint,))
    swept, n = shapely.box(0.5, 0.6, 3.5, 1.72), 0
    for seed in range(5):
        mutable = MutableHouse(house(desk, name="Garage"), seed)
        add_clutter(mutable, EMPTY, style_for(np.random.default_rng(seed), "nordic"), 1.0)
        for item in _on_floor(mutable):
            footprint = shapely.box(*item.bounds[:, [0, 2]].ravel())
            assert swept.intersection(footprint).area < 1e-4, item.name
            n += 1
    assert n > 3


def test_a_room_without_free_floor_gets_nothing() -> None:
    full = solid("Block", [0, 0, 0], [4, 1.0, 3], 39)
    mutable = MutableHouse(house(full), 1)
    add_clutter(mutable, EMPTY, style_for(np.random.default_rng(1), "nordic"), 1.0)
    assert not _on_floor(mutable)


def test_a_room_of_two_corners_is_unchanged() -> None:
    home = house()
    flat = replace(home.rooms[0], polygon=np.array([[0.0, 0.0], [1.0, 0.0]]))
    mutable = MutableHouse(replace(home, rooms=(flat,)), 1)
    add_clutter(mutable, EMPTY, style_for(np.random.default_rng(1), "nordic"), 1.0)
    assert not _on_floor(mutable)
