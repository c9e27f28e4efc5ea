"""What a support is to who lives there: a desk, a counter, a shelf; no effects."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType

from pbrs_farm.core.classes import (
    BOOKSHELF,
    CABINET,
    COUNTER,
    DESK,
    DRESSER,
    NIGHT_STAND,
    OTHERFURNITURE,
    OTHERPROP,
    REFRIGERATOR,
    SHELVES,
    SINK,
    TABLE,
    TELEVISION,
    TOILET,
)
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.dress.supports import Support
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind

_HOLDS_NOTHING = (
    "shower", "bathtub", "bath tub", "radiator", "fireplace", "pool", "treadmill",
)  # fmt: skip
_COOKERS = frozenset({"cooker", "stove", "hob", "oven"})
_WASHERS = frozenset({"washer", "washing", "dryer", "dishwasher"})
_MACHINES = _COOKERS | _WASHERS | {"fridge"}
_HOLDERS = frozenset({
    CABINET, TABLE, BOOKSHELF, COUNTER, DESK, SHELVES, DRESSER, REFRIGERATOR, TELEVISION, NIGHT_STAND,
    TOILET, SINK, OTHERFURNITURE, OTHERPROP,
})  # fmt: skip

# Square metres for which the table's shares hold; larger and smaller ones have more and less.
_USUAL_M2: Mapping[str, float] = MappingProxyType({
    "coffee_table": 0.5, "counter": 0.75, "desk": 0.7, "dining_table": 1.0, "dresser": 0.5,
    "side_table": 0.15, "sink": 0.4, "tv_stand": 0.5, "toilet": 0.05, "basin": 0.12,
    "bath_shelf": 0.15, "stove": 0.3, "fridge_top": 0.35, "cabinet_top": 0.5, "washer": 0.3,
    "upper_cabinet_top": 0.25, "piano": 0.4, "cubby": 0.25, "clothes_shelf": 0.3,
    "store_top": 0.5, "outdoor_table": 0.5, "other_top": 0.4,
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the table: a share of the receptacles holds the kind."""

    kind: str
    share: float


@cache
def shares() -> Mapping[str, tuple[Row, ...]]:
    """Rows by receptacle, in the table's order."""
    text = resources.files("pbrs_farm.dress.clutter").joinpath("shares.csv").read_text("utf-8")
    rows: dict[str, list[Row]] = {}
    for row in csv.DictReader(line for line in text.splitlines() if not line.startswith("#")):
        rows.setdefault(row["receptacle"], []).append(Row(row["kind"], float(row["share"])))
    return MappingProxyType({name: tuple(found) for name, found in rows.items()})


def can_hold(item: Item) -> bool:
    """Whether things are put on furniture of this kind; seats and beds are for cushions."""
    if item.kind is not ItemKind.OBJECT or item.nyu40 not in _HOLDERS:
        return False
    low, high = item.bounds
    # Small things hold nothing, and neither do thin ones as rails and radiators.
    return bool(min(high[0] - low[0], high[2] - low[2]) > 0.15 and (high - low).max() > 0.3)


def receptacle_of(item: Item, support: Support, kind: RoomKind) -> str:
    """The table's name for a support of an item in a room of that kind; "" holds nothing."""
    at, name = support.above_floor, f"{item.name} {item.source_class}".casefold()
    if any(word in name for word in _HOLDS_NOTHING):
        return ""
    if kind is RoomKind.OUTDOOR:
        return "outdoor_table" if item.nyu40 in (TABLE, NIGHT_STAND) and at > 0.25 else ""
    if kind is RoomKind.STORE and at < 1.6:
        return "store_top"
    if item.nyu40 in (BOOKSHELF, SHELVES):
        return "bath_shelf" if kind is RoomKind.BATHROOM else "shelf"
    is_inner = float(item.bounds[1, 1]) - support.height > 0.1
    if is_inner and at < 0.8 and words_of_item(item) & _MACHINES:
        return ""
    if (
        is_inner
        and at < 1.9
        and item.nyu40 in (CABINET, DRESSER, TABLE, NIGHT_STAND, TELEVISION, OTHERFURNITURE)
    ):
        # Boards inside what is no bookcase.
        free = float(support.clear[support.mask].max())
        if item.nyu40 == CABINET and free > 0.25 and kind is RoomKind.BEDROOM:
            return "clothes_shelf"
        return "cubby" if at < 1.2 else "cabinet_top"
    return _top_of(item, name, at, kind)


def _top_of(item: Item, name: str, at: float, kind: RoomKind) -> str:
    # Tops by class, height and the room.
    if item.nyu40 == TOILET:
        return "toilet" if at > 0.55 else ""
    if item.nyu40 == SINK:
        return "sink" if kind is RoomKind.KITCHEN or kind is RoomKind.LIVING else "basin"
    if item.nyu40 == REFRIGERATOR:
        return "fridge_top" if at > 1.0 else "counter"
    words = words_of_item(item)
    if words & _COOKERS:
        return "stove" if 0.75 < at < 1.0 else ""
    if words & _WASHERS:
        return "counter" if kind is RoomKind.KITCHEN else "washer"
    if item.nyu40 == COUNTER:
        return "counter" if 0.7 < at < 1.2 else ""
    if "piano" in name:
        return "piano" if at > 0.7 else ""
    if at > 1.45:
        return "upper_cabinet_top" if kind is RoomKind.KITCHEN else "cabinet_top"
    if kind is RoomKind.KITCHEN and item.nyu40 in (CABINET, OTHERFURNITURE, DRESSER):
        return "counter" if at > 0.6 else ""
    return _table_of(item, name, at, kind)


def _table_of(item: Item, name: str, at: float, kind: RoomKind) -> str:
    # at: height of the top above the floor, metres; "" where nothing is put on it.
    if item.nyu40 == DESK or (
        item.nyu40 == TABLE and kind in (RoomKind.BEDROOM, RoomKind.OFFICE) and at > 0.6
    ):
        return "desk" if at > 0.5 else ""
    if item.nyu40 == TELEVISION:
        is_stand = any(word in name for word in ("unit", "stand", "cabinet"))
        return "tv_stand" if at < 0.75 and is_stand else ""
    if any(word in name for word in ("tv stand", "tv unit", "tv table", "television")) and at < 0.9:
        return "tv_stand"
    if item.nyu40 in (TABLE, NIGHT_STAND):
        if at < 0.3:
            return ""
        # Below 0.36 m2 a table is a side table; its height tells a sofa's from a dining table.
        low, high = item.bounds
        small = float((high[0] - low[0]) * (high[2] - low[2])) < 0.36
        if at < 0.6:
            return "side_table" if small else "coffee_table"
        if small or item.nyu40 == NIGHT_STAND:
            return "side_table" if small else "dresser"
        return "dining_table"
    if kind is RoomKind.BATHROOM:
        return "basin" if at < 1.2 else "bath_shelf"
    if item.nyu40 in (DRESSER, CABINET):
        return "dresser" if at > 0.3 else ""
    return "other_top" if at > 0.3 else ""


def usual_area(receptacle: str) -> float:
    """Square metres for which the table's shares hold."""
    return _USUAL_M2.get(receptacle, 0.4)
