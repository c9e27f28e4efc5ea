"""Forms of items that only state numbers. Effect: reads forms.csv."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Final, Literal

from pbrs_farm.core.house import Material
from pbrs_farm.core.record import Record, Several, read_csv
from pbrs_farm.furnishings.things.maker import Maker
from pbrs_farm.geometry.outlines import Outline, fluted, oval, rect, rings

_TERM: Final = re.compile(r"([+-]?[\d.]*)([a-z]?)")
_OUTLINES: Final[Mapping[str, Callable[..., Outline]]] = {
    "rect": rect,
    "oval": oval,
    "fluted": fluted,
}


class _Solid(Record):
    """A row of forms.csv."""

    item: str
    form: Several[str]
    note: str = ""
    solid: Literal["vessel", "turned", "revolve", "rect", "oval", "fluted"]
    sides: int | None = None
    wall_m: float = 0.0  # of a vessel
    sharp: float = 50.0  # degrees of turning that make an edge
    rows: Several[str]


@cache
def _solids() -> Mapping[tuple[str, str], list[_Solid]]:
    by_form: dict[tuple[str, str], list[_Solid]] = defaultdict(list)
    for solid in read_csv(Path(__file__).with_name("forms.csv"), _Solid):
        for form in solid.form:
            by_form[solid.item, form].append(solid)
    return dict(by_form)


@cache
def _terms(cell: str) -> tuple[tuple[float, str], ...]:
    """Factor and size of each term of a sum."""
    terms = _TERM.findall(cell)
    assert "".join(factor + size for factor, size in terms) == cell, f"forms.csv: {cell}"
    return tuple(
        (float(factor if factor.strip("+-") else factor + "1"), size)
        for factor, size in terms
        if factor or size
    )


def number(cell: str, sizes: Mapping[str, float]) -> float:
    """The value of a sum like "1.5r-.02" for an item with these sizes."""
    values = [factor * sizes[size] if size else factor for factor, size in _terms(cell)]
    return sum(values[1:], values[0])


def formed(
    m: Maker, item: str, form: int | str, *, of: Material | None = None, **sizes: float
) -> None:
    """Add the solids that forms.csv has for a form of an item; none where code makes it."""
    for solid in _solids().get((item, str(form)), ()):
        rows = [tuple(number(cell, sizes) for cell in row.split()) for row in solid.rows]
        n = solid.sides
        if solid.solid in _OUTLINES:
            outline = _OUTLINES[solid.solid]
            outline = partial(outline, n=n) if n else outline
            m.loft(rings(outline, rows), sharp=solid.sharp, of=of)
            continue
        profile = [(row[0], row[1]) for row in rows]
        match solid.solid:
            case "vessel":
                m.vessel(profile, solid.wall_m, n=n or 16, of=of)
            case "turned":
                m.turned(profile, n=n or 16, of=of)
            case _:
                m.revolve(profile, n=n or 16, of=of)
