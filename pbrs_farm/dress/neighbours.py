"""The items around an item: overlaps, contents, support; caches bounds, triangles and cubes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.core.mesh import boxes_meeting, triangle_bounds
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.old_place import HELD, HeldBy
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.surface_points import item_triangles, surface_points

CUBE_M: Final = 0.02
_BITS: Final = 21  # bits of a cube's index along each axis

Cubes = NDArray[np.int64]


class Neighbours:
    """The items of a list that may change, by index, with bounds and triangles of current objects."""

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = items
        self._kept: dict[int, tuple[Item, F64]] = {}  # by id, with the item so that it lives
        self._triangles: dict[int, tuple[Item, F64]] = {}

    def bounds(self) -> F64:
        """(I, 2, 3) of all items, NaN for those without vertices."""
        for item in self.items:
            if id(item) not in self._kept:
                self._kept[id(item)] = (item, item.bounds)
        return np.array([self._kept[id(item)][1] for item in self.items]).reshape(-1, 2, 3)

    def triangles(self, item: Item) -> F64:
        """(F, 3, 3) an item's triangles, metres."""
        if id(item) not in self._triangles:
            self._triangles[id(item)] = (item, item_triangles(item))
        return self._triangles[id(item)][1]

    def near(self, low: F64, high: F64) -> list[int]:
        """Indices of the items, but structure, whose bounds meet the box low..high (3,), metres."""
        bounds = self.bounds()
        meets = ((bounds[:, 1] >= low) & (bounds[:, 0] <= high)).all(1)
        return [int(k) for k in np.flatnonzero(meets) if not self.items[int(k)].kind.is_structure]

    def n_shared(self, item: Item, without: Collection[int]) -> int:
        """Number of 2 cm cubes shared with others' surfaces, `without` ignored: compare with an old item's."""
        low, high = item.bounds
        around = np.stack([low - CUBE_M, high + CUBE_M])
        others = []
        for k in self.near(low, high):
            if k not in without:
                corners = self.triangles(self.items[k])
                least, most = triangle_bounds(corners)
                meets = ((most >= low) & (least <= high)).all(1)
                others.append(_cubes(corners[meets], around))
        if not any(map(len, others)):
            return 0
        cubes = _cubes(self.triangles(item))
        return sum(len(np.intersect1d(cubes, c, assume_unique=True)) for c in others)


def _cubes(corners: F64, box: F64 | None = None) -> Cubes:
    if not len(corners):
        return np.zeros(0, np.int64)
    points = surface_points(corners, CUBE_M, box)
    cube = np.floor(points / CUBE_M).astype(np.int64) + (1 << (_BITS - 1))
    return np.unique((cube[:, 0] << 2 * _BITS) | (cube[:, 1] << _BITS) | cube[:, 2])


_ROUNDING_M: Final = 1e-3  # rounding of bounds
_CONTACT_M: Final = 0.015  # maximum gap or overlap between an item and its support, metres
_LOW_PART_M: Final = (
    0.05  # maximum height of vertices above an item's base that may touch its support, metres
)
_FLAT_M: Final = 0.06  # rugs and mats lie under everything
_LEFT_ALONE: Final = frozenset({ItemKind.DOOR, ItemKind.WINDOW, ItemKind.STAIRS})


def things_on(around: Neighbours, index: int) -> tuple[list[int], list[int]]:
    """(contents on top, items inside or under it) of an item; no structure, doors or flat items below."""
    bounds = around.bounds()
    (low, high), corners = bounds[index], around.triangles(around.items[index])
    on: list[int] = []
    inside: list[int] = []
    for k in around.near(low - _CONTACT_M, high + _CONTACT_M):
        item, (own_low, own_high) = around.items[k], bounds[k]
        middle = (own_low + own_high) / 2
        is_over = (low[[0, 2]] < middle[[0, 2]]).all() and (middle[[0, 2]] < high[[0, 2]]).all()
        if k == index or item.kind in _LEFT_ALONE or not is_over or not item.n_faces:
            continue
        if own_high[1] < low[1] + _FLAT_M:
            continue
        (on if _stands_on(item, corners, float(high[1])) else inside).append(k)
    return on, inside


def _stands_on(item: Item, corners: F64, top_y: float) -> bool:
    # Its foot is where the furniture seen from above is.
    points = lowest_points(item)
    height = highest_below(points[:, [0, 2]], corners, top_y + _ROUNDING_M)
    gap = points[:, 1] - height
    return bool(np.isfinite(height).any() and abs(float(gap.min())) <= _CONTACT_M)


_STANDS_M: Final = 0.03  # maximum height of a floor item's base above the floor, metres
ALIKE_HELD: Final[Mapping[Place, frozenset[Place]]] = {
    Place.FLOOR: frozenset({Place.FLOOR, Place.KITCHEN, Place.SURFACE}),
    Place.SURFACE: frozenset({Place.FLOOR, Place.SURFACE}),
    Place.WALL: frozenset({Place.WALL}),
    Place.CEILING: frozenset({Place.CEILING}),
}
"""Compatible places of models, by the support of the item that they replace."""


def held_by(house: MutableHouse, around: Neighbours, index: int, group: str) -> Place:
    """Support of items[index]: floor, SURFACE, ceiling (of ceiling lamps), else a wall."""
    if HELD.get(group) is HeldBy.TOP:
        return Place.CEILING
    item, low_y = around.items[index], float(around.bounds()[index, 0, 1])
    if height_above_floor(house, item, low_y) <= _STANDS_M:
        return Place.FLOOR
    # Items on a piece, a step or a platform do not hang.
    (low, high), all_bounds = around.bounds()[index], around.bounds()
    below = boxes_meeting(all_bounds[:, 0], all_bounds[:, 1], low - _CONTACT_M, high)
    items_below = [around.items[int(k)] for k in np.flatnonzero(below) if k != index]
    stands = any(
        below_item.kind is not ItemKind.WALL
        and below_item.n_faces
        and _stands_on(item, around.triangles(below_item), low_y + _CONTACT_M)
        for below_item in items_below
    )
    return Place.SURFACE if stands else Place.WALL


def height_above_floor(house: MutableHouse, item: Item, low_y: float) -> float:
    """Metres from the floor of the item's room, else storey, to world height low_y; 0 if unknown."""
    floors = [room.floor_y for room in house.source.rooms if room.id == item.room_id]
    floors += [lv.elevation for lv in house.source.levels if lv.id == item.level_id]
    return low_y - floors[0] if floors else 0.0


def lowest_points(item: Item) -> F64:
    """(N, 3) vertices, about 600 at most, within 5 cm of the item's base."""
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    points = points[points[:, 1] <= points[:, 1].min() + _LOW_PART_M]
    return np.asarray(points[:: max(1, len(points) // 600)])


def drop_onto(item: Item, corners: F64) -> float | None:
    """Vertical offset (m) that puts an item on triangles (F, 3, 3); None if mostly unsupported."""
    points = lowest_points(item)
    height = highest_below(points[:, [0, 2]], corners)
    gap = points[:, 1] - height
    if not np.isfinite(height).any():
        return None
    drop = float(gap[np.isfinite(gap)].min())
    # Its foot must be held on both sides of its middle, each way.
    foot = points[points[:, 1] < points[:, 1].min() + 0.01]
    contacts = foot[foot[:, 1] - drop - highest_below(foot[:, [0, 2]], corners) < _CONTACT_M]
    middle = (foot.min(0) + foot.max(0))[[0, 2]] / 2
    plan = contacts[:, [0, 2]]
    if len(plan) == 0 or not ((plan.min(0) <= middle).all() and (plan.max(0) >= middle).all()):
        return None
    return -drop
