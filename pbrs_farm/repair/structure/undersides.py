"""The underside of a floor over a room without a ceiling; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.classes import CEILING
from pbrs_farm.core.house import House, Item, ItemKind, Room, Surface, corners_of_surfaces, part_of
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.added_ceilings import (
    MAX_STOREY_GAP_M,
    MAX_UNDERSIDE_NORMAL_Y,
    MIN_HOLE_M2,
    MIN_WALL_HEIGHT_M,
    cover_of_surfaces,
)

UNDERSIDE: Final = "underside"
"""Tag of such ceilings."""


def with_undersides(house: House) -> House:
    """The house with what looks down of floors over rooms without a ceiling as items of their own.

    What one sees above oneself is ceiling. The new items come last.
    """
    below = [(r, plan.polygon_of_room(r.polygon)) for r in house.rooms if not r.has_ceiling]
    if not below:
        return house
    items: list[Item] = []
    made: list[Item] = []
    for item in house.items:
        room = _room_below(item, below) if item.kind is ItemKind.FLOOR and item.n_faces else None
        own, under = _parted(item) if room is not None else (item.surfaces, ())
        if room is None or not under or not own:
            items.append(item)
            continue
        items.append(replace(item, surfaces=own))
        made.append(
            Item(
                id=f"{UNDERSIDE}_{item.id}", name=f"Underside of {item.name or item.id}",
                kind=ItemKind.CEILING, level_id=room.level_id, surfaces=under, nyu40=CEILING,
                source_class="ceiling", room_id=room.id, tags=(UNDERSIDE,),
            )
        )  # fmt: skip
    return house.with_items([*items, *made])


def _room_below(item: Item, below: Sequence[tuple[Room, plan.Shape]]) -> Room | None:
    """The room without a ceiling that lies most below a floor."""
    area, low_y = cover_of_surfaces(item)[:2]
    shared = [
        plan.common(area, shape).area
        if room.floor_y + MIN_WALL_HEIGHT_M / 2 < low_y < room.ceiling_y + MAX_STOREY_GAP_M
        else 0.0
        for room, shape in below
    ]
    best = int(np.argmax(shared))
    return below[best][0] if shared[best] > MIN_HOLE_M2 else None


def _parted(item: Item) -> tuple[tuple[Surface, ...], tuple[Surface, ...]]:
    """The surfaces of a floor without the faces that look down, and those faces."""
    own, under = [], []
    for s in item.surfaces:
        down = unit_normals(corners_of_surfaces([s]))[:, 1] < MAX_UNDERSIDE_NORMAL_Y
        own += [part_of(s, s.faces[~down], s.name)] if not down.all() else []
        under += [part_of(s, s.faces[down], s.name)] if down.any() else []
    return tuple(own), tuple(under)
