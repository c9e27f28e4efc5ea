"""The pass `lamps`: which rooms lack light, and what lamps they get; floor and table lamps. Effects: changes the house."""

from __future__ import annotations

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.classes import NIGHT_STAND, SOFA
from pbrs_farm.core.house import ItemKind
from pbrs_farm.dress.ceiling_lamps import PASS, hang_from_ceiling
from pbrs_farm.dress.fitting_pieces import own_or_all
from pbrs_farm.dress.made_lamps import floor_lamp, table_lamp, with_flux
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import FloorCells, HouseSpace, RoomSpace, doors_are_joined, house_space
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.hanging import WANTS, next_id
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.surface_points import item_triangles
from pbrs_farm.home.lamps import flux_for_floor, flux_of_lamps
from pbrs_farm.home.room_use import RoomKind

_BY_SOFA, _BY_BED = 0.75, 0.75  # chances
_FLOOR_LM, _TABLE_LM = 900.0, 400.0
_STANDING_FROM_WALL_M = 0.6  # maximum distance of a floor lamp from the room's edge, metres
_WEAK_LX = 20  # rooms with less light get one more lamp
_LEAST_M2 = 0.8
_FLUX_LM = (500.0, 9000.0)  # least and greatest flux of an added lamp


def stand_by_sofas(
    house: MutableHouse, catalogue: Catalogue, style: Style, room_id: str, rng: np.random.Generator
) -> None:
    """A floor lamp at one end of a sofa, where the floor is free and every way stays open."""
    space = house_space(house)
    room = space.room(room_id)
    has_one = any(
        house.items[n].kind is ItemKind.LAMP and _stands_on_floor(space, room, n)
        for n in room.items
    )
    sofas = [n for n in room.items if house.items[n].nyu40 == SOFA]
    if has_one or not sofas or rng.random() >= _BY_SOFA:
        return
    piece, shape = draw_lamp(house, catalogue, "floor_lamp", rng) or floor_lamp(rng, style)
    radius = float(np.abs(shape.bounds[:, [0, 2]]).max())
    for number in sofas:
        # Try each end; take the lamp away again where it closes a way.
        for place in _ends(space, room, number, radius):
            if _floor_is_free(space, room, place, radius, float(shape.bounds[1, 1])):
                position = np.array([place[0], room.room.floor_y, place[1]])
                _stand_lamp(house, room, piece, with_flux(shape, _FLOOR_LM), position, 0.0)
                if _ways_are_open(house, room_id):
                    return
                house.items.pop()
                house.done[f"{PASS}: {piece.group}"] -= 1
    house.refused[f"{PASS}: no floor beside a sofa"] += 1


def stand_by_beds(
    house: MutableHouse, catalogue: Catalogue, style: Style, room_id: str, rng: np.random.Generator
) -> None:
    """Put the same lamp on every free nightstand of the room."""
    space = house_space(house)
    room = space.room(room_id)
    stands = [n for n in room.items if house.items[n].nyu40 == NIGHT_STAND]
    if not stands or rng.random() >= _BY_BED:
        return
    piece, shape = draw_lamp(house, catalogue, "table_lamp", rng) or table_lamp(rng, style)
    for number in stands:
        low, high = space.bounds[number]
        middle = ((low + high) / 2)[[0, 2]]
        spot = _spot_on_top(house, space, number, middle, shape)
        if spot is None:
            house.refused[f"{PASS}: no free nightstand"] += 1
            continue
        turn = house.items[number].oriented_box.axes[:, 2]
        _stand_lamp(
            house,
            room,
            piece,
            with_flux(shape, _TABLE_LM),
            spot,
            float(np.arctan2(turn[0], turn[2])),
        )


def draw_lamp(
    house: MutableHouse, catalogue: Catalogue, group: str, rng: np.random.Generator
) -> tuple[Piece, Shape] | None:
    """A catalogue lamp with a light, of a size for furniture; None = generate one."""
    fit = [p for p in catalogue.of(group) if p.size[2] < (0.55 if group == "table_lamp" else 1.95)]
    if not fit or rng.random() < 0.15:
        return None
    chosen = own_or_all(fit, catalogue.own, house.own_share, rng)
    piece = chosen[int(rng.integers(len(chosen)))]
    shape = catalogue.shape(piece)
    return (piece, shape) if shape is not None and shape.lights else None


def _stand_lamp(
    house: MutableHouse, room: RoomSpace, piece: Piece, shape: Shape, at: F64, turn_rad: float
) -> None:
    item = house.placed(
        piece,
        shape,
        at,
        turn_rad,
        item_id=next_id(house, PASS),
        room_id=room.room.id,
        level_id=room.room.level_id,
    )
    house.add(item, PASS, piece)


def _stands_on_floor(space: HouseSpace, room: RoomSpace, number: int) -> bool:
    # A lamp that reaches from the floor to a man's chest.
    low, high = space.bounds[number][:, 1] - room.room.floor_y
    return bool(low < 0.1 and high > 1.0)


def _ends(space: HouseSpace, room: RoomSpace, number: int, radius: float) -> list[F64]:
    """Positions past the ends of an item's longer side, near its back and near its centre."""
    low, high = space.bounds[number]
    middle, half = ((low + high) / 2)[[0, 2]], ((high - low) / 2)[[0, 2]]
    long = int(np.argmax(half))
    ends = []
    for across in (0.5, -0.5, 0.0):
        for sign in (1.0, -1.0):
            offset = np.zeros(2)
            offset[long] = sign * (half[long] + radius + 0.06)
            offset[1 - long] = across * half[1 - long]
            ends.append(middle + offset)
    # Floor lamps belong in corners: nearest to the room's edge first, none far from it.
    edge = room.area.boundary
    away = [float(shapely.distance(shapely.Point(p), edge)) for p in ends]
    order = sorted(range(len(ends)), key=lambda k: away[k])
    return [ends[k] for k in order if away[k] < radius + _STANDING_FROM_WALL_M]


def _floor_is_free(
    space: HouseSpace, room: RoomSpace, place: F64, radius: float, height: float
) -> bool:
    disc = shapely.Point(place).buffer(radius + 0.02)
    free = shapely.difference(room.area, room.walls)
    if not shapely.contains(free, disc):
        return False
    for door in room.doors:
        side = door.side_of(room.room.id)
        if side is not None and (
            door.before(side).intersects(disc) or door.swing(side).intersects(disc)
        ):
            return False
    around = radius + 0.02
    low = np.array([place[0] - around, room.room.floor_y + 0.02, place[1] - around])
    return space.is_free(low, low + np.array([2 * around, height + 0.03, 2 * around]))


def _ways_are_open(house: MutableHouse, room_id: str) -> bool:
    space = house_space(house)
    room = space.room(room_id)
    last = len(house.items) - 1
    floor = FloorCells(space, room)
    before = doors_are_joined(floor.bitmap((last,)), room)
    return not before or doors_are_joined(floor.bitmap(), room)


def _spot_on_top(
    house: MutableHouse, space: HouseSpace, number: int, place: F64, shape: Shape
) -> F64 | None:
    """(3,) position for the shape on the item's flat and free top, if any."""
    low, high = shape.bounds
    radius = float(np.abs([low[[0, 2]], high[[0, 2]]]).max())
    foot = [s.positions for s in shape.surfaces]
    base = np.concatenate(foot)
    base = base[base[:, 1] < 0.02][:, [0, 2]]
    reach = float(np.abs(base).max()) if len(base) else radius
    ring = [
        place + reach * 0.95 * np.array([np.cos(a), np.sin(a)]) for a in np.arange(8) * np.pi / 4
    ]
    triangles = item_triangles(house.items[number])
    heights = highest_below(np.array([place, *ring]), triangles)
    if not np.isfinite(heights).all() or np.ptp(heights) > 0.001:
        return None
    y = float(heights.max())
    # The place must be free of other items.
    a = np.array([place[0] - radius, y + 0.004, place[1] - radius])
    b = np.array([place[0] + radius, y + float(high[1]) + 0.02, place[1] + radius])
    return np.array([place[0], y, place[1]]) if space.is_free(a, b) else None


def add_lamps(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang lamps in a share of the rooms with too little light; add table lamps by sofas and beds."""
    for room_id in [room.room.id for room in house_space(house).rooms]:
        rng = house.rng("lamps", room_id)
        room = house_space(house).room(room_id)
        if room.area.area < _LEAST_M2 or room.kind is RoomKind.OUTDOOR or not room.room.has_floor:
            continue
        if rng.random() < share:
            area, has = float(room.area.area), flux_of_lamps(house.items[k] for k in room.items)
            target_lm = flux_for_floor(area, WANTS[room.kind].lux)
            if has < flux_for_floor(area, _WEAK_LX):
                flux = min(max(target_lm - has, _FLUX_LM[0]), _FLUX_LM[1])
                hang_from_ceiling(house, catalogue, style, room_id, flux, rng)
        if rng.random() < share:
            stand_by_beds(house, catalogue, style, room_id, rng)
            stand_by_sofas(house, catalogue, style, room_id, rng)
