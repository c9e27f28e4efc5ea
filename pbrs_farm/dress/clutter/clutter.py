"""The pass `clutter`: small items on every room's furniture, shelves, beds, seats and floor. Effects: changes the house."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import BED, CHAIR, SOFA
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.dress.clutter.beds import dress_bed
from pbrs_farm.dress.clutter.cloths import drop_clothes, lay_throw
from pbrs_farm.dress.clutter.cushions import dress_seat, find_seat
from pbrs_farm.dress.clutter.floors import fill_floor
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.clutter.receptacles import can_hold, receptacle_of
from pbrs_farm.dress.clutter.shelves import fill_shelf, plan_shelves
from pbrs_farm.dress.clutter.stock import Stock
from pbrs_farm.dress.clutter.table_tops import fill_top, set_table
from pbrs_farm.dress.content import content
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace, house_space
from pbrs_farm.dress.style import Style, room_style
from pbrs_farm.dress.supports import supports_of_item
from pbrs_farm.dress.worktop import Worktop
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind

_LEAST_SHELF_DEPTH_M = 0.12
_DOOR_MARGIN_M = 0.02  # kept free around the area that a door sweeps
_THROWN = 0.9  # chance that a sofa has a throw, at mess 1
_SEAT_M = 0.72  # wide: a chair, wider ones are armchairs
_ON_SEAT_M = 0.2  # distance of dropped clothes from a seat's back
_LAID = 0.3  # chance that a dining table is laid
_ON_TOP_M = 0.1  # maximum gap between a screen's foot and the piece below it, metres
_SCREENS = ("laptop", "monitor")
_SCREEN_WORDS = frozenset({"laptop", "computer", "monitor", "screen", "notebook", "pc", "imac"})


def add_clutter(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Add small items where they belong, by a generator per room; refusals are counted."""
    space = house_space(house)
    scene = SceneTriangles(house.items)
    covers = content().book_covers(house.rng("clutter", "covers"), style)
    stock = Stock(catalogue, covers, int(house.rng("clutter", "stock").integers(1 << 31)))
    bias = house_bias(house.rng("clutter", "bias"))
    owners = _owners(scene, space)
    for room in space.rooms:
        rng = house.rng("clutter", room.room.id)
        style_of_room = room_style(style, house.rng("style", room.room.id))
        placing = Placing(house, stock, room.room, style_of_room, rng, share, bias, room.kind)
        _fill_room(placing, scene, room, owners)
        fill_floor(placing, scene, space, room)


def house_bias(rng: np.random.Generator) -> float:
    """A home's bias of fill levels, -0.15..0.25: ProcTHOR's Beta(3.5, 1.9), raised (Deitke et al. 2022)."""
    return float(rng.beta(3.5, 1.9) * 0.4 - 0.15)


def _door_zone(room: RoomSpace) -> BaseGeometry:
    """Where leaves swing and people go: nothing is put there, not even on a shelf."""
    sides = [(door, door.side_of(room.room.id)) for door in room.doors]
    zones = [d.before(s, d.clear_m).union(d.swing(s)) for d, s in sides if s is not None]
    return shapely.union_all(zones).buffer(_DOOR_MARGIN_M)


def _owners(scene: SceneTriangles, space: HouseSpace) -> dict[int, str]:
    """The room that fills each item: its own, else the first that contains it."""
    owners: dict[int, str] = {}
    for room in space.rooms:
        for index in room.items:
            if index not in owners or scene.items[index].room_id == room.room.id:
                owners[index] = room.room.id
    return owners


def _fill_room(
    placing: Placing, scene: SceneTriangles, room: RoomSpace, owners: Mapping[int, str]
) -> None:
    zone = _door_zone(room)
    for index in room.items:
        item = scene.items[index] if index < len(scene.items) else None
        if item is None or owners[index] != room.room.id:
            continue
        if can_hold(item):
            _fill_item(placing, scene, room, index, zone)
        elif item.kind is ItemKind.OBJECT and item.nyu40 == BED:
            dress_bed(placing, scene, index)
        elif item.kind is ItemKind.OBJECT and item.nyu40 in (SOFA, CHAIR):
            _dress_seat(placing, scene, index, item)


def _fill_item(
    placing: Placing, scene: SceneTriangles, room: RoomSpace, index: int, zone: BaseGeometry
) -> None:
    plan, item = None, scene.items[index]
    screens = _SCREENS if _has_screen(scene, room, index) else ()
    for support in supports_of_item(scene, index, room.room):
        receptacle = receptacle_of(item, support, room.kind)
        if not receptacle:
            continue
        top = Worktop(support)
        top.keep_free(zone)
        if receptacle == "shelf":
            plan = plan or plan_shelves(placing, room.kind)
            if top.depth >= _LEAST_SHELF_DEPTH_M:
                fill_shelf(placing, top, plan)
        else:
            if receptacle == "dining_table" and placing.rng.random() < _LAID * placing.share:
                set_table(placing, top, _chairs(scene, room), scene)
            fill_top(placing, top, receptacle, screens)


def _has_screen(scene: SceneTriangles, room: RoomSpace, index: int) -> bool:
    """True if the home has a laptop or monitor on items[index]."""
    low, high = scene.bounds[index]
    for k in room.items:
        middle, foot = scene.bounds[k].mean(0), scene.bounds[k][0, 1]
        is_over = (low < middle)[[0, 2]].all() and (middle < high)[[0, 2]].all()
        is_on = low[1] < foot < high[1] + _ON_TOP_M
        if k != index and is_over and is_on and words_of_item(scene.items[k]) & _SCREEN_WORDS:
            return True
    return False


def _chairs(scene: SceneTriangles, room: RoomSpace) -> list[F64]:
    """Plan points (2,) of the middles of the room's chairs."""
    chairs = [k for k in room.items if scene.items[k].nyu40 == CHAIR]
    return [scene.bounds[k].mean(0)[[0, 2]] for k in chairs]


def _dress_seat(placing: Placing, scene: SceneTriangles, index: int, item: Item) -> None:
    low, high = item.bounds
    width = float(max(high[0] - low[0], high[2] - low[2]))
    # Chairs at tables carry none, armchairs one now and then.
    mess, kind = placing.house.mess, placing.kind
    if item.nyu40 == SOFA:
        # A throw first: cushions need its place, and find it taken.
        if width > 1.2 and placing.rng.random() < _THROWN * mess * placing.share:
            lay_throw(placing, scene, index)
        else:
            dress_seat(placing, scene, index, 6 if width > 1.8 else 4 if width > 1.5 else 2)
    elif width < _SEAT_M and kind is RoomKind.BEDROOM and placing.rng.random() < mess:
        seat = find_seat(scene, index, placing.room.floor_y)
        if seat is not None:
            rows = seat.back_row[np.isfinite(seat.back_row)]
            column = float(np.flatnonzero(np.isfinite(seat.back_row)).mean())
            position = seat.grid.plan_of(column, float(rows.max()) + _ON_SEAT_M / seat.grid.cell_m)
            drop_clothes(placing, scene, position, seat.level)
    elif width > 0.72 and placing.rng.random() < 0.5:
        dress_seat(placing, scene, index, 1)
