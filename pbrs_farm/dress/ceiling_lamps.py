"""Hang a lamp from a room's ceiling: above the dining table, else in the centre of the free area. Effects: changes the house."""

from __future__ import annotations

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.classes import TABLE
from pbrs_farm.dress.made_lamps import ceiling_dome, globe_pendant, shade_pendant, with_flux
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import HouseSpace, RoomSpace, house_space
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.hanging import next_id
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.home.room_use import RoomKind

PASS = "lamps"
_HEAD_M = 1.95  # lowest height above free floor at which a lamp may hang
_TABLE_M = 1.45  # lowest height above the floor of a lamp over a table
_FROM_WALL_M = 0.25  # least distance from a lamp's edge to a wall
_MOST_ROOM_M = 3.6  # no lamp is hung from a higher ceiling
_GRID_M = 0.15
_PLAIN = (RoomKind.BATHROOM, RoomKind.HALL, RoomKind.KITCHEN, RoomKind.STORE)
# Pieces that suit every room, by words of their names; tubes are for rooms where people work.
_TUBES, _NOWHERE = ("fluorescent",), ("spotlight",)
_GAP_M = 0.0005


def hang_from_ceiling(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    room_id: str,
    flux_lm: float,
    rng: np.random.Generator,
) -> bool:
    """Hang one lamp of that flux; False, and a reason counted, where there is no place for it."""
    space = house_space(house)
    room = space.room(room_id)
    choices = _choices(catalogue, style, room, rng)
    for place, top_y, low_y in _hanging_places(house, space, room):
        for piece, ready in choices:
            # Load a model when it is its turn: most rooms take the first.
            shape = ready or catalogue.shape(piece)
            factor = _factor(shape, top_y - low_y) if shape and shape.lights else None
            if (
                shape is None
                or factor is None
                or not _is_free_below(space, room, place, top_y, shape, factor)
            ):
                continue
            height = float(shape.bounds[1, 1]) * factor
            position = np.array([place[0], top_y - height - _GAP_M, place[1]])
            lit = with_flux(shape, flux_lm)
            turn = float(rng.choice([0.0, np.pi / 2]))
            item = house.placed(
                piece,
                lit,
                position,
                turn,
                item_id=next_id(house, PASS),
                room_id=room_id,
                level_id=room.room.level_id,
                scale=factor,
            )
            house.add(item, PASS, piece)
            return True
    house.refused[f"{PASS}: no place under the ceiling"] += 1
    return False


def _choices(
    catalogue: Catalogue, style: Style, room: RoomSpace, rng: np.random.Generator
) -> list[tuple[Piece, Shape | None]]:
    """Lamps that suit the room, in a drawn order, with no shape loaded; a flat dome, which mostly fits, last."""
    generated: list[tuple[Piece, Shape | None]] = [
        ceiling_dome(rng, style),
        globe_pendant(rng, style),
        shade_pendant(rng, style),
    ]
    if room.kind in _PLAIN and rng.random() < 0.6:
        return generated
    # Leave out lamps of other places, those too wide, and tubes outside kitchen and store.
    suitable = []
    for piece in catalogue.of("ceiling_lamp"):
        name = piece.name.lower()
        is_tube = any(word in name for word in _TUBES)
        if any(word in name for word in _NOWHERE) or max(piece.size[:2]) > 0.45 * _least_side(room):
            continue
        if is_tube and room.kind not in (RoomKind.KITCHEN, RoomKind.STORE):
            continue
        suitable.append(piece)
    # Up to three of the catalogue and our own pendants, mixed; the dome last.
    drawn = [suitable[int(k)] for k in rng.permutation(len(suitable))][:3]
    two = [generated[1], generated[2]] if rng.random() < 0.5 else [generated[2], generated[1]]
    some: list[tuple[Piece, Shape | None]] = [(piece, None) for piece in drawn]
    if rng.random() < 0.35:
        some = [two[0], *some]
    return [*some, *two, generated[0]]


def _least_side(room: RoomSpace) -> float:
    x0, z0, x1, z1 = room.area.bounds
    return float(min(x1 - x0, z1 - z0))


def _factor(shape: Shape, height_m: float) -> float | None:
    """Scale at which the shape is at most height_m tall; None if too small."""
    tall = float(shape.bounds[1, 1])
    factor = min(1.0, height_m / tall)
    return factor if factor > 0.6 else None


def _hanging_places(
    house: MutableHouse, space: HouseSpace, room: RoomSpace
) -> list[tuple[F64, float, float]]:
    """Plan places, the ceiling's y and the lowest y of a lamp there; best first."""
    floor = room.room.floor_y
    places, lows = [], []
    for number in room.items:
        item, (low, high) = house.items[number], space.bounds[number]
        size = high - low
        if item.nyu40 == TABLE and size[1] > 0.6 and min(size[0], size[2]) > 0.7:
            places.append(((low + high) / 2)[[0, 2]])
            lows.append(floor + _TABLE_M)
    grid = _places_off_walls(room)
    places += list(grid)
    lows += [floor + _HEAD_M] * len(grid)
    if not places:
        return []
    points = np.array(places)
    tops = lowest_above(points, room.above, floor + 0.5)
    ok = np.isfinite(tops) & (tops < floor + _MOST_ROOM_M)
    return [(points[k], float(tops[k]), lows[k]) for k in np.flatnonzero(ok)]


def _places_off_walls(room: RoomSpace) -> F64:
    """(N, 2) places well inside the room, those farthest from its walls first; at most 60."""
    area = shapely.difference(room.area, room.walls)
    shrunk = shapely.buffer(area, -_FROM_WALL_M)
    inner = area if shrunk.is_empty else shrunk
    if inner.is_empty:
        return np.zeros((0, 2))
    x0, z0, x1, z1 = inner.bounds
    axes = [np.arange(a, b + 1e-9, _GRID_M) for a, b in ((x0, x1), (z0, z1))]
    grid = np.stack([g.ravel() for g in np.meshgrid(*axes)], -1)
    grid = grid[shapely.contains_xy(inner, grid[:, 0], grid[:, 1])]
    if not len(grid):
        return np.zeros((0, 2))
    edge = shapely.distance(shapely.points(grid), area.boundary)
    # Of places equally far from walls take the middle one.
    middle = np.linalg.norm(grid - grid.mean(0), axis=1)
    order = np.lexsort((middle, -np.round(edge, 1)))
    return np.asarray(grid[order[:60]])


def _is_free_below(
    space: HouseSpace, room: RoomSpace, place: F64, top_y: float, shape: Shape, factor: float
) -> bool:
    """Whether nothing else is where the lamp would hang, and the ceiling is flat over its canopy."""
    low, high = shape.bounds * factor
    radius = float(np.abs([low[0], high[0], low[2], high[2]]).max()) + 0.03
    if not shapely.contains(room.area, shapely.Point(place).buffer(radius)):
        return False
    ring = place + 0.05 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    if np.abs(lowest_above(ring, room.above, room.room.floor_y + 0.5) - top_y).max() > 0.001:
        return False
    bottom = top_y - float(high[1]) - 0.05
    if bottom < max((d.top_y for d in room.doors), default=-np.inf) + 0.05:
        sides = [(d, d.side_of(room.room.id)) for d in room.doors]
        before = [d.before(s).union(d.swing(s)) for d, s in sides if s is not None]
        if shapely.intersects(shapely.union_all(before), shapely.Point(place).buffer(radius)):
            return False
    return space.is_free(
        np.array([place[0] - radius, bottom, place[1] - radius]),
        np.array([place[0] + radius, top_y, place[1] + radius]),
    )
