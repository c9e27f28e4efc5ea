"""Function of a support, by receptacles.csv, and its typical contents, by shares.csv; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import inf
from pathlib import Path
from types import MappingProxyType

from pydantic import Field

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
from pbrs_farm.core.record import Nyu40, Record, Several, read_csv
from pbrs_farm.dress.supports import Support
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind

# fmt: off
_HOLDERS = frozenset({
    CABINET, TABLE, BOOKSHELF, COUNTER, DESK, SHELVES, DRESSER, REFRIGERATOR, TELEVISION, NIGHT_STAND,
    TOILET, SINK, OTHERFURNITURE, OTHERPROP,
})
# fmt: on


class Row(Record):
    """One row of shares.csv: a share of the receptacles holds the kind."""

    receptacle: str
    kind: str
    share: float
    source: str


class _ReceptacleRule(Record):
    # One row of receptacles.csv: what fits all that it names is that receptacle.
    room: Several[RoomKind] = ()
    classes: Several[Nyu40] = Field((), alias="class")
    inside: bool = False
    words: Several[str] = ()
    name: Several[str] = ()
    above_m: float = -inf
    below_m: float = inf
    free_m: float = -inf
    area_m2: float = inf
    holds: str = ""


@cache
def shares() -> Mapping[str, tuple[Row, ...]]:
    """Rows by receptacle, in the table's order."""
    rows: dict[str, list[Row]] = {}
    for row in read_csv(Path(__file__).with_name("shares.csv"), Row):
        rows.setdefault(row.receptacle, []).append(row)
    return MappingProxyType({name: tuple(rows_of_name) for name, rows_of_name in rows.items()})


@cache
def _rules() -> tuple[_ReceptacleRule, ...]:
    return read_csv(Path(__file__).with_name("receptacles.csv"), _ReceptacleRule)


def can_hold(item: Item) -> bool:
    """True if small items are put on this kind of furniture; seats and beds only get cushions."""
    if item.kind is not ItemKind.OBJECT or item.nyu40 not in _HOLDERS:
        return False
    low, high = item.bounds
    # Small furniture holds nothing, nor do thin shapes such as rails and radiators.
    return bool(min(high[0] - low[0], high[2] - low[2]) > 0.15 and (high - low).max() > 0.3)


def receptacle_of(item: Item, support: Support, kind: RoomKind) -> str:
    """The first fitting row's name for a support of an item in a room, by class, height, area; or ""."""
    name, words = f"{item.name} {item.source_class}".casefold(), words_of_item(item)
    low, high = item.bounds
    is_inner = float(high[1]) - support.height > 0.1
    area = float((high[0] - low[0]) * (high[2] - low[2]))
    for rule in _rules():
        if (
            (not rule.room or kind in rule.room)
            and (not rule.classes or item.nyu40 in rule.classes)
            and (is_inner or not rule.inside)
            and (not rule.words or words & {*rule.words})
            and (not rule.name or any(part in name for part in rule.name))
            and rule.above_m < support.above_floor < rule.below_m
            and (rule.free_m == -inf or float(support.clear[support.mask].max()) > rule.free_m)
            and area < rule.area_m2
        ):
            return rule.holds
    return ""
