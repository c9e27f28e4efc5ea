"""A training set by its stored files: the set's file, index, checksums, parts and forms. Effects: reads files.

    <set>.toml  README.md  index.csv  SHA256SUMS  done/  parts/<part>/  forms/<form>/<part>/[<split>/]

Uses no code of sets/ and export/.
"""

from __future__ import annotations

import csv
import hashlib
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from pbrs_farm.check.stored_files import BadFile, stored_bytes, stored_object
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput

SUMS = "SHA256SUMS"
CARD = "README.md"
INDEX = "index.csv"
SPLITS = ("train", "val", "test")
MODES = ("mlt_il_ol", "mlt_ol", "opengl_il", "opengl_dl")  # the first of a view is its picture
PACKED = ("shards", "parquet")  # forms whose files name the split, not their folders
_COLUMNS = {"part", "house", "view", "split", "left_out"}


class IndexRow(NamedTuple):
    """A row of index.csv."""

    part: str
    house: str
    view: str
    split: str
    left_out: str


@dataclass(frozen=True)
class StoredForm:
    """A part's views in a form."""

    name: str
    to: str
    part: str
    folder: Path
    options: Mapping[str, Any]

    @property
    def size(self) -> tuple[int, int] | None:
        """(height, width) of its pictures; None as rendered."""
        size = self.options.get("size")
        return None if size is None else tuple(int(n) for n in str(size).split("x"))[::-1]  # type: ignore[return-value]


@dataclass(frozen=True)
class StoredSet:
    """A set's folder."""

    folder: Path
    file: str
    tables: Mapping[str, Any]

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """Shares of train, val and test; () for a set without splits."""
        if "split" not in self.tables:
            return ()
        numbers = [float(text) for text in str(self.tables["split"]).split("/")]
        return tuple(number / sum(numbers) for number in numbers)

    def split_of(self, house: str) -> str:
        """The split of a house, by the SHA-256 of its home's name; "" for a set without splits."""
        if not self.shares:
            return ""
        place = int(hashlib.sha256(home_of(house).encode()).hexdigest()[:16], 16) / 2**64
        train, val, _test = self.shares
        return SPLITS[(place >= train) + (place >= train + val)]

    @cached_property
    def roots(self) -> dict[str, Path]:
        """Part -> its output root, of the parts at hand."""
        roots = {part: self.folder / "parts" / part for part in self.tables["part"]}
        return {part: root for part, root in roots.items() if root.is_dir()}

    @cached_property
    def sums(self) -> dict[str, str]:
        """File -> its sha256 in SHA256SUMS; {} without it."""
        try:
            lines = stored_bytes(self.folder / SUMS).decode("utf-8", "replace").splitlines()
        except BadFile:
            return {}
        pairs = (line.partition("  ") for line in lines)
        return {name: digest for digest, _space, name in pairs}

    @cached_property
    def index(self) -> list[IndexRow]:
        """The rows of index.csv; BadFile if it is missing or has other columns."""
        text = stored_bytes(self.folder / INDEX).decode("utf-8", "replace")
        rows = list(csv.DictReader(text.splitlines()))
        if any(set(row) != _COLUMNS or None in row.values() for row in rows):
            raise BadFile("is not an index of a set")
        return [IndexRow(**row) for row in rows]

    @property
    def views(self) -> list[IndexRow]:
        """The rows of index.csv; [] if it cannot be read."""
        try:
            return self.index
        except BadFile:
            return []

    def licences_of(self, row: IndexRow) -> tuple[str, ...]:
        """The licences in the view.json of a row; () if the part is not at hand."""
        root = self.roots.get(row.part, self.folder)
        files = root.glob(f"*/{row.house}/views/{row.view}/view.json")
        return tuple(name for file in files for name in stored_object(file).get("licences", ()))

    def kept(self, part: str) -> set[tuple[str, str]]:
        """(House, view) of a part's views that its forms have."""
        return {(r.house, r.view) for r in self.views if r.part == part and not r.left_out}

    def files(self) -> list[str]:
        """Every file that SHA256SUMS lists or should list: no markers, no files of a killed run."""
        paths = (p.relative_to(self.folder) for p in self.folder.rglob("*") if p.is_file())
        own = (p for p in paths if not {"done", ".incomplete"} & set(p.parts[:-1]))
        return sorted(p.as_posix() for p in own if p.as_posix() != SUMS)

    def forms(self) -> Iterator[StoredForm]:
        """Every form of a part; without its folder if no view of the part is kept."""
        for name, table in self.tables.get("form", {}).items():
            for part in table.get("parts") or self.tables["part"]:
                folder = self.folder / "forms" / name / part
                yield StoredForm(name, str(table.get("to") or name), part, folder, table)


def home_of(house: str) -> str:
    """The house's name without its digest and its dressing: `studio` of studio-1a2b3c4d-d3."""
    return re.sub(r"(?<=.)(-[0-9a-f]{8})?(-d\d+)?$", "", house, count=1)


def stored_set(folder: Path) -> StoredSet | None:
    """The set in a folder; None for a root, and for one without SHA256SUMS, parts and forms. BadInput for a damaged set's file."""
    is_root = any((folder / name).is_dir() for name in keys.FOLDERS)
    if is_root or not any((folder / name).exists() for name in (SUMS, "parts", "forms")):
        return None
    files = sorted(folder.glob("*.toml"))
    if len(files) != 1:
        text = "has no set's file (.toml)" if not files else "has several sets' files"
        raise BadInput(folder, "", text, hint="copy the file that it was made from into it")
    try:
        tables = tomllib.loads(stored_bytes(files[0]).decode("utf-8-sig"))
        if not tables["part"].keys() | tables.get("form", {}).keys():
            raise KeyError
    except (ValueError, KeyError, AttributeError, RecursionError):
        raise BadInput(files[0], "", "is not a set's file, or damaged") from None
    return StoredSet(folder, files[0].name, tables)
