"""The pass `mess`: displaced chairs, pictures a degree askew; clutter/ uses its share, too; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import CHAIR, DESK, PICTURE, TABLE
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Item
from pbrs_farm.dress.mutable_house import MutableHouse, moved_item
from pbrs_farm.dress.neighbours import Neighbours, things_on
from pbrs_farm.dress.space import HouseSpace, RoomSpace, house_space, item_footprint
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.swap import FREE_CUBES

PASS: Final = "mess"
_WIDEST_M: Final = 0.72  # wider chairs are armchairs and stay
_TALLEST_M: Final = 1.3
_AT_TABLE_M: Final = 0.45  # greatest distance from a chair to the table it belongs to
# Standard deviations of a chair's distance (m) and angle when nobody has just got up.
_SETTLED: Final = (0.05, np.radians(4))
_LEFT_M: Final = (0.12, 0.45)  # range of how far a chair is pulled out by someone who got up
_LEFT_TURN: Final = np.radians(28)
_TRIES: Final = 3
_ASKEW: Final = np.radians(1.6)
_HUNG_M: Final = 0.2  # smaller pictures are on furniture, metres


def move_chairs(house: MutableHouse, _catalogue: Catalogue, _style: Style, share: float) -> None:
    """Displace a share of the chairs at tables as people getting up do, where no door or item is."""
    space = house_space(house)
    around = Neighbours(house.items)
    for room in space.rooms:
        rng = house.rng(PASS, "chairs", room.room.id)
        tables = [k for k in room.items if house.items[k].nyu40 in (TABLE, DESK)]
        free = shapely.difference(room.area, room.walls)
        zone = _door_zone(room)
        for index in room.items:
            table = _table_of(house, space, index, tables)
            if table is not None and not any(things_on(around, index)):
                _pull_out(house, space, around, (index, table), (free, zone), rng, share)


def tilt_pictures(house: MutableHouse, _catalogue: Catalogue, _style: Style, share: float) -> None:
    """Rotate hung pictures by about a degree around their centre."""
    for index in range(len(house.source.items), len(house.items)):
        item = house.items[index]
        if item.nyu40 != PICTURE or item.box is None or item.box.half[:2].min() < _HUNG_M / 2:
            continue
        angle = float(house.rng(PASS, item.id).normal(0, _ASKEW)) * min(2 * share, 1.0)
        house.items[index] = moved_item(
            item, np.zeros(3), _about(item.box.axes[:, 2], angle), item.box.centre
        )


def _about(axis: F64, angle: float) -> F64:
    """(3, 3) the turn about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def _door_zone(room: RoomSpace) -> BaseGeometry:
    sides = [(door, door.side_of(room.room.id)) for door in room.doors]
    zones = [d.before(s, d.clear_m).union(d.swing(s)) for d, s in sides if s is not None]
    return shapely.union_all(zones)


def _table_of(house: MutableHouse, space: HouseSpace, index: int, tables: list[int]) -> int | None:
    """The table of a chair; None for other items and for chairs without a table."""
    item, (low, high) = house.items[index], space.bounds[index]
    size = high - low
    if item.nyu40 != CHAIR or max(size[0], size[2]) > _WIDEST_M or size[1] > _TALLEST_M:
        return None
    best: tuple[float, int] | None = None
    for k in tables:
        offsets = np.maximum(space.bounds[k][0] - high, low - space.bounds[k][1])[[0, 2]]
        away = float(np.hypot(*np.maximum(offsets, 0.0)))
        if away < _AT_TABLE_M and (best is None or away < best[0]):
            best = away, k
    return best[1] if best else None


def _pull_out(
    house: MutableHouse,
    space: HouseSpace,
    around: Neighbours,
    pair: tuple[int, int],
    areas: tuple[BaseGeometry, BaseGeometry],
    rng: np.random.Generator,
    share: float,
) -> None:
    index, table = pair
    item = house.items[index]
    out = _outwards(space, index, table)
    is_left = rng.random() < share
    before = around.n_shared(item, {index})
    for k in range(_TRIES):
        # Try less where there is no room behind it.
        factor = 1 - k / _TRIES
        if is_left:
            way, turn = rng.uniform(*_LEFT_M), rng.normal(0, _LEFT_TURN)
        else:
            way, turn = rng.normal(0, _SETTLED[0]), rng.normal(0, _SETTLED[1])
        step = out * float(way) * factor
        middle = (space.bounds[index][0] + space.bounds[index][1]) / 2
        moved = moved_item(item, step, rotation_y(float(turn) * factor), middle)
        if _chair_is_free(around, moved, index, before, areas):
            if index < len(house.source.items):
                house.change(index, moved, PASS)
            else:
                house.items[index] = moved
            house.done[f"{PASS}: chair"] += 1
            return
    house.refused[f"{PASS}: no room behind a chair"] += 1


def _outwards(space: HouseSpace, index: int, table: int) -> F64:
    """(3,) level unit vector from the table to the chair, square to the table's nearer side."""
    chair, (low, high) = space.bounds[index].mean(0), space.bounds[table]
    off = chair - np.clip(chair, low, high)
    if np.hypot(off[0], off[2]) < 0.02:
        # It is pushed in: its side is the one that its middle is nearest to.
        depths = np.array(
            [chair[0] - low[0], high[0] - chair[0], chair[2] - low[2], high[2] - chair[2]]
        )
        sides = np.array([[-1.0, 0, 0], [1.0, 0, 0], [0, 0, -1.0], [0, 0, 1.0]])
        return np.asarray(sides[int(np.argmin(depths))])
    off[1] = 0.0
    return np.asarray(off / np.linalg.norm(off))


def _chair_is_free(
    around: Neighbours,
    moved: Item,
    index: int,
    before: int,
    areas: tuple[BaseGeometry, BaseGeometry],
) -> bool:
    body = item_footprint(moved)
    if not shapely.contains(areas[0], body) or shapely.intersects(areas[1], body):
        return False
    return around.n_shared(moved, {index}) <= before + FREE_CUBES
