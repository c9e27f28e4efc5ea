"""The check of each field of a root's JSON files, by fields.csv; lists fields without a row. Reads files."""

from __future__ import annotations

import functools
import json
import re
import tarfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from pbrs_farm.check.stored_files import stored_bytes
from pbrs_farm.check.stored_set import SPLITS, SUMS, StoredSet
from pbrs_farm.core.record import Record, read_csv

UNOWNED = "no check covers it"


class FieldRow(Record):
    """A field of a file: its check, or the reason why it has no check."""

    file: str
    field: str = ""  # "" is a whole file
    check: str = ""
    why: str = ""


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


@functools.cache
def owner_of(file: str, field: str) -> FieldRow | None:
    """The row of a field; None for an unknown field."""
    return row_and_names(file, field, "fields")[0]


def _fits(pattern: tuple[str, ...], parts: tuple[str, ...]) -> bool:
    if pattern and pattern[-1] == "**":
        return len(parts) >= len(pattern) and _fits(pattern[:-1], parts[: len(pattern) - 1])
    return len(pattern) == len(parts) and all(
        p in ("*", part) for p, part in zip(pattern, parts, strict=True)
    )


@functools.cache
def _rows(table: str) -> tuple[tuple[FieldRow, re.Pattern[str]], ...]:
    """The rows of a table with the patterns of their files; the first that fits a field counts."""
    rows = read_csv(Path(__file__).with_name(f"{table}.csv"), FieldRow)
    return tuple((row, re.compile(_pattern(row.file))) for row in rows)


def _pattern(file: str) -> str:
    text = re.escape(file).replace(r"\*\*", ".*").replace(r"\*", "[^/]*")
    text = text.replace(r"\{number\}", r"(?P<number>\d+)")
    return re.sub(r"\\{(house|view|key)\\}", r"(?P<\1>[^/]+?)", text)


def row_and_names(
    file: str, field: str = "", table: str = "set_fields"
) -> tuple[FieldRow | None, dict[str, str]]:
    """The row of a field of a set's file, and the names in the file's name; None for an unknown one.

    file: of a form with its word, below its split. field: "" for a file as a whole.
    """
    parts = tuple(field.split("."))
    for row, names in _rows_of(file, table):
        if _fits(tuple(row.field.split(".")), parts):
            return row, dict(names)
    return None, {}


@functools.lru_cache(1000)
def _rows_of(file: str, table: str) -> tuple[tuple[FieldRow, dict[str, str]], ...]:
    """The rows of a table that a file fits, with the names in the file's name."""
    matches = ((row, pattern.fullmatch(file)) for row, pattern in _rows(table))
    return tuple((row, match.groupdict()) for row, match in matches if match)


def fields_of_set(stored: StoredSet) -> set[tuple[str, str]]:
    """(File, field) of a set's files except those of parts.

    A file of a form begins with the form's word, below its folder of a split.
    """
    words = {form.name: form.to for form in stored.forms()}
    markers = (f"done/{path.name}" for path in stored.folder.glob("done/*.json"))
    fields = set[tuple[str, str]]()
    for file in (*stored.files(), *markers):
        folder, *below = name = tuple(file.split("/"))
        if folder == "forms" and len(below) > 2:
            form, _part, *below = below
            name = (words.get(form, form), *(below[1:] if below[0] in SPLITS else below))
        if folder != "parts":
            fields |= {("/".join(name), field) for field in _fields_in(stored.folder / file)}
    return fields


def _fields_in(file: Path) -> set[str]:
    """The fields of a JSON file, the columns of a table, the parts in a tar; "" of other files, none of damaged ones."""
    try:
        if file.suffix in (".json", ".jsonl"):
            data = stored_bytes(file)
            lines = data.splitlines() if file.suffix == ".jsonl" else [data]
            return {field for line in lines for field in fields_of(json.loads(line))}
        if file.suffix == ".csv":
            return set(stored_bytes(file).decode().partition("\n")[0].split(","))
        if file.suffix == ".parquet":
            import pyarrow.parquet as pq

            return set(pq.read_schema(file).names)
        if file.suffix == ".tar":
            with tarfile.open(file) as tar:
                return {name.partition(".")[2].replace(".", "_") for name in tar.getnames()}
    except (ValueError, OSError, tarfile.TarError, RecursionError):
        return set()
    return {""}


def set_lines(stored: StoredSet) -> tuple[list[str], list[str]]:
    """Lines of a set's certificate: kinds of fields with a check, by file; fields without; parts not at hand."""
    rows: dict[tuple[str, str], FieldRow | None] = {}
    for file, field in fields_of_set(stored):
        row, _names = row_and_names(file, field)
        # One line for all files of a kind without a row.
        kind = f"{file.partition('/')[0]}/**{Path(file).suffix}" if row is None else row.file
        rows[kind, field] = row
    looked, omitted = field_lines(Counter(rows), lambda file, field: rows[file, field])
    for form in stored.forms():
        place = f"forms/{form.name}/{form.part}"
        if form.part not in stored.roots:
            omitted.append(f"{place}: parts/{form.part} is not at hand: {SUMS} alone")
        elif form.options.get("classes"):
            omitted.append(f"{place}: boxes, masks and classes are those of a user's table")
    return looked, omitted


def stored_fields(root: Path, houses: Iterable[Path]) -> Counter[tuple[str, str]]:
    """(File, field) -> number of files of a root that have it; files without JSON are skipped."""
    counts: Counter[tuple[str, str]] = Counter()
    for name, file in _documents(root, houses):
        counts.update((name, path) for path in _fields_in(file))
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


def field_lines(
    fields: Counter[tuple[str, str]], owner: Callable[[str, str], FieldRow | None] = owner_of
) -> tuple[list[str], list[str]]:
    """Lines of the certificate: numbers of fields with a check, by file; fields without, by reason."""
    owned: dict[str, set[str]] = {}
    reasons: dict[tuple[str, str], set[str]] = {}
    for file, field in sorted(fields):
        row = owner(file, field)
        if row is not None and row.check:
            owned.setdefault(file, set()).add(row.field)
        else:
            why = UNOWNED if row is None else row.why
            reasons.setdefault((file, why), set()).add(field if row is None else row.field)
    looked = [f"{file}: {len(names)} kinds of fields" for file, names in owned.items()]
    # Unknown fields come first.
    order = sorted(reasons, key=lambda pair: (pair[1] != UNOWNED, pair))
    names = {pair: ", ".join(sorted(reasons[pair])) for pair in order}
    return looked, [f"{f'{file} {names[file, why]}'.rstrip()}: {why}" for file, why in order]
