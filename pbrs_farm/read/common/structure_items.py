"""Walls, floors, ceilings and grounds as items; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.house import Item, ItemKind, Surface

# NYU40 class of each kind; grounds have none.
CLASS_OF_STRUCTURE: Final = {ItemKind.WALL: WALL, ItemKind.FLOOR: FLOOR, ItemKind.CEILING: CEILING}


def structure_item(
    item_id: str,
    kind: ItemKind,
    surfaces: Sequence[Surface],
    *,
    name: str = "",
    level_id: str = "0",
    source_class: str = "",
    room_id: str | None = None,
    boundary_of: Sequence[str] = (),
) -> Item:
    """An item of a structure's kind. name, source_class: by default the kind; boundary_of: rooms of a wall."""
    return Item(
        id=item_id,
        name=name or kind.value,
        kind=kind,
        level_id=level_id,
        surfaces=tuple(surfaces),
        nyu40=CLASS_OF_STRUCTURE.get(kind, 0),
        source_class=source_class or kind.value.title(),
        room_id=room_id,
        tags=tuple(f"boundary_of:{room}" for room in boundary_of),
    )
