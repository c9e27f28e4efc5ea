"""The triangles of a house by item, with spatial look-up; state: a cache of requested items."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from pbrs_farm.core.arrays import F64, I32
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import boxes_meeting, triangle_bounds
from pbrs_farm.geometry.surface_points import item_triangles


class SceneTriangles:
    """Faces of items in double precision, and look-up of items by box.

    Items are identified by their index in the sequence given, which must not change. Faces are
    collected on first use, so that a room costs only its own items.

        scene = SceneTriangles(house.items)
        corners, owner = scene.in_box(low, high)  # (T, 3, 3) metres, (T,) indices into house.items
    """

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = tuple(items)
        bounds = [item.bounds for item in self.items]
        self.bounds: F64 = np.array(bounds) if bounds else np.zeros((0, 2, 3))
        self._corners: dict[int, F64] = {}
        self._of_faces: dict[int, tuple[F64, F64]] = {}

    def with_item(self, index: int, item: Item) -> SceneTriangles:
        """The scene with another item at an index; the others' triangles are shared."""
        changed = copy(self)
        changed.items = (*self.items[:index], item, *self.items[index + 1 :])
        changed.bounds = self.bounds.copy()
        changed.bounds[index] = item.bounds
        changed._corners = {k: c for k, c in self._corners.items() if k != index}
        changed._of_faces = {k: b for k, b in self._of_faces.items() if k != index}
        return changed

    def of_item(self, index: int) -> F64:
        """(F, 3, 3) finite faces of items[index], metres; cached, do not write into it."""
        if index not in self._corners:
            self._corners[index] = item_triangles(self.items[index])
        return self._corners[index]

    def _bounds_of(self, index: int) -> tuple[F64, F64]:
        # (F, 3) lowest and highest corners of the boxes around the item's faces.
        if index not in self._of_faces:
            self._of_faces[index] = triangle_bounds(self.of_item(index))
        return self._of_faces[index]

    def items_in(self, low: F64, high: F64) -> list[int]:
        """Indices of the items whose bounding box touches the box low..high (3,), metres, world frame."""
        meets = boxes_meeting(self.bounds[:, 0], self.bounds[:, 1], low, high)
        return [int(i) for i in np.flatnonzero(meets)]

    def in_box(self, low: F64, high: F64) -> tuple[F64, I32]:
        """(T, 3, 3) whole faces whose bounds meet the box low..high, and (T,) their items."""
        parts, owners = [np.zeros((0, 3, 3))], [np.zeros(0, np.int32)]
        for index in self.items_in(low, high):
            corners = self.of_item(index)
            least, most = self._bounds_of(index)
            meets = boxes_meeting(least, most, low, high)
            parts.append(corners[meets])
            owners.append(np.full(int(meets.sum()), index, np.int32))
        return np.concatenate(parts), np.concatenate(owners)
