"""Table of the material fields of glTF, USD and MTL; as a program, prints the rows of docs/houses/surfaces.md."""

from __future__ import annotations

import csv
import io
from functools import cache
from importlib.resources import files
from typing import NamedTuple


class MaterialField(NamedTuple):
    """A row of the table."""

    format: str  # "glTF", "USD", "MTL"
    field: str  # names as the format has them, parted by "; "
    use: str  # "read"; "note" if it is reported but not read; "-": without visible effect
    text: str


@cache
def material_fields() -> tuple[MaterialField, ...]:
    """Every row, in the order of the table."""
    text = files("pbrs_farm.read.common").joinpath("material_fields.csv").read_text("utf-8")
    return tuple(MaterialField(**row) for row in csv.DictReader(io.StringIO(text)))


@cache
def noted_fields(of_format: str) -> tuple[str, ...]:
    """The names of fields of a format whose presence is a note."""
    rows = (r for r in material_fields() if r.format == of_format and r.use == "note")
    return tuple(name for row in rows for name in row.field.split("; "))


def rows_of_docs() -> str:
    """The table as docs/houses/surfaces.md has it."""
    cells = (
        f"| {r.format} | `{'`, `'.join(r.field.split('; '))}` | {r.use} | {r.text} |"
        for r in material_fields()
    )
    return "\n".join(cells)


if __name__ == "__main__":
    print(rows_of_docs())  # noqa: T201
