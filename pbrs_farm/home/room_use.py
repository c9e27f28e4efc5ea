"""The use of a room, from its types, its name and its furniture; no effects.

The words are in room_words.csv beside this file.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import cache, lru_cache
from importlib.resources import files
from typing import Final, NamedTuple

import numpy as np
import shapely

from pbrs_farm.core.classes import (
    BATHTUB,
    BED,
    CABINET,
    DESK,
    OTHERFURNITURE,
    REFRIGERATOR,
    SINK,
    SOFA,
    TABLE,
    TOILET,
)
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.home.names import folded, words_of, words_of_item


class RoomKind(StrEnum):
    """Use of a room."""

    LIVING = "living"
    BEDROOM = "bedroom"
    KITCHEN = "kitchen"
    DINING = "dining"
    BATHROOM = "bathroom"
    OFFICE = "office"
    HALL = "hall"
    OUTDOOR = "outdoor"
    STORE = "store"  # garage, cellar, closet, laundry
    OTHER = "other"


MIN_LIVED_IN_M2: Final = 2.0  # smaller is a cupboard or a shaft
_LARGE_M2 = 9.0
# fmt: off
_COOKED_AT = frozenset({
    "cooker", "stove", "stovetop", "oven", "hob", "hood", "dishwasher", "fridge", "refrigerator",
    "herd", "gasherd", "elektroherd", "backofen",
})
# fmt: on


def is_cooked_in(items: Iterable[Item]) -> bool:
    """True if the items include a cooker, a hood, a dishwasher or a fridge."""
    return any(
        item.nyu40 == REFRIGERATOR
        or (item.nyu40 in (CABINET, OTHERFURNITURE) and words_of_item(item) & _COOKED_AT)
        for item in items
    )


def room_kind(room: Room, items: Sequence[Item], area_m2: float) -> RoomKind:
    """The room's kind, from its types and name, else from its furniture.

    items: the furniture in the room; area_m2: of its floor. A name takes precedence over furniture,
    but a "studio" with a bed or a cooker is a one-room home. Without evidence the kind is OTHER, or
    HALL if the room is small.
    """
    named = named_kind(" ".join((*room.types, room.name)))
    has = {item.nyu40 for item in items}
    # A studio is a study in some languages and a home of one room in others.
    if named is RoomKind.OFFICE and (BED in has or is_cooked_in(items)):
        return RoomKind.LIVING
    if named is not None:
        return named
    # Small or long rooms without furniture are passages.
    by_things = kind_by_things(items, area_m2)
    return by_things or (RoomKind.HALL if area_m2 < _LARGE_M2 else RoomKind.OTHER)


def kind_by_things(items: Iterable[Item], area_m2: float) -> RoomKind | None:
    """The kind of a nameless room by its furniture; None if that is not conclusive.

    area_m2: of its floor.
    """
    items = tuple(items)
    has = {item.nyu40 for item in items}
    # One sits on sofas where one lives, whatever else an outline takes in.
    if SOFA in has and (is_cooked_in(items) or has & {TOILET, BATHTUB}):
        return RoomKind.LIVING
    if BED in has and area_m2 >= _LARGE_M2:
        return RoomKind.BEDROOM
    if not has & {TOILET, BATHTUB, BED} and is_cooked_in(items):
        return RoomKind.KITCHEN
    for kind, classes in (
        (RoomKind.BATHROOM, {TOILET, BATHTUB}),
        (RoomKind.BEDROOM, {BED}),
        (RoomKind.KITCHEN, {REFRIGERATOR}),
        (RoomKind.LIVING, {SOFA}),
        (RoomKind.OFFICE, {DESK}),
        (RoomKind.DINING, {TABLE}),
        (RoomKind.BATHROOM, {SINK}),
    ):
        if has & classes:
            return kind
    return None


def with_uses(house: House) -> House:
    """The house with a type, derived from the furniture, for each room that has neither type nor name."""
    unnamed = [r for r in house.rooms if named_kind(" ".join((*r.types, r.name))) is None]
    things = [i for i in house.items if not i.kind.is_structure and (i.n_faces or i.box)]
    if not unnamed or not things:
        return house
    middles = np.array([i.box.centre if i.box else i.bounds.mean(0) for i in things])
    kinds: dict[str, RoomKind] = {}
    for room in unnamed:
        outline = shapely.Polygon(room.polygon)
        inside = shapely.contains_xy(outline, middles[:, [0, 2]])
        inside &= (middles[:, 1] > room.floor_y) & (middles[:, 1] < room.ceiling_y)
        contents = [things[n] for n in np.flatnonzero(inside)]
        kind = kind_by_things(contents, outline.area)
        if kind is not None:
            kinds[room.id] = kind
    return replace(
        house,
        rooms=tuple(
            replace(r, types=(*r.types, kinds[r.id].value)) if r.id in kinds else r
            for r in house.rooms
        ),
    )


def named_kind(name: str) -> RoomKind | None:
    """The kind of room that a name means; None if it has no known word.

    name: any text, types and name together; words of many languages are known. The first matching row
    of the table wins. Furniture is not considered: see `room_kind`.
    """
    rule = _rule_for(name)
    return rule.use if rule else None


def is_outdoors(room: Room) -> bool:
    """Whether one of the room's types, or its name, is that of a balcony, a terrace or a garden."""
    return RoomKind.OUTDOOR in [named_kind(text) for text in (*room.types, room.name)]


def is_lived_in(room: Room, area_m2: float) -> bool:
    """Whether people live in the room: in a balcony, terrace, garden or garage they do not.

    Types go before the name; a room of several types is lived in when one of them is.
    """
    rules = [_rule_for(text) for text in room.types or (room.name,)]
    return area_m2 > MIN_LIVED_IN_M2 and any(rule is None or rule.is_lived_in for rule in rules)


class _Rule(NamedTuple):
    """A row of room_words.csv: names that have one of the words are of the use.

    The first row that fits holds. A word is a whole word of a name, accents folded; a part, for
    languages written without spaces, is looked for anywhere.
    """

    use: RoomKind
    is_part: bool
    is_lived_in: bool
    words: frozenset[str]


@cache
def _rules() -> tuple[_Rule, ...]:
    text = files("pbrs_farm.home").joinpath("room_words.csv").read_text("utf-8")
    return tuple(
        _Rule(
            RoomKind(row["use"]),
            row["match"] == "part",
            row["lived_in"] == "yes",
            frozenset(folded(word) for word in row["words"].split()),
        )
        for row in csv.DictReader(text.splitlines())
    )


@lru_cache(1024)
def _rule_for(text: str) -> _Rule | None:
    words, whole = words_of(text), folded(text)
    for rule in _rules():
        if any(w in whole for w in rule.words) if rule.is_part else words & rule.words:
            return rule
    return None
