"""Ceilings over the rooms of an IFC building: ceilings, roofs, undersides of slabs; no effects.

Programs write a room's height as that of its space's body, which may end at the slab above a suspended
ceiling or above a sloped roof: the real ceiling takes precedence. They write roofs as slabs without a
type; names and positions identify these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.classes import CEILING
from pbrs_farm.core.house import Item, ItemKind, Room, corners_of_surfaces
from pbrs_farm.core.mesh import closed_edge_share, unit_normals
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.furniture_classes import words_of_list

NEAR_M: Final = 0.35  # from the end of a space's body to the floor or ceiling that bounds it
_SAMPLES: Final = 3000  # of a room's plan
_LEAST_STEP_M: Final = 0.05  # between samples
_KNEE_M: Final = 0.3  # above the floor: a sloped roof that comes lower is no ceiling there
_HEADROOM_M: Final = 1.8  # above the floor: a slab that hangs lower is a platform, a wall a parapet
_LEVEL_M: Final = 0.025  # samples that differ less from the middle one are at its height
_HALF: Final = 0.5  # share of a room, or of a slab, that counts as most of it
_JOINT_M: Final = 0.6  # maximum distance from a wall's end to the slab below or above it, metres
_WELD_DECIMALS: Final = 4  # of metres: corners nearer than .1 mm are one
_CARRIES: Final = 0.1  # share of a slab's plan that a space on it covers at least


@dataclass(frozen=True, slots=True, eq=False)
class Overhead:
    """Heights above a room at samples of its plan."""

    heights: F64  # (N,) y of the lowest ceiling, roof or slab above; inf = none
    is_ceiling: Bools  # (N,) it is a ceiling or a roof, not the underside of a slab

    def share(self, below_y: float, *, of_ceilings: bool = False) -> float:
        """Share of the room under something that hangs below a height."""
        return float(self._within(below_y, of_ceilings=of_ceilings).mean())

    def height(self, below_y: float = np.inf, *, of_ceilings: bool = False) -> float | None:
        """Height of a level ceiling over half of the room below_y, else the highest of a sloped roof; or None."""
        y = self.heights[self._within(below_y, of_ceilings=of_ceilings)]
        if not len(y):
            return None
        middle = float(np.median(y))
        is_level = (np.abs(y - middle) < _LEVEL_M).mean() > _HALF
        return middle if is_level else float(y.max())

    def _within(self, below_y: float, *, of_ceilings: bool) -> Bools:
        near = np.isfinite(self.heights) & (self.heights <= below_y)
        return near & self.is_ceiling if of_ceilings else near


class Overheads:
    """Looks up from rooms. State: the triangles of what may hang there."""

    def __init__(self, items: Sequence[Item]) -> None:
        none = np.zeros((0, 3, 3))
        self._ceilings = np.concatenate([none, *_undersides(items, ItemKind.CEILING)])
        self._slabs = np.concatenate([none, *_undersides(items, ItemKind.FLOOR)])

    def over(self, room: Room) -> Overhead:
        """Heights above a room's polygon and floor."""
        points = _samples_of_plan(room.polygon)
        ceiling = lowest_above(points, self._ceilings, room.floor_y + _KNEE_M)
        slab = lowest_above(points, self._slabs, room.floor_y + _HEADROOM_M)
        return Overhead(np.minimum(ceiling, slab), ceiling <= slab)


def _undersides(items: Sequence[Item], kind: ItemKind) -> list[F64]:
    """The faces that look down; all of a sheet, which may lie either way."""
    undersides = []
    for item in items:
        if item.kind is kind:
            corners = corners_of_surfaces(item.surfaces)
            is_closed = closed_edge_share(np.round(corners, _WELD_DECIMALS)) == 1.0
            undersides.append(corners[unit_normals(corners)[:, 1] < 0] if is_closed else corners)
    return undersides


def _samples_of_plan(polygon: F64) -> F64:
    """Points (N, 2) of a grid inside a polygon; its middle where it is too narrow for any."""
    area: Any = shapely.Polygon(polygon)
    step = max(float(np.sqrt(area.area / _SAMPLES)), _LEAST_STEP_M)
    x0, z0, x1, z1 = area.bounds
    x, z = np.arange(x0 + step / 2, x1, step), np.arange(z0 + step / 2, z1, step)
    points = np.stack(np.meshgrid(x, z), -1).reshape(-1, 2)
    inside = points[shapely.contains_xy(area, points[:, 0], points[:, 1])]
    middle = area.representative_point()
    return inside if len(inside) else np.array([[middle.x, middle.y]])


def with_roofs(items: Sequence[Item], rooms: Sequence[Room]) -> list[Item]:
    """The items, with roof slabs turned into ceilings, by name or by position.

    rooms: those in the file; a slab below a room is not a roof, nor is one with the walls of a storey
    around it, whatever its name. By position, a slab is a roof if it is on walls and carries neither a
    room nor a storey's wall (parapets are allowed).
    """
    walls = [i.bounds for i in items if i.kind is ItemKind.WALL]
    bounds = np.array(walls).reshape(-1, 2, 3)
    roofed = []
    for item in items:
        is_roof = (
            item.kind is ItemKind.FLOOR
            and item.source_class.startswith("IfcSlab")
            and not _carries_room(item, rooms)
            and (
                (is_called_roof(item.name) and not _carries_storey(item, bounds))
                or _is_placed_as_roof(item, bounds)
            )
        )
        roofed.append(replace(item, kind=ItemKind.CEILING, nyu40=CEILING) if is_roof else item)
    return roofed


def is_called_roof(name: str) -> bool:
    """True if a name contains roof, and is not a place on a roof (a roof terrace)."""
    words = words_of(name)
    return bool(words & words_of_list("roof")) and not words & words_of_list("no roof")


def _carries_room(slab: Item, rooms: Sequence[Room]) -> bool:
    low, high = slab.bounds
    plan: Any = shapely.box(low[0], low[2], high[0], high[2])
    on_it = [r for r in rooms if abs(r.floor_y - high[1]) < _JOINT_M]
    covered = sum(plan.intersection(shapely.Polygon(r.polygon)).area for r in on_it)
    return bool(covered > _CARRIES * plan.area)


def _carries_storey(slab: Item, walls: F64) -> bool:
    """True if walls stand on most of a slab's outline; a roof beside a higher house has one. walls: (W, 2, 3) bounds."""
    low, high = slab.bounds
    on_it = [w for w in _walls_above(slab, walls) if w[0, 1] > low[1] - _JOINT_M]
    if not on_it:
        return False
    reach = np.minimum(np.max(on_it, (0, 1)), high) - np.maximum(np.min(on_it, (0, 1)), low)
    return bool((reach > _HALF * (high - low))[[0, 2]].all())


def _walls_above(slab: Item, walls: F64) -> F64:
    """The walls (W, 2, 3) on a slab with the height of a storey."""
    near = _walls_over_or_under(slab, walls)
    return np.asarray(near[near[:, 1, 1] > slab.bounds[1, 1] + _HEADROOM_M])


def _walls_over_or_under(slab: Item, walls: F64) -> F64:
    # Not those that only touch its edge.
    low, high = slab.bounds
    overlap = np.minimum(walls[:, 1], high) - np.maximum(walls[:, 0], low)
    return np.asarray(walls[(overlap[:, [0, 2]] > 0.0).all(1)])


def _is_placed_as_roof(slab: Item, walls: F64) -> bool:
    """True if a slab is supported by walls and carries none. walls: (W, 2, 3) bounds."""
    low, high = slab.bounds
    near = _walls_over_or_under(slab, walls)
    carrying = (near[:, 1, 1] > low[1] - _JOINT_M) & (near[:, 0, 1] < high[1] - _HEADROOM_M)
    return bool(carrying.any() and not len(_walls_above(slab, walls)))
