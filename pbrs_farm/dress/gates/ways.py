"""Gates of what must stay free, on meshes: doors, windows, ways; bodies in the space's order; no effects."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.classes import BLINDS, CURTAIN, FLOOR_MAT, SHOWER_CURTAIN
from pbrs_farm.core.mesh import clipped_to_box
from pbrs_farm.dress.gates.bodies import Body, boxes_of
from pbrs_farm.dress.space import FloorCells, HouseSpace, Passage, RoomSpace, doors_are_joined

MOST_COVERED: Final = 0.2  # share of a window that furniture may cover
_HEAD_M: Final = 2.0  # higher items block no door, metres above the floor
_STEP_M: Final = 0.03  # lower items can be stepped over, metres
_FACE_M: Final = 0.03  # depth before a wall in which sockets and mouldings are no obstacle
_BESIDE_M: Final = 0.01  # left out of a door's width at either end
_BEFORE_WINDOW_M: Final = 0.6
_CELL_M: Final = 0.05
_ROUNDING_M: Final = 1e-6
_CURTAINS: Final = frozenset({BLINDS, CURTAIN, FLOOR_MAT, SHOWER_CURTAIN})


@dataclass(frozen=True, slots=True)
class Blocked:
    """A door, window or way that a body keeps from being used."""

    what: str  # the passage or room
    index: int  # of the body's item in the house


def _is_in_the_way(body: Body) -> bool:
    return body.is_new and body.item.nyu40 not in _CURTAINS


def blocked_doors(space: HouseSpace, bodies: Sequence[Body]) -> tuple[int, list[Blocked]]:
    """Number of sides of room doors, and added bodies between step and head height in a swing or 0.8 m before."""
    n, blocked = 0, []
    boxes = boxes_of(bodies)
    for door in space.passages:
        sides = [] if door.is_window else [s for s in (0, 1) if door.room_ids[s] is not None]
        for side in sides:
            n += 1
            floor_y = space.room(door.room_ids[side] or "").room.floor_y
            low = np.array([-door.width / 2 + _BESIDE_M, floor_y + _STEP_M, _FACE_M])
            high = np.array(
                [door.width / 2 - _BESIDE_M, min(door.top_y, floor_y + _HEAD_M), door.clear_m]
            )
            for k in np.flatnonzero(_may_enter(boxes, door, side, low, high)).tolist():
                if _is_in_the_way(bodies[k]) and _enters(bodies[k], door, side, low, high):
                    blocked.append(Blocked(door.id, bodies[k].index))
    return n, blocked


def _may_enter(boxes: tuple[F64, F64], passage: Passage, side: int, low: F64, high: F64) -> Bools:
    """(N,) whether boxes may meet a box before a passage; low, high: (3,) as in_front_of."""
    middle, half = (boxes[0] + boxes[1]) / 2, (boxes[1] - boxes[0]) / 2
    axes = np.array([passage.along, [0.0, 1.0, 0.0], passage.inward(side)])
    offset = in_front_of(passage, side, middle)
    reach = half @ np.abs(axes).T + _ROUNDING_M
    return np.asarray(((offset + reach >= low) & (offset - reach <= high)).all(1))


def _enters(body: Body, door: Passage, side: int, low: F64, high: F64) -> bool:
    """Whether a body's mesh enters a box before a door: along it, up, and out into the room."""
    return bool(len(clipped_to_box(in_front_of(door, side, body.corners), low, high)))


def in_front_of(passage: Passage, side: int, points: F64) -> F64:
    """(..., 3) metres along a passage from its middle, world y, and out of the wall to that side."""
    moved = points - passage.face_point(side)
    return np.stack([moved @ passage.along, points[..., 1], moved @ passage.inward(side)], axis=-1)


def covered_windows(space: HouseSpace, bodies: Sequence[Body]) -> tuple[int, list[Blocked]]:
    """Number of window sides, and the added furniture (the largest of several) that covers a fifth."""
    n, blocked = 0, []
    for window in space.passages:
        sides = [s for s in (0, 1) if window.is_window and window.room_ids[s] is not None]
        for side in sides:
            n += 1
            covers = {k: m for k, m in _covers(window, side, space, bodies).items() if m.any()}
            while covers and np.mean(np.any(list(covers.values()), 0)) >= MOST_COVERED:
                worst = max(covers, key=lambda k: (int(covers[k].sum()), k))
                blocked.append(Blocked(window.id, bodies[worst].index))
                del covers[worst]
    return n, blocked


def _covers(
    window: Passage, side: int, space: HouseSpace, bodies: Sequence[Body]
) -> dict[int, Bools]:
    """New body near the window -> (rows, columns) cells that it covers, seen from the room."""
    # A grid over the opening; low and high bound the space before it, in the window's frame.
    columns = max(1, round(window.width / _CELL_M))
    rows = max(1, round((window.top_y - window.bottom_y) / _CELL_M))
    low = np.array([-window.width / 2, window.bottom_y, 0.01])
    high = np.array([window.width / 2, window.top_y, _BEFORE_WINDOW_M])
    near_it = _may_enter((space.bounds[:, 0], space.bounds[:, 1]), window, side, low, high)
    masks = {}
    for number in np.flatnonzero(near_it).tolist():
        if not _is_in_the_way(bodies[number]):
            continue
        # Columns of local: along the window, height, and distance into the room, metres.
        local = in_front_of(window, side, space.points[number])
        near = (local[:, 2] > 0.01) & (local[:, 2] < _BEFORE_WINDOW_M)
        column = np.floor((local[near, 0] / window.width + 0.5) * columns).astype(np.int64)
        height = (local[near, 1] - window.bottom_y) / (window.top_y - window.bottom_y)
        row = np.floor(height * rows).astype(np.int64)
        in_window = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        mask = np.zeros((rows, columns), bool)
        mask[row[in_window], column[in_window]] = True
        masks[number] = mask
    return masks


def closed_ways(space: HouseSpace, bodies: Sequence[Body]) -> tuple[int, list[Blocked]]:
    """Number of rooms with two doors, and added bodies, last first, to go until a way of 0.6 m joins them."""
    n, blocked = 0, []
    for room in space.rooms:
        if sum(door.side_of(room.room.id) is not None for door in room.doors) < 2:
            continue
        n += 1
        new = [k for k in room.items if bodies[k].is_new]
        floor = FloorCells(space, room)
        if _is_joined(floor, room, ()) or not _is_joined(floor, room, new):
            continue
        without: list[int] = []
        for number in reversed(new):
            # Name what alone opens the way, or what does with those before it.
            if _is_joined(floor, room, [number]):
                without = [number]
                break
            without.append(number)
            if _is_joined(floor, room, without):
                break
        blocked += [Blocked(room.room.id, bodies[k].index) for k in without]
    return n, blocked


def _is_joined(floor: FloorCells, room: RoomSpace, without: Collection[int]) -> bool:
    return doors_are_joined(floor.bitmap(without), room)
