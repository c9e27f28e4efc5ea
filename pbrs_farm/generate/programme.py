"""Programmes: which rooms a home has and how large; drawn by seed or given by a user; no effects.

Medians and shares are those of nine homes drawn by people (65 rooms), docs/homes.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.made_home import check_wishes
from pbrs_farm.generate.floor_plan import RoomType

MEDIAN_AREA: Final = {
    RoomType.LIVING: 27.2,
    RoomType.KITCHEN: 9.7,
    RoomType.BEDROOM: 10.9,
    RoomType.STUDIO: 24.0,
    RoomType.BATHROOM: 6.0,
    RoomType.WC: 1.7,
    RoomType.STORE: 2.2,
    RoomType.WARDROBE: 3.4,
}
"""Square metres of floor."""

AREA_RANGE: Final = {
    RoomType.LIVING: (14.0, 45.0),
    RoomType.KITCHEN: (7.2, 20.0),
    RoomType.BEDROOM: (9.0, 17.0),
    RoomType.STUDIO: (18.0, 34.0),
    RoomType.BATHROOM: (3.8, 9.0),
    RoomType.WC: (1.3, 2.4),
    RoomType.STORE: (1.5, 4.0),
    RoomType.WARDROBE: (2.5, 6.0),
    RoomType.HALL: (3.0, 16.0),
}
"""Smallest and largest, square metres."""

_SPREAD: Final = {RoomType.BEDROOM: 0.16, RoomType.LIVING: 0.20}  # of the logarithm; others .18
_BEDROOMS: Final = (0, 1, 2, 3, 4)
_BEDROOM_SHARES: Final = (0.10, 0.25, 0.35, 0.22, 0.08)
_HALL_SHARE: Final = (0.11, 0.16)  # of all other rooms


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
    n_blind_sides: int = 0  # sides of the outline that neighbours' homes stand against
    notch: float = 0.0  # area of a corner that the outline leaves out, square metres
    l_shaped: bool = False  # the living room has a second arm
    balcony: bool = False
    adjacent: tuple[tuple[int, tuple[int, ...]], ...] = ()  # room shares a wall with one of others
    is_upper: bool = False  # the storey above: one comes up the stairs, not in by a front door

    @property
    def area(self) -> float:
        """Floor of all rooms, square metres."""
        return sum(wish.area for wish in self.rooms)

    @property
    def en_suites(self) -> dict[int, tuple[int, ...]]:
        """Bathroom -> the bedrooms it is entered from: those that are wished beside each other.

        Of several bathrooms that a pair leaves open the last one becomes it: the first is for all.
        """
        types = [wish.type for wish in self.rooms]
        found: dict[int, tuple[int, ...]] = {}
        for room, others in self.adjacent:
            kinds = {types[k] for k in others}
            if types[room] is RoomType.BATHROOM and kinds == {RoomType.BEDROOM}:
                found[room] = others
            if types[room] is RoomType.BEDROOM and kinds == {RoomType.BATHROOM}:
                left = [k for k in others if k not in found] or list(others)
                found[left[-1]] = (room,)
        return found


@dataclass(frozen=True, slots=True)
class Wishes:
    """What a user asks of drawn homes."""

    bedrooms: tuple[int, int] = (0, 4)
    area: tuple[float, float] = (20.0, 250.0)  # of all rooms, square metres
    storeys: int = 1

    def __post_init__(self) -> None:
        """Raise BadInput for ranges that no home can meet."""
        check_wishes(self.bedrooms, self.area, self.storeys)


def drawn_programme(rng: np.random.Generator, wishes: Wishes | None = None) -> Programme:
    """A programme by seed: studio to four bedrooms, closed or open kitchen, WC, store, wardrobe."""
    wishes = wishes or Wishes()
    # Draw until the area is as wished; then scale the rooms to it.
    for _ in range(64):
        programme = _drawn(rng, wishes.bedrooms)
        if wishes.area[0] <= programme.area <= wishes.area[1]:
            return programme
    area = float(np.clip(programme.area, *wishes.area))
    return replace(programme, rooms=tuple(scaled_rooms(programme.rooms, area)))


def _drawn(rng: np.random.Generator, bedrooms: tuple[int, int]) -> Programme:
    shares = np.array(_BEDROOM_SHARES)[bedrooms[0] : bedrooms[1] + 1]
    n = int(rng.choice(np.arange(bedrooms[0], bedrooms[1] + 1), p=shares / shares.sum()))
    types = [RoomType.STUDIO if n == 0 else RoomType.LIVING, RoomType.KITCHEN]
    types += [RoomType.BEDROOM] * n + [RoomType.BATHROOM]
    # Add the small rooms that larger homes have more often.
    if n >= 4 or (n == 3 and rng.random() < 0.3):
        types.append(RoomType.BATHROOM)
    for type_, chances in (
        (RoomType.WC, (0, 0.1, 0.4, 0.7, 0.8)),
        (RoomType.STORE, (0, 0.2, 0.3, 0.4, 0.5)),
        (RoomType.WARDROBE, (0, 0.1, 0.2, 0.3, 0.4)),
    ):
        if rng.random() < chances[n]:
            types.append(type_)
    rooms = [RoomWish(t, drawn_area(rng, t)) for t in types]
    # Homes with few bedrooms have smaller living rooms and kitchens.
    if n <= 1:
        rooms = [
            RoomWish(r.type, max(r.area * 0.9, AREA_RANGE[r.type][0]))
            if r.type in (RoomType.LIVING, RoomType.KITCHEN)
            else r
            for r in rooms
        ]
    # The hall takes its share of what it opens to.
    total = sum(r.area for r in rooms)
    hall = max(total * rng.uniform(*_HALL_SHARE), 3.0 + 0.95 * len(rooms))
    rooms.append(RoomWish(RoomType.HALL, float(hall)))
    # Many rooms need many sides with daylight.
    blind = min(int(rng.choice([0, 1, 2], p=[0.45, 0.4, 0.15])), (2, 2, 2, 1, 0)[n])
    return Programme(
        tuple(rooms),
        open_kitchen=bool(rng.random() < (0.7 if n == 0 else 0.5)),
        n_blind_sides=blind,
        notch=float(total * rng.uniform(0.06, 0.12)) if n >= 1 and rng.random() < 0.3 else 0.0,
        l_shaped=bool(n in (2, 3) and rng.random() < 0.25),
        balcony=bool(rng.random() < 0.4),
    )


def drawn_area(rng: np.random.Generator, type_: RoomType) -> float:
    """Square metres of a room of that type by seed."""
    area = MEDIAN_AREA[type_] * float(np.exp(rng.normal(0.0, _SPREAD.get(type_, 0.18))))
    return float(np.clip(area, *AREA_RANGE[type_]))


def scaled_rooms(wishes: Sequence[RoomWish], area: float) -> list[RoomWish]:
    """The rooms with that area in all, as near as the bounds of each let them; stairs stay."""
    # Scale all alike, then give what a bound refused to the others.
    found = list(wishes)
    for _ in range(20):
        fixed = sum(w.area for w in found if w.type not in AREA_RANGE)
        factor = (area - fixed) / (sum(w.area for w in found) - fixed)
        if abs(factor - 1) < 1e-3:
            break
        found = [_resized(wish, factor) for wish in found]
    return found


def _resized(wish: RoomWish, factor: float) -> RoomWish:
    low, high = AREA_RANGE.get(wish.type, (wish.area, wish.area))
    return replace(wish, area=float(np.clip(wish.area * factor, low, high)))
