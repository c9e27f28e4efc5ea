"""The items round a thing: their bounds, and where its surface reaches into theirs; no effects.

State: bounds and cubes of the items that were asked for are kept.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import triangle_bounds
from pbrs_farm.geometry.surface_points import item_triangles, surface_points

CUBE_M: Final = 0.02
_BITS: Final = 21  # of a cube's number along each axis

Cubes = NDArray[np.int64]


class Surroundings:
    """The items of a draft, as they are when they are asked for."""

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
        """Places of the items that are no structure and whose bounds meet the box low..high (3,)."""
        bounds = self.bounds()
        meets = ((bounds[:, 1] >= low) & (bounds[:, 0] <= high)).all(1)
        return [int(k) for k in np.flatnonzero(meets) if not self.items[int(k)].kind.is_structure]

    def n_shared(self, item: Item, without: Collection[int]) -> int:
        """Cubes of 2 cm that an item's surface shares with others'; without: places left out."""
        low, high = item.bounds
        own = _cubes(self.triangles(item))
        count = 0
        for k in self.near(low, high):
            if k not in without:
                corners = self.triangles(self.items[k])
                least, most = triangle_bounds(corners)
                meets = ((most >= low) & (least <= high)).all(1)
                count += len(np.intersect1d(own, _cubes(corners[meets]), assume_unique=True))
        return count


def _cubes(corners: F64) -> Cubes:
    if not len(corners):
        return np.zeros(0, np.int64)
    points = surface_points(corners, CUBE_M)
    cube = np.floor(points / CUBE_M).astype(np.int64) + (1 << (_BITS - 1))
    return np.unique((cube[:, 0] << 2 * _BITS) | (cube[:, 1] << _BITS) | cube[:, 2])
