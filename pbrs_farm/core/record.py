"""Types of stored JSON and of the tables beside the code. Effect: reads tables."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, TypeAdapter, ValidationError

from pbrs_farm.core.checked_json import sentence
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput

_T = TypeVar("_T")


class Record(BaseModel):
    """A frozen value whose JSON has these fields and no others."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def _nyu40(name: object) -> object:
    if name not in NYU40_NAMES:
        raise ValueError(f"class {name!r} is not in NYU40")
    return NYU40_NAMES.index(str(name))


Nyu40 = Annotated[int, BeforeValidator(_nyu40)]
"""A class of NYU40, by its name in tables."""


def _several(value: object) -> object:
    return value.split("|") if isinstance(value, str) else value


_Of = TypeVar("_Of")
Several = Annotated[tuple[_Of, ...], BeforeValidator(_several)]
"""Some of a kind, in one cell with | between them."""


def _spaced(value: object) -> object:
    return value.split() if isinstance(value, str) else value


Spaced = Annotated[_Of, BeforeValidator(_spaced)]
"""A tuple of numbers, in one cell with spaces between them: a colour, a point."""


def read_toml(path: Path, kind: type[_T]) -> _T:
    """Read a TOML table of the package as a kind that pydantic validates; BadInput names file and entry."""
    return _read(path, kind, tomllib.loads)


def read_csv(path: Path, row: type[_T]) -> tuple[_T, ...]:
    """Rows of a CSV of the package, # lines left out, empty cells as defaults; BadInput as of read_toml."""

    def rows(text: str) -> list[dict[str, str]]:
        lines = (line for line in text.splitlines() if not line.startswith("#"))
        # Empty cells mean the default value.
        return [{k: v for k, v in row.items() if v} for row in csv.DictReader(lines)]

    return _read(path, tuple[row, ...], rows)  # type: ignore[valid-type]


def _read(path: Path, kind: type[_T], parse: Callable[[str], Any]) -> _T:
    try:
        raw = parse(path.read_text("utf-8-sig"))
    except (OSError, ValueError, csv.Error) as error:
        raise BadInput(path.name, "", str(error)) from error
    try:
        return TypeAdapter(kind).validate_python(raw)
    except ValidationError as error:
        wrong = error.errors()[0]
        # Rows that have a name are known by it.
        names, entry = [], raw
        for key in wrong["loc"]:
            entry = _within(entry, key)
            names.append(str(entry.get("name", key) if isinstance(entry, dict) else key))
        raise BadInput(path.name, " ".join(names), sentence(wrong)) from error


def _within(raw: Any, key: int | str) -> Any:
    try:
        return raw[key]
    except (LookupError, TypeError):
        return None
