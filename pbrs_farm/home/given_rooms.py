"""What the vocabularies of other formats call a room -> the word that this project has; no effects.

given_rooms.csv, beside this file, has a row a name: source (3dfront, ai2thor, roomplan, cubicasa,
swiss), name, type. Types are words of room_words.csv; `none` is no room.
"""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files
from typing import Final

NO_ROOM: Final = "none"
"""Type of what is drawn as a room and is none: an outside, a void, a shaft."""


def given_room(source: str, name: str) -> str | None:
    """The type of a source's name, whatever its case and joints; None where the table has none.

    source: the data set's name as in the table ("procthor", "zind"...). For names that follow no
    table use the words of the name instead (`named_kind`).
    """
    return _read_given_rooms().get((source, _plain_name(name)))


def _plain_name(name: str) -> str:
    return "".join(c for c in name.casefold() if c.isalnum())


@cache
def _read_given_rooms() -> dict[tuple[str, str], str]:
    text = files("pbrs_farm.home").joinpath("given_rooms.csv").read_text("utf-8")
    return {
        (r["source"], _plain_name(r["name"])): r["type"] for r in csv.DictReader(text.splitlines())
    }
