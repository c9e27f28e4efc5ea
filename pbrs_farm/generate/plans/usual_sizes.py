"""Default sizes for furniture whose file gives none; no effects."""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files

from pbrs_farm.home.names import words_of

Size = tuple[float, float, float]  # width, height, depth


def usual_size(name: str) -> Size | None:
    """Size by the row of usual_sizes.csv that a name is, else the last with a word of it; or None."""
    table = _sizes_by_name()
    key = name.lower().replace("_", "").replace(" ", "")
    if key in table:
        return table[key]
    words = words_of(name.replace("_", " "))
    return next((size for word, size in reversed(table.items()) if word in words), None)


@cache
def _sizes_by_name() -> dict[str, Size]:
    text = files("pbrs_farm.generate.plans").joinpath("usual_sizes.csv").read_text("utf-8")
    return {
        row["name"]: (float(row["width"]), float(row["height"]), float(row["depth"]))
        for row in csv.DictReader(text.splitlines())
    }
