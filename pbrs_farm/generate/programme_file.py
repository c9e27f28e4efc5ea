"""A user's programme: JSON -> Programme, every fault one line. Effects: reads the file.

{"rooms": [{"type": "living", "area": 24}, {"type": "bedroom", "name": "Ada"}],
 "open_kitchen": true, "balcony": false, "adjacent": [["Ada", "bathroom"]]}
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.programme import AREA_RANGE, MEDIAN_AREA, Programme, RoomWish, scaled_rooms
from pbrs_farm.regular_files import MAX_TEXT_BYTES, fault_of, read_regular

MAX_ROOMS: Final = 14
_TYPES: Final = [t.value for t in AREA_RANGE]
_NUMBERS: Final = ("n_blind_sides", "notch")
_FLAGS: Final = ("open_kitchen", "l_shaped", "balcony")
_HALL_SHARE: Final = 0.135  # of the other rooms, where the file names no hall


def json_from_file(path: Path) -> Any:
    """The value of a JSON file. Raises BadInput where it cannot be read."""
    try:
        return json.loads(read_regular(path, MAX_TEXT_BYTES).decode("utf-8"))
    except OSError as error:
        raise BadInput(path, "", fault_of(error)) from None
    except (ValueError, RecursionError) as error:
        if not path.stat().st_size:
            raise BadInput(path, "", "is empty") from None
        raise BadInput(path, "", f"is no JSON: {error}") from None


def programme_from_json(path: Path) -> Programme:
    """The programme of a file. Raises BadInput, naming the rule that is broken and what would do."""
    value = json_from_file(path)
    if not isinstance(value, dict) or not isinstance(value.get("rooms"), list):
        raise BadInput(path, "", "is no programme", hint='{"rooms": [{"type": "bedroom"}, ...]}')
    fields = ("rooms", "area", "adjacent", *_NUMBERS, *_FLAGS)
    unknown = sorted(set(value) - set(fields))
    if unknown:
        known = ", ".join(fields)
        raise BadInput(path, unknown[0], "is no field of a programme", hint=f"one of {known}")
    wishes = [_wish(path, k, row) for k, row in enumerate(value["rooms"])]
    wishes = _with_area(path, value.get("area"), _complete(path, wishes))
    for key in _FLAGS:
        if not isinstance(value.get(key, False), bool):
            raise BadInput(path, key, "is not true or false")
    sides = _number(path, "n_blind_sides", value.get("n_blind_sides", 0), (0, 2))
    notch = _number(path, "notch", value.get("notch", 0), (0, 0.2 * sum(w.area for w in wishes)))
    return Programme(
        tuple(wishes), open_kitchen=value.get("open_kitchen", False), n_blind_sides=int(sides),
        notch=notch, l_shaped=value.get("l_shaped", False), balcony=value.get("balcony", False),
        adjacent=_adjacent(path, value.get("adjacent", []), wishes),
    )  # fmt: skip


def _wish(path: Path, number: int, row: object) -> RoomWish:
    place = f"room {number + 1}"
    if isinstance(row, str):
        row = {"type": row}
    if not isinstance(row, dict) or not isinstance(row.get("type"), str):
        raise BadInput(path, place, "has no type", hint=f"one of {', '.join(_TYPES)}")
    if row["type"] not in _TYPES:
        types = ", ".join(_TYPES)
        raise BadInput(path, f"{place} ({row['type']})", "is no room type", hint=f"one of {types}")
    type_ = RoomType(row["type"])
    median = MEDIAN_AREA.get(type_, 0.0)
    area = row.get("area", median)
    if "area" in row:
        area = _number(path, f"{place} ({type_.value})", area, AREA_RANGE[type_], " m2")
    name = row.get("name", "")
    if not isinstance(name, str):
        raise BadInput(path, place, "has a name that is no text")
    return RoomWish(type_, float(area), name[:60])


def _adjacent(
    path: Path, rows: object, wishes: list[RoomWish]
) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """Pairs of rooms by name or type: the first shares a wall with one that the second names."""
    if not isinstance(rows, list):
        raise BadInput(path, "adjacent", "is no list of pairs", hint='[["Ada", "bathroom"]]')
    found = []
    for number, row in enumerate(rows):
        place = f"adjacent {number + 1}"
        if not isinstance(row, list) or len(row) != 2 or not all(isinstance(x, str) for x in row):
            raise BadInput(path, place, "is no pair of rooms", hint='["Ada", "bathroom"]')
        firsts, seconds = (_called(path, place, word, wishes) for word in row)
        if len(firsts) > 1:
            text = f"{row[0]!r} is {len(firsts)} rooms"
            raise BadInput(path, place, text, hint="name the room and write its name here")
        others = tuple(k for k in seconds if k != firsts[0])
        if not others:
            raise BadInput(path, place, f"{row[0]!r} is one room")
        found.append((firsts[0], others))
    return tuple(found)


def _called(path: Path, place: str, word: str, wishes: list[RoomWish]) -> list[int]:
    found = [k for k, w in enumerate(wishes) if w.name == word]
    found = found or [k for k, w in enumerate(wishes) if w.type.value == word]
    if not found:
        names = ", ".join(dict.fromkeys(w.name or w.type.value for w in wishes))
        raise BadInput(path, place, f"no room is called {word[:40]!r}", hint=f"one of {names}")
    return found


def _number(
    path: Path, place: str, value: object, bounds: tuple[float, float], unit: str = ""
) -> float:
    low, high = bounds
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BadInput(path, place, "is no number")
    if not low <= value <= high:
        nearest = min(max(value, low), high)
        raise BadInput(
            path, place, f"has {value:g}{unit}; {low:g} to {high:g} works",
            hint=f"the nearest is {nearest:g}{unit}",
        )  # fmt: skip
    return float(value)


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
    share = max(_HALL_SHARE * sum(w.area for w in others), 3.0 + 0.95 * len(others))
    given = next((w for w in wishes if w.type is RoomType.HALL), RoomWish(RoomType.HALL, 0.0))
    hall = RoomWish(RoomType.HALL, given.area or share, given.name)
    others.sort(key=lambda w: w.type not in (RoomType.LIVING, RoomType.STUDIO))
    return [*others, hall]


def _with_area(path: Path, area: object, wishes: list[RoomWish]) -> list[RoomWish]:
    """The rooms scaled to the area of the whole home, where one is wished."""
    if area is None:
        return wishes
    # Each room has a least and a largest area.
    least = sum(AREA_RANGE[w.type][0] for w in wishes if w.type is not RoomType.HALL)
    hall = 3.0 + 0.95 * (len(wishes) - 1)
    most = sum(AREA_RANGE[w.type][1] for w in wishes)
    if isinstance(area, bool) or not isinstance(area, (int, float)):
        raise BadInput(path, "area", "is no number")
    if not least + hall <= area <= most:
        raise BadInput(
            path, "area", f"{len(wishes)} rooms in {area:g} m2 cannot be met",
            hint=f"rooms of these types take {math.ceil(least + hall)} to {most:.0f} m2",
        )  # fmt: skip
    return scaled_rooms(wishes, float(area))
