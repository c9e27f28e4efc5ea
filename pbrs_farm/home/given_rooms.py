"""Room types of other data sets translated to ours; no effects.

given_rooms.csv, beside this file, has one row per name: source (3dfront, ai2thor, roomplan,
cubicasa, swiss), name, type. Types are words of room_words.csv; `none` marks areas that are not rooms.
"""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files
from typing import Final

NO_ROOM: Final = "none"
"""Type of areas that are drawn as rooms but are not: outdoors, voids, shafts."""


def given_room(source: str, name: str) -> str | None:
    """Room type for a data set's name, ignoring case and separators; None if the table has no row.

    source: the data set as named in the table ("procthor", "zind"...). For free-form names use
    `named_kind`.
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
