"""Profiles of bottles, glasses and plates. Effect: reads profiles.csv."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pbrs_farm.core.record import Record, Several, Spaced, read_csv
from pbrs_farm.furnishings.things.shapes import Pair


class Turned(Record):
    """A row of profiles.csv."""

    of: str  # its kind of item
    name: str
    radius_m: float = 1.0
    height_m: float = 1.0
    profile: Several[Spaced[Pair]]
    label_from: float = 0.0
    label_to: float = 0.0


@cache
def profiles(of: str) -> dict[str, Turned]:
    """The rows of a kind by name, in the order from which seeds draw."""
    rows = read_csv(Path(__file__).with_name("profiles.csv"), Turned)
    return {row.name: row for row in rows if row.of == of}
