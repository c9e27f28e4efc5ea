"""Plan areas of stairs in a room, and of their first and last steps; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import ItemKind, Room
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space.footprints import plan_area
from pbrs_farm.geometry.surface_points import item_triangles

_STEP_M: Final = 0.45  # treads this near to a floor's height are stepped on from it
_BEFORE_M: Final = 0.85  # kept free before the first tread
_FLAT: Final = 0.9  # cosine to the vertical of treads
_COARSE_M: Final = 0.02  # outlines of stairs are drawn so roughly
_REACH_M: Final = 0.4  # stairs are taken for a room's own so far outside it


@dataclass(frozen=True, slots=True)
class Flights:
    """Plan areas of the stairs of a room, empty without stairs."""

    under: BaseGeometry  # the stairs themselves
    before: BaseGeometry  # where one steps on and off


def flights_of(house: MutableHouse, room: Room, area: BaseGeometry) -> Flights:
    """Plan areas of the stairs in a room (area) or ending there, and of the floor before their ends."""
    under, before = [], []
    near = area.buffer(_REACH_M)
    for treads, plan in _stairs(house):
        low, high = float(treads[..., 1].min()), float(treads[..., 1].max())
        if high < room.floor_y - _STEP_M or low > room.ceiling_y or not plan.intersects(near):
            continue
        if high > room.floor_y + _STEP_M:
            under.append(plan)
        reached = np.abs(treads[..., 1] - room.floor_y).max(1) < _STEP_M
        ends = plan_area(treads[reached], upright=False)
        before.append(ends.buffer(_BEFORE_M, join_style="mitre"))
    return Flights(shapely.union_all(under), shapely.union_all(before))


def _stairs(house: MutableHouse) -> list[tuple[F64, BaseGeometry]]:
    """Level triangles (F, 3, 3) of each stairs of the source, and their plan; found once a house."""
    cached = house.kept.get("stairs")
    if isinstance(cached, list):
        return cached
    stairs: list[tuple[F64, BaseGeometry]] = []
    for item in house.source.items:
        if item.kind is ItemKind.STAIRS and item.n_faces:
            corners = item_triangles(item)
            treads = corners[np.abs(unit_normals(corners)[:, 1]) > _FLAT]
            if len(treads):
                stairs.append((treads, plan_area(treads, upright=False).simplify(_COARSE_M)))
    house.kept["stairs"] = stairs
    return stairs
