"""Rooms and sizes of a home, by seed (medians of nine homes, docs/homes.md) or a user; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.made_home import check_wishes
from pbrs_farm.core.record import Record, read_csv
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.plan_families import FLAT, PlanFamily, drawn_family, plan_families


class _RoomAreas(Record):
    type: RoomType
    median: float | None = None  # None: what the other rooms leave
    least: float
    most: float
    spread: float = 0.18


_AREAS: Final = read_csv(Path(__file__).with_name("room_areas.csv"), _RoomAreas)
MEDIAN_AREA: Final = {row.type: row.median for row in _AREAS if row.median is not None}
"""Square metres of floor."""
AREA_RANGE: Final = {row.type: (row.least, row.most) for row in _AREAS}
"""Smallest and largest, square metres."""
_SPREAD: Final = {row.type: row.spread for row in _AREAS}
_LIVING: Final = (RoomType.LIVING, RoomType.STUDIO)


@dataclass(frozen=True, slots=True)
class RoomWish:
    """One room of a programme."""

    type: RoomType
    area: float  # square metres of floor
    name: str = ""


@dataclass(frozen=True, slots=True)
class Programme:
    """The rooms of a home."""

    rooms: tuple[RoomWish, ...]
    open_kitchen: bool = False  # no wall between kitchen and living room
    n_blind_sides: int = 0  # sides of the outline shared with neighbouring homes
    notch: float = 0.0  # area of a corner that the outline leaves out, square metres
    l_shaped: bool = False  # the living room has a second arm
    balcony: bool = False
    adjacent: tuple[tuple[int, tuple[int, ...]], ...] = ()  # room shares a wall with one of others
    is_upper: bool = False  # the storey above: one comes up the stairs, not in by a front door
    is_court: bool = False  # the notch is in the middle of a side: a U-shaped outline
    plans: str = FLAT  # the family that it is of

    @property
    def family(self) -> PlanFamily:
        """Properties shared by the homes of its family."""
        return plan_families()[self.plans]

    def entered_from(self, type_: RoomType) -> tuple[RoomType, ...]:
        """The rooms that the door of a room may open to, the preferred one first."""
        family, types = self.family, {wish.type for wish in self.rooms}
        entries: tuple[RoomType, ...] = (RoomType.HALL,)
        if type_ is RoomType.BEDROOM and family.bedrooms_at != "hall" and types & set(_LIVING):
            entries = _LIVING if family.bedrooms_at == "living" else (*_LIVING, RoomType.HALL)
        return entries

    @property
    def area(self) -> float:
        """Floor of all rooms, square metres."""
        return sum(wish.area for wish in self.rooms)

    @property
    def en_suites(self) -> dict[int, tuple[int, ...]]:
        """Bathroom -> the bedrooms with a door to it, by the wishes; the first of several serves all."""
        types = [wish.type for wish in self.rooms]
        suites: dict[int, tuple[int, ...]] = {}
        for room, partners in self.adjacent:
            kinds = {types[k] for k in partners}
            if types[room] is RoomType.BATHROOM and kinds == {RoomType.BEDROOM}:
                suites[room] = partners
            if types[room] is RoomType.BEDROOM and kinds == {RoomType.BATHROOM}:
                free_bedrooms = [k for k in partners if k not in suites] or list(partners)
                suites[free_bedrooms[-1]] = (room,)
        return suites


@dataclass(frozen=True, slots=True)
class Wishes:
    """A user's requirements for generated homes."""

    bedrooms: tuple[int, int] = (0, 4)
    area: tuple[float, float] = (20.0, 250.0)  # of all rooms, square metres
    storeys: int = 1
    plans: str = ""  # family of plans; "" = drawn by seed
    offices: int | None = None  # number of bedrooms that become offices; None = by chance

    def __post_init__(self) -> None:
        """Raise BadInput for ranges that no home can meet."""
        check_wishes(self.bedrooms, self.area, self.storeys, self.offices or 0)


def drawn_programme(rng: np.random.Generator, wishes: Wishes | None = None) -> Programme:
    """A programme by seed, a studio to four bedrooms; of 64, the first (or last, scaled) of the wished area."""
    wishes = with_family(wishes or Wishes(), rng)
    # Draw until the area is as wished; then scale the rooms to it.
    for _ in range(64):
        programme = _draw_programme(rng, wishes.bedrooms, wishes.plans)
        if wishes.area[0] <= programme.area <= wishes.area[1]:
            return programme
    area = float(np.clip(programme.area, *wishes.area))
    return replace(programme, rooms=tuple(scaled_rooms(programme.rooms, area)))


def with_family(wishes: Wishes, rng: np.random.Generator) -> Wishes:
    """The wishes with a family of plans: one by seed where none is wished."""
    return replace(wishes, plans=wishes.plans or drawn_family(rng, wishes.bedrooms))


def _draw_programme(rng: np.random.Generator, bedrooms: tuple[int, int], plans: str) -> Programme:
    family = plan_families()[plans]
    # A number of bedrooms that the family lacks is drawn where nothing else is wished.
    shares = np.array(family.bedroom_shares)[bedrooms[0] : bedrooms[1] + 1] + 1e-9
    n = int(rng.choice(np.arange(bedrooms[0], bedrooms[1] + 1), p=shares / shares.sum()))
    types = [RoomType.STUDIO if n == 0 else RoomType.LIVING, RoomType.KITCHEN]
    types += [RoomType.BEDROOM] * n + [RoomType.BATHROOM]
    # Add the small rooms that larger homes have more often.
    if n >= 4 or (
        n >= 2 and rng.random() < family.second_bathroom * (n == 3 or family.second_bathroom > 0.3)
    ):
        types.append(RoomType.BATHROOM)
    for type_, chances in (
        (RoomType.WC, (0, 0.1, 0.4, 0.7, 0.8)),
        (RoomType.STORE, (0, 0.2, 0.3, 0.4, 0.5)),
        (RoomType.WARDROBE, (0, 0.1, 0.2, 0.3, 0.4)),
    ):
        if rng.random() < chances[n] * family.small_rooms.get(type_, 1.0):
            types.append(type_)
    rooms = [RoomWish(t, drawn_area(rng, t, family.areas.get(t, 1.0))) for t in types]
    # Homes with few bedrooms have smaller living rooms and kitchens.
    if n <= 1:
        rooms = [
            RoomWish(r.type, max(r.area * 0.9, AREA_RANGE[r.type][0]))
            if r.type in (RoomType.LIVING, RoomType.KITCHEN)
            else r
            for r in rooms
        ]
    # The hall takes its share of the area of adjacent rooms.
    total = sum(r.area for r in rooms)
    doors = Programme(tuple(rooms), plans=plans)
    n_doors = sum(RoomType.HALL in entries for entries in map(doors.entered_from, types))
    hall = max(total * rng.uniform(*family.hall_share), 3.0 + 0.95 * n_doors)
    rooms.append(RoomWish(RoomType.HALL, float(hall)))
    # Many rooms need many sides with daylight.
    blind = min(int(rng.choice([0, 1, 2], p=family.blind_shares)), (2, 2, 2, 1, 0)[n])
    is_court = bool(n >= 1 and rng.random() < family.court)
    has_notch = is_court or (n >= 1 and rng.random() < family.l_outline)
    return Programme(
        tuple(rooms),
        open_kitchen=bool(rng.random() < max(family.open_kitchen, 0.7 * (n == 0))),
        n_blind_sides=blind,
        notch=float(total * rng.uniform(*family.notch)) if has_notch else 0.0,
        l_shaped=bool(n in (2, 3) and rng.random() < family.l_shaped),
        balcony=bool(rng.random() < family.balcony),
        is_court=is_court,
        plans=plans,
    )


def drawn_area(rng: np.random.Generator, type_: RoomType, larger: float = 1.0) -> float:
    """Square metres of a room of that type by seed; larger: by so much than people's median."""
    area = larger * MEDIAN_AREA[type_] * float(np.exp(rng.normal(0.0, _SPREAD[type_])))
    return float(np.clip(area, *AREA_RANGE[type_]))


def scaled_rooms(wishes: Sequence[RoomWish], area: float) -> list[RoomWish]:
    """The rooms with that area in all, as near as the bounds of each let them; stairs stay."""
    # Scale all alike, then give what a bound refused to the others.
    resized = list(wishes)
    for _ in range(20):
        fixed = sum(w.area for w in resized if w.type not in AREA_RANGE)
        factor = (area - fixed) / (sum(w.area for w in resized) - fixed)
        if abs(factor - 1) < 1e-3:
            break
        resized = [_resize_wish(wish, factor) for wish in resized]
    return resized


def _resize_wish(wish: RoomWish, factor: float) -> RoomWish:
    low, high = AREA_RANGE.get(wish.type, (wish.area, wish.area))
    return replace(wish, area=float(np.clip(wish.area * factor, low, high)))
