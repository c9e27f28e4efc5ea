"""Undersides of floors visible from below; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import CEILING
from pbrs_farm.core.house import House, Item, ItemKind, Room, Surface, corners_of_surfaces, part_of
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.geometry.heights import lowest_above
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.added_ceilings import (
    MAX_UNDERSIDE_NORMAL_Y,
    MIN_WALL_HEIGHT_M,
    cover_of_surfaces,
)

_STEP_M: Final = 0.2  # spacing of floor samples for visibility from below, metres
_MOST_PLACES: Final = 2000  # of one floor: of a larger one they lie farther apart
_LEAST_PLACES: Final = 3  # seen: fewer are the seam between a ceiling and a wall
_APART_M: Final = 0.002  # a ceiling in the plane of an underside does not hide it
UNDERSIDE: Final = "underside"
"""Tag of such ceilings."""


class _Stand(NamedTuple):
    """A standpoint below a floor: a room's floor or the ground outside."""

    area: plan.Shape
    y: float
    room: Room | None


def with_undersides(house: House) -> House:
    """Append, as ceilings, the undersides of floors that a room or the outdoors sees from below."""
    floors = [i for i in house.items if i.kind is ItemKind.FLOOR and i.n_faces]
    lowest = min((room.floor_y for room in house.rooms), default=np.inf)
    if not any(i.bounds[1, 1] > lowest + MIN_WALL_HEIGHT_M / 2 for i in floors):
        return house
    stands = [_Stand(plan.polygon_of_room(r.polygon), r.floor_y, r) for r in house.rooms]
    for ground in house.items:
        if ground.kind is ItemKind.GROUND and ground.n_faces:
            area = cover_of_surfaces(ground).area
            stands.append(_Stand(area, float(ground.bounds[1, 1]), None))
    covers = [i for i in house.items if i.kind in (ItemKind.FLOOR, ItemKind.CEILING)]
    above = corners_of_surfaces([s for i in covers for s in i.surfaces])
    items: list[Item] = []
    undersides: list[Item] = []
    for item in house.items:
        is_floor = item.kind is ItemKind.FLOOR and item.n_faces
        stand = _seen_from(item, stands, above) if is_floor else None
        upper, under = _parted(item) if stand is not None else (item.surfaces, ())
        if stand is None or not under or not upper:
            items.append(item)
            continue
        items.append(replace(item, surfaces=upper))
        level_id, room_id = item.level_id, None
        if stand.room is not None:
            level_id, room_id = stand.room.level_id, stand.room.id
        undersides.append(
            Item(
                id=f"{UNDERSIDE}_{item.id}",
                name=f"Underside of {item.name or item.id}",
                kind=ItemKind.CEILING,
                level_id=level_id,
                surfaces=under,
                nyu40=CEILING,
                source_class="ceiling",
                room_id=room_id,
                tags=(UNDERSIDE,),
            )
        )
    return house.with_items([*items, *undersides])


def _seen_from(item: Item, stands: Sequence[_Stand], above: F64) -> _Stand | None:
    """A standpoint that sees most of a floor past all others (above); None if it is hidden."""
    corners = corners_of_surfaces(item.surfaces)
    under = corners[unit_normals(corners)[:, 1] < MAX_UNDERSIDE_NORMAL_Y]
    if not len(under):
        return None
    low, high = item.bounds[:, [0, 2]]
    step = max(_STEP_M, float(np.sqrt(np.prod(high - low) / _MOST_PLACES)))
    axes = [np.arange(low[k] + step / 2, high[k], step) for k in range(2)]
    grid = np.stack([g.ravel() for g in np.meshgrid(*axes)], 1)
    under_y = lowest_above(grid, under, -np.inf)
    grid, under_y = grid[np.isfinite(under_y)], under_y[np.isfinite(under_y)]
    best, most = None, _LEAST_PLACES - 1
    for stand in stands:
        least_y = stand.y + MIN_WALL_HEIGHT_M / 2
        overhead = under_y > least_y
        if overhead.sum() <= most:
            continue
        overhead &= shapely.contains_xy(stand.area, grid[:, 0], grid[:, 1])
        first_y = lowest_above(grid[overhead], above, least_y)
        n_seen = int((under_y[overhead] <= first_y + _APART_M).sum())
        if n_seen > most:
            best, most = stand, n_seen
    return best


def _parted(item: Item) -> tuple[tuple[Surface, ...], tuple[Surface, ...]]:
    """The surfaces of a floor without the faces that look down, and those faces."""
    upper, under = [], []
    for s in item.surfaces:
        down = unit_normals(corners_of_surfaces([s]))[:, 1] < MAX_UNDERSIDE_NORMAL_Y
        upper += [part_of(s, s.faces[~down], s.name)] if not down.all() else []
        under += [part_of(s, s.faces[down], s.name)] if down.any() else []
    return tuple(upper), tuple(under)
