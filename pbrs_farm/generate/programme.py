"""Programmes: which rooms a home has and how large; drawn by seed or given by a user; no effects.

Medians and shares are those of nine homes drawn by people (65 rooms), docs/homes.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, Field, StrictBool, TypeAdapter

from pbrs_farm.core.checked_json import Finite, checked, exactly, json_from_bytes
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.made_home import check_wishes
from pbrs_farm.core.record import Record
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.plan_families import FLAT, PlanFamily, drawn_family, plan_families
from pbrs_farm.regular_files import MAX_TEXT_BYTES, read_given

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
    n_blind_sides: int = 0  # sides of the outline that neighbours' homes stand against
    notch: float = 0.0  # area of a corner that the outline leaves out, square metres
    l_shaped: bool = False  # the living room has a second arm
    balcony: bool = False
    adjacent: tuple[tuple[int, tuple[int, ...]], ...] = ()  # room shares a wall with one of others
    is_upper: bool = False  # the storey above: one comes up the stairs, not in by a front door
    is_court: bool = False  # the notch lies in the middle of a side: the outline is a U
    plans: str = FLAT  # the family that it is of

    @property
    def family(self) -> PlanFamily:
        """What homes of its family have in common."""
        return plan_families()[self.plans]

    def entered_from(self, type_: RoomType) -> tuple[RoomType, ...]:
        """The rooms that the door of a room may open to, the preferred one first."""
        family, types = self.family, {wish.type for wish in self.rooms}
        found: tuple[RoomType, ...] = (RoomType.HALL,)
        if type_ is RoomType.BEDROOM and family.bedrooms_at != "hall" and types & set(_LIVING):
            found = _LIVING if family.bedrooms_at == "living" else (*_LIVING, RoomType.HALL)
        return found

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
    plans: str = ""  # family of plans; "" = drawn by seed

    def __post_init__(self) -> None:
        """Raise BadInput for ranges that no home can meet."""
        check_wishes(self.bedrooms, self.area, self.storeys)


def drawn_programme(rng: np.random.Generator, wishes: Wishes | None = None) -> Programme:
    """A programme by seed: studio to four bedrooms, closed or open kitchen, WC, store, wardrobe."""
    wishes = with_family(wishes or Wishes(), rng)
    # Draw until the area is as wished; then scale the rooms to it.
    for _ in range(64):
        programme = _drawn(rng, wishes.bedrooms, wishes.plans)
        if wishes.area[0] <= programme.area <= wishes.area[1]:
            return programme
    area = float(np.clip(programme.area, *wishes.area))
    return replace(programme, rooms=tuple(scaled_rooms(programme.rooms, area)))


def with_family(wishes: Wishes, rng: np.random.Generator) -> Wishes:
    """The wishes with a family of plans: one by seed where none is wished."""
    return replace(wishes, plans=wishes.plans or drawn_family(rng, wishes.bedrooms))


def _drawn(rng: np.random.Generator, bedrooms: tuple[int, int], plans: str) -> Programme:
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
    # The hall takes its share of what it opens to.
    total = sum(r.area for r in rooms)
    doors = Programme(tuple(rooms), plans=plans)
    n_doors = sum(RoomType.HALL in found for found in map(doors.entered_from, types))
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
    area = larger * MEDIAN_AREA[type_] * float(np.exp(rng.normal(0.0, _SPREAD.get(type_, 0.18))))
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


# A user's programme: JSON -> Programme, every fault one line. Effects: reads the file.
# {"rooms": [{"type": "living", "area": 24}, {"type": "bedroom", "name": "Ada"}], "open_kitchen":
# true, "balcony": false, "adjacent": [["Ada", "bathroom"]]}


MAX_ROOMS: Final = 14
_ASKED_HALL_SHARE: Final = 0.135  # of the other rooms, where the file names no hall
_FORM: Final = '{"rooms": [{"type": "bedroom"}, ...]}'


class _Room(BaseModel):
    """A room as the file says it."""

    type: Literal[tuple(t.value for t in AREA_RANGE)]  # type: ignore[valid-type]
    area: Finite = 0.0
    name: str = ""


class _File(Record):
    """A programme as the file says it; its rooms and pairs are looked at one by one."""

    rooms: list[Any]
    area: Finite | None = None
    adjacent: list[Any] = Field(default_factory=list)
    n_blind_sides: Finite = Field(0, ge=0, le=2)
    notch: Finite = 0.0
    open_kitchen: StrictBool = False
    l_shaped: StrictBool = False
    balcony: StrictBool = False


_PAIR: Final = TypeAdapter(Annotated[tuple[str, str], exactly(2, "rooms")])


def programme_from_json(path: Path) -> Programme:
    """The programme of a file. Raises BadInput, naming the rule that is broken and what would do."""
    given = checked(_File, json_from_file(path), path, hint=_FORM)
    wishes = [_wish(path, k, row) for k, row in enumerate(given.rooms)]
    wishes = _with_area(path, given.area, _complete(path, wishes))
    most_notch = 0.2 * sum(w.area for w in wishes)
    return Programme(
        tuple(wishes), open_kitchen=given.open_kitchen, n_blind_sides=int(given.n_blind_sides),
        notch=_within(path, "notch", given.notch, (0, most_notch)), l_shaped=given.l_shaped,
        balcony=given.balcony, adjacent=_adjacent(path, given.adjacent, wishes),
    )  # fmt: skip


def json_from_file(path: Path) -> Any:
    """The value of a JSON file. Raises BadInput where it cannot be read."""
    return json_from_bytes(read_given(path, MAX_TEXT_BYTES), path, error=BadInput)


def _wish(path: Path, number: int, row: object) -> RoomWish:
    place = f"room {number + 1}"
    room = checked(_Room, {"type": row} if isinstance(row, str) else row, path, place)
    type_ = RoomType(room.type)
    area = MEDIAN_AREA.get(type_, 0.0)
    if "area" in room.model_fields_set:
        area = _within(path, f"{place} ({room.type})", room.area, AREA_RANGE[type_], " m2")
    return RoomWish(type_, area, room.name[:60])


def _adjacent(
    path: Path, rows: list[Any], wishes: list[RoomWish]
) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """Pairs of rooms by name or type: the first shares a wall with one that the second names."""
    found = []
    for number, row in enumerate(rows):
        place = f"adjacent {number + 1}"
        words = checked(_PAIR, row, path, place, hint='["Ada", "bathroom"]')
        firsts, seconds = (_called(path, place, word, wishes) for word in words)
        if len(firsts) > 1:
            text = f"{words[0]!r} is {len(firsts)} rooms"
            raise BadInput(path, place, text, hint="name the room and write its name here")
        others = tuple(k for k in seconds if k != firsts[0])
        if not others:
            raise BadInput(path, place, f"{words[0]!r} is one room")
        found.append((firsts[0], others))
    return tuple(found)


def _called(path: Path, place: str, word: str, wishes: list[RoomWish]) -> list[int]:
    found = [k for k, w in enumerate(wishes) if w.name == word]
    found = found or [k for k, w in enumerate(wishes) if w.type.value == word]
    if not found:
        names = ", ".join(dict.fromkeys(w.name or w.type.value for w in wishes))
        raise BadInput(path, place, f"no room is called {word[:40]!r}", hint=f"one of {names}")
    return found


def _within(
    path: Path, place: str, value: float, bounds: tuple[float, float], unit: str = ""
) -> float:
    low, high = bounds
    if not low <= value <= high:
        nearest = min(max(value, low), high)
        raise BadInput(
            path, place, f"has {value:g}{unit}; {low:g} to {high:g} works",
            hint=f"the nearest is {nearest:g}{unit}",
        )  # fmt: skip
    return value


def _complete(path: Path, wishes: list[RoomWish]) -> list[RoomWish]:
    """The rooms with a hall, the living room first: what the solver asks of a programme."""
    types = [w.type for w in wishes]
    if len(wishes) > MAX_ROOMS:
        raise BadInput(path, "", f"has {len(wishes)} rooms; at most {MAX_ROOMS} work")
    living = [t for t in types if t in (RoomType.LIVING, RoomType.STUDIO)]
    if len(living) != 1:
        raise BadInput(path, "", f"has {len(living)} rooms to live in; one living or studio works")
    for type_, most in ((RoomType.KITCHEN, 1), (RoomType.HALL, 1), (RoomType.BATHROOM, 3)):
        if types.count(type_) > most:
            text = f"has {types.count(type_)} rooms of the type {type_.value}; {most} works"
            raise BadInput(path, "", text)
    if RoomType.BATHROOM not in types:
        raise BadInput(path, "", "has no bathroom", hint='add {"type": "bathroom"}')
    if RoomType.KITCHEN not in types:
        raise BadInput(path, "", "has no kitchen", hint='add {"type": "kitchen"}')
    # A hall that is wished without an area takes its share of what opens to it.
    others = [w for w in wishes if w.type is not RoomType.HALL]
    share = max(_ASKED_HALL_SHARE * sum(w.area for w in others), 3.0 + 0.95 * len(others))
    given = next((w for w in wishes if w.type is RoomType.HALL), RoomWish(RoomType.HALL, 0.0))
    hall = RoomWish(RoomType.HALL, given.area or share, given.name)
    others.sort(key=lambda w: w.type not in (RoomType.LIVING, RoomType.STUDIO))
    return [*others, hall]


def _with_area(path: Path, area: float | None, wishes: list[RoomWish]) -> list[RoomWish]:
    """The rooms scaled to the area of the whole home, where one is wished."""
    if area is None:
        return wishes
    # Each room has a least and a largest area.
    least = sum(AREA_RANGE[w.type][0] for w in wishes if w.type is not RoomType.HALL)
    hall = 3.0 + 0.95 * (len(wishes) - 1)
    most = sum(AREA_RANGE[w.type][1] for w in wishes)
    if not least + hall <= area <= most:
        raise BadInput(
            path, "area", f"{len(wishes)} rooms in {area:g} m2 cannot be met",
            hint=f"rooms of these types take {math.ceil(least + hall)} to {most:.0f} m2",
        )  # fmt: skip
    return scaled_rooms(wishes, area)
