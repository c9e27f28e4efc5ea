"""A user's programme: JSON -> Programme, every fault one line. Effects: reads the file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, Field, StrictBool, TypeAdapter

from pbrs_farm.core.checked_json import Finite, checked, exactly, json_from_bytes
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.record import Record
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.programme import AREA_RANGE, MEDIAN_AREA, Programme, RoomWish, scaled_rooms
from pbrs_farm.regular_files import MAX_TEXT_BYTES, read_given

MAX_ROOMS: Final = 14
_ASKED_HALL_SHARE: Final = 0.135  # area of an unnamed hall by that of the other rooms
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
    """Read a programme from a file. Raises BadInput, naming the violated rule and a remedy."""
    file_fields = checked(_File, json_from_file(path), path, hint=_FORM)
    wishes = [_wish(path, k, row) for k, row in enumerate(file_fields.rooms)]
    wishes = _with_area(path, file_fields.area, _complete(path, wishes))
    most_notch = 0.2 * sum(w.area for w in wishes)
    return Programme(
        tuple(wishes),
        open_kitchen=file_fields.open_kitchen,
        n_blind_sides=int(file_fields.n_blind_sides),
        notch=_number_within(path, "notch", file_fields.notch, (0, most_notch)),
        l_shaped=file_fields.l_shaped,
        balcony=file_fields.balcony,
        adjacent=_adjacent(path, file_fields.adjacent, wishes),
    )


def json_from_file(path: Path) -> Any:
    """The value of a JSON file. Raises BadInput where it cannot be read."""
    return json_from_bytes(read_given(path, MAX_TEXT_BYTES), path, error=BadInput)


def _wish(path: Path, number: int, row: object) -> RoomWish:
    place = f"room {number + 1}"
    room = checked(_Room, {"type": row} if isinstance(row, str) else row, path, place)
    type_ = RoomType(room.type)
    area = MEDIAN_AREA.get(type_, 0.0)
    if "area" in room.model_fields_set:
        area = _number_within(path, f"{place} ({room.type})", room.area, AREA_RANGE[type_], " m2")
    return RoomWish(type_, area, room.name[:60])


def _adjacent(
    path: Path, rows: list[Any], wishes: list[RoomWish]
) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """Pairs of rooms by name or type: the first shares a wall with one that the second names."""
    adjacent = []
    for number, row in enumerate(rows):
        place = f"adjacent {number + 1}"
        words = checked(_PAIR, row, path, place, hint='["Ada", "bathroom"]')
        firsts, seconds = (_called(path, place, word, wishes) for word in words)
        if len(firsts) > 1:
            text = f"{words[0]!r} is {len(firsts)} rooms"
            raise BadInput(path, place, text, hint="name the room and write its name here")
        partners = tuple(k for k in seconds if k != firsts[0])
        if not partners:
            raise BadInput(path, place, f"{words[0]!r} is one room")
        adjacent.append((firsts[0], partners))
    return tuple(adjacent)


def _called(path: Path, place: str, word: str, wishes: list[RoomWish]) -> list[int]:
    matches = [k for k, w in enumerate(wishes) if w.name == word]
    matches = matches or [k for k, w in enumerate(wishes) if w.type.value == word]
    if not matches:
        names = ", ".join(dict.fromkeys(w.name or w.type.value for w in wishes))
        raise BadInput(path, place, f"no room is called {word[:40]!r}", hint=f"one of {names}")
    return matches


def _number_within(
    path: Path, place: str, value: float, bounds: tuple[float, float], unit: str = ""
) -> float:
    low, high = bounds
    if not low <= value <= high:
        nearest = min(max(value, low), high)
        raise BadInput(
            path,
            place,
            f"has {value:g}{unit}; {low:g} to {high:g} works",
            hint=f"the nearest is {nearest:g}{unit}",
        )
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
    # A hall without a given area takes its share of the adjacent rooms.
    rooms = [w for w in wishes if w.type is not RoomType.HALL]
    share = max(_ASKED_HALL_SHARE * sum(w.area for w in rooms), 3.0 + 0.95 * len(rooms))
    hall_wish = next((w for w in wishes if w.type is RoomType.HALL), RoomWish(RoomType.HALL, 0.0))
    hall = RoomWish(RoomType.HALL, hall_wish.area or share, hall_wish.name)
    rooms.sort(key=lambda w: w.type not in (RoomType.LIVING, RoomType.STUDIO))
    return [*rooms, hall]


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
            path,
            "area",
            f"{len(wishes)} rooms in {area:g} m2 cannot be met",
            hint=f"rooms of these types take {math.ceil(least + hall)} to {most:.0f} m2",
        )
    return scaled_rooms(wishes, area)
