"""A user's class map: a CSV table from properties of an instance to an id and a name.

    from,id,name
    chair,1,seat
    sofa,1,seat
    *bottle*,2,bottle
    wall,3,background

Effect: reads the table. `from` is a class of NYU40, a kind of item, a source's class, or an item's
name, with the wildcards * ? and [] as in a shell. The first matching row wins; instances without a row
get 0.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.shown_text import MAX_NAME, hint_of_choice, question, shown
from pbrs_farm.regular_files import text_given

_COLUMNS: Final = ("from", "id", "name")
_MAX_ID: Final = 65535
_MAX_ROWS: Final = 100_000
_WILD: Final = frozenset("*?[")
_MISSPELT: Final = (
    0.8  # similarity (difflib's ratio) from which a word counts as a misspelt NYU40 class
)
_KINDS: Final = tuple(str(kind) for kind in ItemKind)
_FIELDS: Final = ("class", "kind", "source_class", "name")  # of an instance, that a word may say
_NAMES: Final = ("name", "source_class")  # of an instance, that a pattern may fit
_STRUCTURE: Final = frozenset(
    ("wall", "floor", "ceiling", "door", "window", "otherstructure", "ground")
)


@dataclass(frozen=True, slots=True)
class ClassRule:
    """A row of the table."""

    word: str  # small letters
    id: int  # 0..65535, 0 = nothing
    name: str

    def fits(self, instance: Mapping[str, Any]) -> bool:
        """True if a word, in any case, equals an instance's field, or with wildcards matches its name."""
        if _WILD.isdisjoint(self.word):
            return any(str(instance.get(f, "")).lower() == self.word for f in _FIELDS)
        return any(fnmatchcase(str(instance.get(f, "")).lower(), self.word) for f in _NAMES)


@dataclass(frozen=True)
class ClassMap:
    """The classes of a user's table."""

    rows: tuple[ClassRule, ...]

    @cached_property
    def names(self) -> dict[int, str]:
        """Id -> name of each class, by id, without 0."""
        return dict(sorted({row.id: row.name for row in self.rows if row.id}.items()))

    @cached_property
    def structure(self) -> frozenset[int]:
        """The ids whose rows all name a part of the building: wall, floor, ceiling, door, window."""
        objects = {row.id for row in self.rows if row.word not in _STRUCTURE}
        return frozenset(self.names) - objects

    def id_of(self, instance: Mapping[str, Any]) -> int:
        """Class of a row of view.json's `instances` by the first matching row of the table; 0 without one."""
        return next((row.id for row in self.rows if row.fits(instance)), 0)

    def label(
        self, instance: NDArray[Any], instances: Sequence[Mapping[str, Any]]
    ) -> NDArray[np.uint16]:
        """(H, W) uint16 classes of instance ids by the map and the rows in view.json; 0 without a row."""
        table = np.zeros(max([int(instance.max(initial=0)), *(r["id"] for r in instances)]) + 1)
        for row in instances:
            table[row["id"]] = self.id_of(row)
        return np.asarray(table[instance], np.uint16)


def class_map(table: str | Path | ClassMap) -> ClassMap:
    """The classes of a CSV file, or of a map already read.

    Raises BadInput, naming file and line, for an unreadable file, a missing column, an id that is not an
    integer in 0..65535, an id with two names or a name with two ids, a repeated `from`, and a misspelt
    NYU40 class.
    """
    if isinstance(table, ClassMap):
        return table
    path = Path(table)
    rows: dict[str, ClassRule] = {}
    line_of: dict[str, int] = {}
    name_of: dict[int, str] = {}
    id_of: dict[str, int] = {}
    for line, cells in _cells(path):
        row = _table_row(path, line, cells)
        if row.word in rows:
            text = f"{_quoted(row.word)} is already in line {line_of[row.word]}"
            raise BadInput(path, f"line {line}", text, hint="the first row that fits wins")
        if row.id and name_of.setdefault(row.id, row.name) != row.name:
            text = f"class {row.id} is {_quoted(row.name)}, but {_quoted(name_of[row.id])} above"
            raise BadInput(path, f"line {line}", text, hint="an id has one name")
        if row.id and id_of.setdefault(row.name, row.id) != row.id:
            text = f"{_quoted(row.name)} is class {row.id}, but {id_of[row.name]} above"
            raise BadInput(path, f"line {line}", text, hint="a name has one id")
        rows[row.word], line_of[row.word] = row, line
        if len(rows) > _MAX_ROWS:
            raise BadInput(path, f"line {line}", f"more than {_MAX_ROWS:,} rows")
    if not any(row.id for row in rows.values()):
        raise BadInput(path, "", "names no class", hint="rows such as chair,1,seat")
    return ClassMap(tuple(rows.values()))


def _cells(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Line and cells by column of each row; blank lines and those that begin with # are skipped."""
    text = text_given(path)
    lines = ["" if line.startswith("#") else line for line in text.splitlines()]
    reader = csv.reader(lines, strict=True)
    columns: list[str] | None = None
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            if columns is None:
                columns = _columns(path, reader.line_num, cells)
                continue
            if len(cells) != len(columns):
                text = f"{len(cells)} cells, not {len(columns)}"
                raise BadInput(path, f"line {reader.line_num}", text, hint=_hint(columns))
            yield reader.line_num, dict(zip(columns, (cell.strip() for cell in cells), strict=True))
    except csv.Error as error:
        raise BadInput(path, f"line {reader.line_num}", f"is not valid CSV: {error}") from None
    if columns is None:
        raise BadInput(path, "", "is empty", hint=_hint(_COLUMNS))


def _columns(path: Path, line: int, cells: list[str]) -> list[str]:
    columns = [cell.strip().lower() for cell in cells]
    place = f"line {line}"
    for column in columns:
        if column not in _COLUMNS:
            fault = f"{_quoted(column)} is not a column"
            raise BadInput(path, place, fault, hint=hint_of_choice(column, _COLUMNS))
        if columns.count(column) > 1:
            raise BadInput(path, place, f"has the column {column} twice")
    for column in _COLUMNS:
        if column not in columns:
            raise BadInput(path, place, f"has no column {column}", hint=_hint(_COLUMNS))
    return columns


def _hint(columns: Sequence[str]) -> str:
    return f"the columns are {','.join(columns)}"


def _table_row(path: Path, line: int, cells: dict[str, str]) -> ClassRule:
    word, number, name = cells["from"].lower(), cells["id"], cells["name"]
    place = f"line {line}"
    if not word:
        raise BadInput(path, place, "from is empty")
    if not (number.isascii() and number.isdigit() and len(number) < 7 and int(number) <= _MAX_ID):
        text = f"id {_quoted(number)} is not a whole number of 0..{_MAX_ID}"
        raise BadInput(path, place, text, hint="0 is nothing")
    if int(number) and not name:
        raise BadInput(path, place, f"class {number} has no name")
    if name != shown(name):
        fault = f"name {_quoted(name)} is too long or cannot be printed"
        raise BadInput(path, place, fault, hint=f"at most {MAX_NAME} characters")
    names = (*NYU40_NAMES, *_KINDS)
    if _WILD.isdisjoint(word) and word not in names:
        # A word similar to a class is a misspelt one; others are names of a source or an item.
        near = get_close_matches(word[:MAX_NAME], NYU40_NAMES, n=1, cutoff=_MISSPELT)
        if near:
            hint = f"{question(near)} a pattern such as {shown(word)}* says items of that name"
            raise BadInput(path, place, f"{_quoted(word)} is not a class of NYU40", hint=hint)
    return ClassRule(word, int(number), name)


def _quoted(text: str) -> str:
    return repr(shown(text))
