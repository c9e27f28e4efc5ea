"""Families whose facts are rows of families.csv. Effect: reads it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.record import Nyu40, Record, read_csv
from pbrs_farm.furnishings.things.maker import Family, Maker, Size


class _Row(Record):
    """A row of families.csv."""

    name: str
    called: str = ""  # by default the name
    group: str
    nyu40: Nyu40 = OTHERPROP
    place: Place
    variants: int
    width_m: str = ""
    depth_m: str = ""
    height_m: str = ""

    def size(self, m: Maker, *_shared: object) -> Size:
        """Draw width, depth and height."""
        cells = (self.width_m, self.depth_m, self.height_m)
        width, depth, height = (v for cell in cells if cell for v in _drawn(m, cell))
        return width, depth, height


def _drawn(m: Maker, cell: str) -> tuple[float, ...]:
    low, dots, high = cell.partition("..")
    if dots:
        return (m.uniform(float(low), float(high)),)
    return tuple(float(v) for v in m.pick(*cell.split("|")).split("x"))


@cache
def _rows() -> dict[str, _Row]:
    return {row.name: row for row in read_csv(Path(__file__).with_name("families.csv"), _Row)}


def catalogued(
    *,
    of_set: Callable[[Maker], Any] | None = None,
    draw: Callable[..., Any] | None = None,
    size: Callable[..., Size] | None = None,
) -> Callable[[Callable[..., None]], Family]:
    """Decorator like `family` of a function whose facts are the row of its name."""

    def described(build: Callable[..., None]) -> Family:
        row, name = _rows()[build.__name__], build.__name__
        return Family(
            name,
            row.called or name,
            row.group,
            row.nyu40,
            row.place,
            row.variants,
            size or row.size,
            build,
            of_set,
            draw,
        )

    return described
