"""The check of each field of a root's JSON files: the table fields.csv against the stored files.

Effects: reads files. A field without a row is listed by its name, so that no field is overlooked.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pbrs_farm.check.stored_files import BadFile, object_from_json, stored_bytes
from pbrs_farm.core.record import Record, read_csv

UNOWNED = "no check covers it"


class FieldRow(Record):
    """A field of a file: its check, or the reason why it has no check."""

    file: str
    field: str
    check: str = ""
    why: str = ""


@functools.cache
def field_rows() -> tuple[FieldRow, ...]:
    """The table, fields.csv, in which the first row that fits a field counts."""
    return read_csv(Path(__file__).parent / "fields.csv", FieldRow)


def fields_of(value: Any, path: str = "") -> Iterator[str]:
    """The paths of a JSON value's fields: keys behind dots, [] for each entry of a list of objects.

    >>> sorted(set(fields_of({"a": [{"b": 1}, {"c": [1, 2]}], "d": {}})))
    ['a[].b', 'a[].c', 'd']
    """
    if isinstance(value, dict) and value:
        for key, below in value.items():
            # Dots in a key are escaped.
            yield from fields_of(below, f"{path}.{_word(key)}" if path else _word(key))
    elif isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        for entry in value:
            yield from fields_of(entry, f"{path}[]")
    else:
        yield path


def _word(key: str) -> str:
    return str(key).replace(".", "_")


def owner_of(file: str, field: str) -> FieldRow | None:
    """The row of a field; None for an unknown field."""
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
    """(File, field) -> number of files of a root that have it; files without JSON are skipped."""
    counts: Counter[tuple[str, str]] = Counter()
    for name, file in _documents(root, houses):
        try:
            data = stored_bytes(file)
            lines = data.splitlines() if file.suffix == ".jsonl" else [data]
            paths = {path for line in lines for path in fields_of(object_from_json(line))}
        except BadFile:
            continue
        counts.update((name, path) for path in paths)
    return counts


def _documents(root: Path, houses: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Every JSON file of a root, with its name in the table."""
    yield from ((f.name, f) for f in sorted(root.glob("*.json*")) if f.is_file())
    for house in houses:
        yield from ((f.name, f) for f in sorted(house.glob("*.json*")) if f.is_file())
        yield from (("marker", f) for f in sorted(house.glob("done/*.json")) if f.is_file())
        yield from ((f.name, f) for f in sorted(house.glob("views/*/*.json")) if f.is_file())


def unowned(fields: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The pairs (file, field) without a row in the table, in order."""
    return sorted(pair for pair in fields if owner_of(*pair) is None)


def field_lines(fields: Counter[tuple[str, str]]) -> tuple[list[str], list[str]]:
    """Lines of the certificate: numbers of fields with a check, by file; fields without, by reason."""
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
    # Unknown fields come first.
    order = sorted(reasons, key=lambda pair: (pair[1] != UNOWNED, pair))
    return looked, [f"{file} {', '.join(sorted(reasons[file, why]))}: {why}" for file, why in order]
