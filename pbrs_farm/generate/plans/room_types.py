"""Room types by names of other vocabularies, by furniture and by size; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import shapely
from shapely.geometry import Point, Polygon

from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.plans.parsed_plan import LeftOut, Thing, ring_of
from pbrs_farm.home.given_rooms import NO_ROOM, given_room
from pbrs_farm.home.names import words_of
from pbrs_farm.home.room_use import RoomKind, named_kind

BY_FIXTURES: Final = "by its fixtures"
LEAST_M2: Final = 0.5
"""Minimum room area; smaller areas are slivers."""

_SMALL_BATH_M2: Final = 2.6  # smaller bathrooms have no bath, only a WC
_NEAR_WINDOW_M: Final = 0.5
_NEAR_DOOR_M: Final = 0.35
_LIVING_M2, _ROOM_M2, _STORE_M2 = 18.0, 9.0, 3.0
_SMALL_ROOM_M2: Final = 6.0  # of a room to live in with one door and a window
_OPEN_AIR_SHARE: Final = 0.25  # minimum share of a balcony's outline with railings
_NEAR_RAILING_M: Final = 0.3
_TYPES: Final = {RoomKind.DINING: "living", RoomKind.OUTDOOR: "balcony", RoomKind.OTHER: "hall"}
_GLAZED: Final = ("window", "french_window")
# Item words that imply a room type; the first matching row wins.
_FIXTURES: Final = (
    ("bath", {"bathtub", "tub", "shower", "jacuzzi"}),
    ("toilet", {"toilet", "wc", "urinal"}),
    (
        "kitchen",
        {"kitchen", "stove", "oven", "cooker", "hob", "fridge", "refrigerator", "dishwasher"},
    ),
    ("bed", {"bed"}),
    ("sofa", {"sofa", "couch"}),
)


class DrawnArea(NamedTuple):
    """An area whose room type is not yet known."""

    shape: Polygon
    word: str  # the vocabulary's, "" = none
    name: str = ""
    is_plain: bool = False  # a room to live in of which the file says no more


def typed_rooms(
    source: str,
    areas: Sequence[DrawnArea],
    things: Sequence[Thing],
    openings: Sequence[dict[str, Any]],
    left_out: LeftOut,
    railings: Sequence[Polygon] = (),
) -> list[dict[str, Any]]:
    """Rows of the rooms, in order, typed by name, else furniture and openings, else size; slivers left out."""
    rooms: list[tuple[DrawnArea, str]] = []
    sure = [
        "balcony" if kind == BY_FIXTURES and _is_railed(area.shape, railings) else kind
        for kind, area in ((_by_word(source, area), area) for area in areas)
    ]
    indoors = [a.shape.area for a, k in zip(areas, sure, strict=True) if k != "balcony"]
    largest = max(indoors, default=0.0)
    places = shapely.STRtree([Point(t.x, t.z) for t in things]) if things else None
    doors = [o for o in openings if o["kind"] not in _GLAZED]
    outdoors = [a.shape for a, k in zip(areas, sure, strict=True) if k == "balcony"]
    lights = [Point(o["at"]) for o in openings if o["kind"] in _GLAZED]
    # A door to a balcony is of glass.
    lights += [p for p in map(_place, doors) if any(o.distance(p) < _NEAR_DOOR_M for o in outdoors)]
    for area, kind in zip(areas, sure, strict=True):
        if kind == NO_ROOM:
            continue
        if area.shape.area < LEAST_M2:
            left_out.add(f"an area below {LEAST_M2} m2 is a sliver")
            continue
        if kind == BY_FIXTURES:
            inside = places.query(area.shape, "contains").tolist() if places is not None else []
            has = {_fixture(things[k].name) for k in inside}
            is_lit = any(area.shape.distance(p) < _NEAR_WINDOW_M for p in lights)
            near = [d["kind"] for d in doors if area.shape.distance(_place(d)) < _NEAR_DOOR_M]
            # One enters a home through its hall: an entrance counts as two.
            n_doors = len(near) + near.count("entrance")
            kind = _by_fixtures(
                area.shape.area, has, n_doors, is_lit=is_lit, is_largest=area.shape.area == largest
            )
            area = area._replace(is_plain=area.is_plain or kind == "bedroom")
        elif kind == "bathroom" and area.shape.area < _SMALL_BATH_M2:
            kind = "wc"
        rooms.append((area, kind))
    return [
        {"type": kind, "polygon": ring_of(area.shape)} | ({"name": area.name} if area.name else {})
        for area, kind in _with_living(rooms)
    ]


def _by_word(source: str, area: DrawnArea) -> str:
    room_type = given_room(source, area.word) if area.word else None
    if room_type is not None:
        # Stairs of a plan lead nowhere: a plain passage.
        return "hall" if room_type == "stairs" else room_type
    return type_by_words(area.name or area.word)


def type_by_words(name: str) -> str:
    """The room type of a name's words, in the languages of room_words.csv; a studio has a bed."""
    kind, words = named_kind(name), words_of(name)
    if kind is None:
        return BY_FIXTURES
    if kind is RoomKind.OFFICE and "studio" in words:
        return "bedroom"
    return "wc" if {"wc", "toilet"} & words else _TYPES.get(kind, kind.value)


def _fixture(name: str) -> str:
    words = words_of(name.replace("_", " "))
    return next((kind for kind, fixture_words in _FIXTURES if words & fixture_words), "")


def _place(opening: dict[str, Any]) -> Point:
    return Point(opening["at"])


def _is_railed(shape: Polygon, railings: Sequence[Polygon]) -> bool:
    near = shapely.union_all(list(railings)).buffer(_NEAR_RAILING_M)
    along = shape.exterior.intersection(near).length
    return bool(along > _OPEN_AIR_SHARE * shape.exterior.length)


def _by_fixtures(m2: float, has: set[str], n_doors: int, *, is_lit: bool, is_largest: bool) -> str:
    if has & {"toilet", "bath"}:
        return "bathroom" if m2 >= _SMALL_BATH_M2 or "bath" in has else "wc"
    is_living = "sofa" in has or (m2 >= _LIVING_M2 and is_largest)
    if "kitchen" in has:
        return "living" if is_living else "kitchen"
    if "bed" in has:
        return "bedroom"
    if is_living:
        return "living"
    # A passage has doors at both ends; with one door it is a room if it has a window, else a store.
    if is_lit:
        return "bedroom" if m2 >= (_SMALL_ROOM_M2 if n_doors == 1 else _ROOM_M2) else "hall"
    return "store" if n_doors == 1 or m2 < _STORE_M2 else "hall"


def _with_living(rooms: list[tuple[DrawnArea, str]]) -> list[tuple[DrawnArea, str]]:
    types = [kind for _, kind in rooms]
    plain = [k for k, (area, kind) in enumerate(rooms) if area.is_plain and kind == "bedroom"]
    if {RoomType.LIVING, RoomType.STUDIO} & set(types) or not plain:
        return rooms
    largest = max(plain, key=lambda k: (rooms[k][0].shape.area, -k))
    # One room to live and to sleep in, where no other is left to sleep in.
    kind = "living" if types.count("bedroom") > 1 else "studio"
    return [(a, kind if k == largest else t) for k, (a, t) in enumerate(rooms)]
