"""Rooms as dressing sees them: free stretches of walls, doors, windows, floors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.house import House, Item, ItemKind, Room
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import (
    FloorCells,
    HouseSpace,
    RoomSpace,
    WallFace,
    doors_are_joined,
    house_space,
    item_footprint,
)
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.builtin.builtin_home import builtin_home


@pytest.fixture(scope="module")
def home() -> House:
    return builtin_home()


@pytest.fixture(scope="module")
def space(home: House) -> HouseSpace:
    return house_space(MutableHouse(home, 1))


def _face(room: RoomSpace, normal: tuple[float, float, float]) -> WallFace:
    return next(f for f in room.faces if np.allclose(f.normal, normal, atol=1e-6))


def _block(name: str, low: tuple[float, ...], high: tuple[float, ...]) -> Item:
    low_, high_ = np.array(low), np.array(high)
    surface = box(name, (low_ + high_) / 2, (high_ - low_) / 2, 0)
    return Item(name, name, ItemKind.OBJECT, "0", (surface,), 7)


def test_each_room_sees_its_four_walls_at_their_faces(space: HouseSpace) -> None:
    living = space.room("0_0")
    assert len(living.faces) == 4
    east = _face(living, (-1, 0, 0))
    assert east.origin[0] == pytest.approx(5.0, abs=1e-6)
    assert east.length == pytest.approx(4.0, abs=0.05)
    assert (east.low_y, east.high_y) == (0.0, pytest.approx(2.5, abs=0.03))


def test_the_face_follows_the_wall_and_not_an_outline_that_is_off(home: House) -> None:
    wide = shapely.Polygon(home.rooms[0].polygon).buffer(0.06, join_style="mitre")
    outline = np.array(wide.exterior.coords)[:-1]
    moved = replace(home, rooms=(replace(home.rooms[0], polygon=outline), home.rooms[1]))
    east = _face(house_space(MutableHouse(moved, 1)).room("0_0"), (-1, 0, 0))
    assert east.origin[0] == pytest.approx(5.0, abs=1e-6)


def test_s_runs_to_the_right_facing_the_wall(space: HouseSpace) -> None:
    east = _face(space.room("0_0"), (-1, 0, 0))
    assert np.allclose(np.cross([0, 1, 0], east.normal), east.along)
    assert np.allclose(east.point(0.5, 1.0, 0.1), east.origin + 0.5 * east.along + [-0.1, 1.0, 0])


def test_openings_keep_ten_centimetres_of_wall(space: HouseSpace) -> None:
    north = _face(space.room("0_0"), (0, 0, 1))
    # The window is 1.6..3.4 m along x, 0.9..2.1 m high.
    assert north.free_m(1.1, 1.45, 1.9, 2.2) > 0.5
    assert north.free_m(1.1, 1.55, 1.9, 2.2) == 0
    assert north.free_m(2.0, 2.5, 2.3, 2.4) > 0.5


def test_furniture_takes_the_wall_behind_it(space: HouseSpace) -> None:
    north = _face(space.room("0_0"), (0, 0, 1))
    # The bookshelf is in front of this wall at x = 3.6.
    s = float(north.s_of(np.array([[3.6, 0, 0]]))[0])
    assert north.free_m(s - 0.2, s + 0.2, 0.5, 1.0) < 0.05


def test_starts_are_where_the_item_fits(space: HouseSpace) -> None:
    east = _face(space.room("0_0"), (-1, 0, 0))
    starts = east.starts(0.6, 1.3, 1.8, 0.3)
    assert len(starts)
    assert all(east.free_m(s, s + 0.6, 1.3, 1.8) >= 0.3 for s in starts)
    assert not len(east.starts(9.0, 1.3, 1.8, 0.3))
    taken = east.taken(0.0, 9.0, 1.0, 2.0)
    assert not len(taken.starts(0.6, 1.3, 1.8, 0.3))


def test_a_door_knows_its_rooms_and_the_space_before_it(space: HouseSpace) -> None:
    living, bedroom = space.rooms
    door = next(d for d in living.doors if d.item_id == "door_inner")
    assert set(door.room_ids) == {"0_0", "0_1"}
    assert door.half_wall == (pytest.approx(0.05), pytest.approx(0.05))
    side = door.side_of("0_1")
    assert side is not None
    before = door.before(side)
    assert before.area == pytest.approx(0.9 * 0.8, rel=1e-6)
    assert bedroom.area.contains(before.centroid)
    swing = door.swing(side)
    assert before.area < swing.area < 0.9 * 0.9
    front = next(d for d in living.doors if d.item_id == "door_front")
    assert None in front.room_ids


def test_an_openings_middle_is_in_its_wall_for_any_depth_of_its_doors_box(home: House) -> None:
    inner = next(o for o in home.openings if o.item_id == "door_inner")
    normal = np.asarray(inner.normal)
    # The leaf is drawn open: the quad is in the middle of the 95 cm box instead of the wall.
    far = inner.cutter.positions @ normal > float(inner.quad.mean(0) @ normal)
    cutter = inner.cutter.positions + np.where(far[:, None], 0.8 * normal, 0.0)
    drawn = replace(
        inner, quad=inner.quad + 0.38 * normal,
        cutter=replace(inner.cutter, positions=cutter.astype(np.float32)),
    )  # fmt: skip
    openings = tuple(drawn if o is inner else o for o in home.openings)
    moved = house_space(MutableHouse(replace(home, openings=openings), 1))
    (door,) = (p for p in moved.passages if p.item_id == "door_inner")
    assert abs(float((door.centre - inner.quad.mean(0)) @ normal)) < 0.01
    assert set(door.room_ids) == {"0_0", "0_1"}


@pytest.mark.parametrize("has_hole", [True, False])
def test_a_door_without_an_opening_is_in_the_hole_of_its_wall(has_hole: bool) -> None:
    # The wall x = 2 separates two rooms; its door, drawn open, reaches 0.9 m into the left one.
    pieces = [(0.0, 1.0), (1.9, 4.0)] if has_hole else [(0.0, 4.0)]
    walls = [
        replace(_block(f"w{k}", (1.95, 0, z0), (2.05, 2.5, z1)), kind=ItemKind.WALL)
        for k, (z0, z1) in enumerate(pieces)
    ]
    leaf = _block("leaf", (1.05, 0, 1.86), (1.99, 2, 1.9))
    frame = _block("frame", (1.95, 0, 1.0), (2.05, 2, 1.02))
    door = replace(leaf, kind=ItemKind.DOOR, surfaces=(*leaf.surfaces, *frame.surfaces))
    rooms = tuple(
        Room(f"0_{k}", "", "0", np.array([[x0, 0], [x0, 4], [x1, 4], [x1, 0.0]]), 0.0, 2.5)
        for k, (x0, x1) in enumerate(((0.0, 1.95), (2.05, 4.0)))
    )
    base = builtin_home()
    house = replace(base, rooms=rooms, items=(*walls, door), openings=())
    (passage,) = house_space(MutableHouse(house, 1)).passages
    assert passage.centre[[0, 2]] == pytest.approx([2.0, 1.45], abs=0.02)
    assert abs(passage.normal[0]) == pytest.approx(1.0)
    assert passage.width == pytest.approx(0.9, abs=0.03)
    assert set(passage.room_ids) == {"0_0", "0_1"}


def test_a_window_knows_its_sill(space: HouseSpace) -> None:
    (window,) = space.room("0_1").windows
    assert (window.bottom_y, window.top_y) == (pytest.approx(0.9), pytest.approx(2.1))
    side = window.side_of("0_1")
    assert side is not None
    assert np.allclose(window.inward(side), [0, 0, -1], atol=1e-6)
    assert window.face_point(side)[2] == pytest.approx(4.0, abs=1e-6)


def test_items_belong_to_the_room_around_them(home: House, space: HouseSpace) -> None:
    for room in space.rooms:
        inside = {home.items[n].id for n in room.items}
        assert {
            i.id for i in home.items if i.room_id == room.room.id and i.nyu40 in (4, 6)
        } <= inside


def test_a_shelf_across_the_room_parts_its_doors(home: House) -> None:
    mutable = MutableHouse(home, 1)
    space = house_space(mutable)
    assert doors_are_joined(FloorCells(space, space.room("0_0")).bitmap(), space.room("0_0"))
    mutable.items.append(_block("across", (2.6, 0.0, 0.0), (2.8, 2.0, 4.0)))
    space = house_space(mutable)
    room = space.room("0_0")
    assert not doors_are_joined(FloorCells(space, room).bitmap(), room)
    new = len(mutable.items) - 1
    assert doors_are_joined(FloorCells(space, room).bitmap((new,)), room)


def test_a_new_item_takes_wall_and_the_rest_is_kept(home: House) -> None:
    mutable = MutableHouse(home, 1)
    before = house_space(mutable)
    assert house_space(mutable) is before
    east = _face(before.room("0_0"), (-1, 0, 0))
    s = float(east.starts(0.6, 1.3, 1.8, 0.3)[0])
    middle = east.point(s + 0.3, 1.5, 0.05)
    mutable.items.append(_block("thing", tuple(middle - 0.04), tuple(middle + 0.04)))
    after = _face(house_space(mutable).room("0_0"), (-1, 0, 0))
    assert after.free_m(s + 0.28, s + 0.32, 1.48, 1.52) < 0.05
    west = (1, 0, 0)
    assert _face(house_space(mutable).room("0_0"), west) is _face(before.room("0_0"), west)


def test_a_footprint_is_that_of_the_mesh_and_not_of_its_box() -> None:
    legs = [box("leg", np.array([x, 0.35, z]), np.array([0.02, 0.35, 0.02]), 0) for x in (0, 1) for z in (0, 1)]  # fmt: skip
    top = box("top", np.array([0.5, 0.72, 0.5]), np.array([0.6, 0.02, 0.6]), 0)
    table = Item("t", "t", ItemKind.OBJECT, "0", (*legs, top), 7)
    assert item_footprint(table).area == pytest.approx(1.44, rel=0.03)
    assert item_footprint(table, 0.1, 0.5).area == pytest.approx(4 * 0.04**2, rel=0.5)
    assert item_footprint(table, 1.0, 2.0).is_empty


def test_rooms_without_walls_or_outline_have_no_faces_and_do_no_harm(home: House) -> None:
    bare = replace(home, items=tuple(i for i in home.items if i.kind is not ItemKind.WALL))
    odd = Room("0_9", "", "0", np.zeros((2, 2)), 0.0, 2.5)
    space = house_space(MutableHouse(replace(bare, rooms=(*bare.rooms, odd)), 1))
    assert [len(r.faces) for r in space.rooms] == [0, 0, 0]
    for room in space.rooms:
        FloorCells(space, room).bitmap()


def test_a_sloped_ceiling_hides_the_wall_above_it(home: House) -> None:
    slope = replace(box("slope", np.array([0.0, 1.5, 2.0]), np.array([3.0, 0.02, 3.0]), 0))
    roof = Item("roof", "roof", ItemKind.CEILING, "0", (slope,), 22)
    space = house_space(MutableHouse(replace(home, items=(*home.items, roof)), 1))
    west = _face(space.room("0_0"), (1, 0, 0))
    assert west.free_m(1.0, 1.2, 1.6, 1.8) == 0
