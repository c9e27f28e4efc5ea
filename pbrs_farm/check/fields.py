"""Which check looks at each field of a root's JSON files: the table fields.csv against what is stored.

Effects: reads files. A field that the table does not know is told of by its name, so that none slips through.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pbrs_farm.check.stored_files import BadFile, object_from_json, stored_bytes
from pbrs_farm.core.record import Record, read_csv

UNOWNED = "no check knows it"


class FieldRow(Record):
    """A field of a file: the check that looks at it, or why none does."""

    file: str
    field: str
    check: str = ""
    why: str = ""


@functools.cache
def field_rows() -> tuple[FieldRow, ...]:
    """The table, fields.csv: the first row that fits a field is its own."""
    return read_csv(Path(__file__).parent / "fields.csv", FieldRow)


def fields_of(value: Any, path: str = "") -> Iterator[str]:
    """The paths of a JSON value's fields: keys behind dots, [] for each entry of a list of objects.

    >>> sorted(set(fields_of({"a": [{"b": 1}, {"c": [1, 2]}], "d": {}})))
    ['a[].b', 'a[].c', 'd']
    """
    if isinstance(value, dict) and value:
        for key, below in value.items():
            # A dot in a key is no step down.
            yield from fields_of(below, f"{path}.{_word(key)}" if path else _word(key))
    elif isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        for entry in value:
            yield from fields_of(entry, f"{path}[]")
    else:
        yield path


def _word(key: str) -> str:
    return str(key).replace(".", "_")


def owner_of(file: str, field: str) -> FieldRow | None:
    """The row of the table that a field has; None for one that no check knows."""
    return _owner(file, tuple(field.split(".")))


@functools.cache
def _owner(file: str, parts: tuple[str, ...]) -> FieldRow | None:
    for row in field_rows():
        if row.file == file and _fits(tuple(row.field.split(".")), parts):
            return row
    return None


def _fits(pattern: tuple[str, ...], parts: tuple[str, ...]) -> bool:
    if pattern and pattern[-1] == "**":
        return len(parts) >= len(pattern) and _fits(pattern[:-1], parts[: len(pattern) - 1])
    return len(pattern) == len(parts) and all(
        p in ("*", part) for p, part in zip(pattern, parts, strict=True)
    )


def stored_fields(root: Path, houses: Iterable[Path]) -> Counter[tuple[str, str]]:
    """(File, field) -> in how many files of a root it is; files that are no JSON have none."""
    found: Counter[tuple[str, str]] = Counter()
    for name, file in _documents(root, houses):
        try:
            data = stored_bytes(file)
            lines = data.splitlines() if file.suffix == ".jsonl" else [data]
            paths = {path for line in lines for path in fields_of(object_from_json(line))}
        except BadFile:
            continue
        found.update((name, path) for path in paths)
    return found


def _documents(root: Path, houses: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Every JSON file of a root, with the name that the table has for it."""
    yield from ((f.name, f) for f in sorted(root.glob("*.json*")) if f.is_file())
    for house in houses:
        yield from ((f.name, f) for f in sorted(house.glob("*.json*")) if f.is_file())
        yield from (("marker", f) for f in sorted(house.glob("done/*.json")) if f.is_file())
        yield from ((f.name, f) for f in sorted(house.glob("views/*/*.json")) if f.is_file())


def unowned(fields: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Those of (file, field) that the table does not know, in order."""
    return sorted(pair for pair in fields if owner_of(*pair) is None)


def field_lines(fields: Counter[tuple[str, str]]) -> tuple[list[str], list[str]]:
    """Lines of the certificate: fields that are looked at, by file; those that are not, by reason."""
    owned: dict[str, set[str]] = {}
    reasons: dict[tuple[str, str], set[str]] = {}
    for file, field in sorted(fields):
        row = owner_of(file, field)
        if row is not None and row.check:
            owned.setdefault(file, set()).add(row.field)
        else:
            why = UNOWNED if row is None else row.why
            reasons.setdefault((file, why), set()).add(field if row is None else row.field)
    looked = [f"{file}: {len(names)} kinds of fields" for file, names in owned.items()]
    # What no check knows stands first, and by name.
    order = sorted(reasons, key=lambda pair: (pair[1] != UNOWNED, pair))
    return looked, [f"{file} {', '.join(sorted(reasons[file, why]))}: {why}" for file, why in order]
