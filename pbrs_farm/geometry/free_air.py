"""Free places in the air of rooms for items in any orientation; state: the items placed so far.

An item is represented by its oriented box, CLEAR_M wider on all sides. No face of another item may
reach into that box, so items in the air keep a distance of at least CLEAR_M.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Matrix4
from pbrs_farm.core.frames import affine
from pbrs_farm.core.house import Box, Item, ItemKind, Room, corners_of_surfaces
from pbrs_farm.core.mesh import clipped_to_box, lengths, points_bounds
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid, covered
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.solids import box_quads

CLEAR_M: Final = 0.05
"""From what hangs in the air to anything else, at least."""

_TRIES: Final = 30  # attempts at a place and orientation before an item is given up
_MOST_M3: Final = 12.0  # maximum box volume; larger items are shells of buildings, with air inside
_SHADOW_CELL_M: Final = 0.01


class FreeAir:
    """The air of a house, and what hangs in it.

        air = FreeAir(house.items)
        matrix = air.put(room, points, np.random.default_rng(1))  # None: it fits nowhere

    Equal calls in equal order give equal places.
    """

    def __init__(self, items: Sequence[Item]) -> None:
        self._scene = SceneTriangles(items)
        self._floors, self._roofs = (
            corners_of_surfaces(s for item in items if item.kind in kinds for s in item.surfaces)
            for kinds in ((ItemKind.FLOOR, ItemKind.GROUND), (ItemKind.WALL, ItemKind.CEILING))
        )
        is_thing = np.array([not item.kind.is_structure for item in items], np.bool_)
        sizes = np.ptp(self._scene.bounds, axis=1).prod(-1)
        self._things = self._scene.bounds[is_thing & (sizes <= _MOST_M3)]
        self._hanging: list[Box] = []
        self._spheres = np.zeros((0, 4))  # around these: middle and radius

    def put(self, room: Room, points: F64, rng: np.random.Generator) -> Matrix4 | None:
        """Place an item in a room: (4, 4) rigid world_from_item, or None if no place is found.

        points: (V, 3) of its mesh in its own frame, metres. Positions and orientations are uniformly
        distributed. The whole item is above the room's floor, below its ceiling, and touches nothing.
        """
        low, high = points_bounds(points)
        middle, half = (low + high) / 2, (high - low) / 2
        outline = shapely.Polygon(room.polygon)
        x0, z0, x1, z1 = outline.bounds
        least, most = np.array([x0, room.floor_y, z0]), np.array([x1, room.ceiling_y, z1])
        for _ in range(_TRIES):
            turn, share = random_turn(rng), rng.random(3)
            reach = np.abs(turn) @ (half + CLEAR_M)
            free = most - least - 2 * reach
            if (free <= 0).any():
                continue
            box = Box(least + reach + share * free, half, turn)
            if self._is_free(box, outline):
                self._hanging.append(box)
                sphere = [*box.centre, np.linalg.norm(box.half)]
                self._spheres = np.concatenate([self._spheres, [sphere]])
                return affine(turn, box.centre - turn @ middle)
        return None

    def _is_free(self, box: Box, outline: shapely.Polygon) -> bool:
        wide = Box(box.centre, box.half + CLEAR_M, box.axes)
        corners = wide.corners
        low, high = points_bounds(corners)
        plan = shapely.MultiPoint(corners[:, [0, 2]]).convex_hull
        return (
            bool(shapely.contains(outline, plan))
            and not self._is_in_thing(box.centre)
            and not any(_boxes_meet(wide, placed) for placed in self._hanging_near(wide))
            and not _meets(wide, self._scene.in_box(low, high)[0])
            and self._is_over_floor(box.centre)
        )

    def _hanging_near(self, box: Box) -> list[Box]:
        """Those of the boxes put there whose spheres meet that of a box."""
        distances = lengths(self._spheres[:, :3] - box.centre)
        near = np.flatnonzero(distances <= self._spheres[:, 3] + np.linalg.norm(box.half))
        return [self._hanging[k] for k in near]

    def _is_in_thing(self, point: F64) -> bool:
        inside = (self._things[:, 0] <= point) & (point <= self._things[:, 1])
        return bool(inside.all(1).any())

    def _is_over_floor(self, point: F64) -> bool:
        """True if the first item below a point is a floor, not a roof or wall."""
        place, y = point[None, [0, 2]], float(point[1])
        floor, roof = (highest_below(place, c, y)[0] for c in (self._floors, self._roofs))
        return bool(floor >= roof)


def _meets(box: Box, corners: F64) -> bool:
    """Whether a triangle of (F, 3, 3) reaches into a box."""
    local = (corners - box.centre) @ box.axes
    return len(clipped_to_box(local, -box.half, box.half)) > 0


def _boxes_meet(a: Box, b: Box) -> bool:
    if any(_holds(first, second.centre) for first, second in ((a, b), (b, a))):
        return True
    quads = box_quads(b.centre, b.half, b.axes)
    return _meets(a, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def _holds(box: Box, point: F64) -> bool:
    return bool((np.abs((point - box.centre) @ box.axes) <= box.half).all())


def random_turn(rng: np.random.Generator) -> F64:
    """(3, 3) rotation, each as likely as any other (Shoemake 1992: a uniform unit quaternion)."""
    x, y, z, w = (v := rng.standard_normal(4)) / np.linalg.norm(v)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def mean_shadow_m2(corners: F64) -> float:
    """Mean area of an item's silhouette (faces (F, 3, 3)) along the three axes, square metres."""
    areas = []
    for axes in ((0, 1, 2), (1, 0, 2), (0, 2, 1)):
        turned = corners[..., axes]
        plan = turned.reshape(-1, 3)[:, [0, 2]]
        grid = PlanGrid.around(plan, 0.0, _SHADOW_CELL_M, 0.0)
        areas.append(float(covered(grid, turned).sum()) * _SHADOW_CELL_M**2)
    return float(np.mean(areas))


def shadow_for_share(room: Room, share: float) -> float:
    """Total silhouette area that hides a share of the view in an empty room, on average, square metres.

    The mean free path in a room is 4 V / S (Cauchy; V its volume, S its surface). A ray meets one of n
    randomly placed items of silhouette A with probability 1 - exp(-n A 4 / S).
    """
    outline = shapely.Polygon(room.polygon)
    height = room.ceiling_y - room.floor_y
    surface = 2 * outline.area + outline.length * height
    return float(-np.log1p(-share) * surface / 4)
