"""Houses of an output root, with fingerprints of their content. Effects: reads the store.

In a folder, times of folders are fingerprints. Other stores are not listed, since a farm's root may
have twenty million objects and a listing costs money. The root's manifest has the houses of the last
merge, the farm's ledger those finished later, each with its own manifest. A root with neither, such
as that of a running job, is listed every ten minutes.
"""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Final

from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.core import keys
from pbrs_farm.core.errors import ObjectMissing, StoreFailed
from pbrs_farm.formats.manifest import sha256_by_key
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import check_key

_WATCHED: Final = ("done", "views", "house.json")  # parts of a house's folder that steps change
_LISTING_S: Final = 600.0  # between listings of a store without a manifest
_MAX_MANIFEST: Final = 16 * 2**30  # maximum size of a root's manifest, bytes
# Unique in canonical JSON, since quotes within texts are escaped.
_HOUSE_OF_ROW: Final = re.compile(rb'"key":"(?:houses|objects)/([^/"]+)/')

FinishedHouses = Callable[[], Collection[str]]


class StoredHouses:
    """The houses of a root. finished: finished houses of its farm, None without a farm."""

    def __init__(
        self,
        reader: RootReader,
        finished: FinishedHouses | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._reader, self._finished, self._clock = reader, finished, clock
        self._manifest_bytes = -1  # size of the root's manifest at the last read
        self._in_manifest: dict[str, str] = {}
        self._of_farm: dict[str, str] = {}
        self._listed: dict[str, str] = {}
        self._listed_at: float | None = None

    def fingerprints(self) -> dict[str, str]:
        """House id -> fingerprint of its content.

        In stores other than folders, an overwritten object may keep the fingerprint.
        """
        store = self._reader.store
        if isinstance(store, FolderStore):
            roots = (_folder_fingerprints(store.root / root) for root in keys.FOLDERS)
            return {house: text for houses in roots for house, text in houses}
        self._read_manifest()
        self._ask_farm()
        if self._in_manifest or self._finished is not None:
            return self._in_manifest | self._of_farm
        return self._list_seldom()

    def _read_manifest(self) -> None:
        """Read the root's manifest if its size changed."""
        try:
            n_bytes, pieces = self._reader.pieces(keys.MANIFEST, _MAX_MANIFEST)
        except ObjectMissing:
            return
        if n_bytes == self._manifest_bytes:
            return
        self._in_manifest = _manifest_fingerprints(_lines(pieces))
        self._manifest_bytes = n_bytes

    def _ask_farm(self) -> None:
        """Read the manifests of houses finished since the root's manifest."""
        for house in self._finished() if self._finished is not None else ():
            if house not in self._in_manifest and house not in self._of_farm:
                data = self._reader.get_or_none(keys.house_key(house, keys.MANIFEST))
                if data is not None:
                    self._of_farm[house] = keys.sha256(data)

    def _list_seldom(self) -> dict[str, str]:
        now = self._clock()
        if self._listed_at is None or now - self._listed_at >= _LISTING_S:
            listings = (self._reader.store.list(f"{root}/") for root in keys.FOLDERS)
            self._listed = {house: text for part in listings for house, text in _listed(part)}
            self._listed_at = now
        return self._listed


def view_keys(reader: RootReader, house: str) -> Iterable[str]:
    """Keys below the views of a house: from its manifest in a remote store, else from a listing."""
    prefix = keys.house_key(house, "views/")
    if not isinstance(reader.store, FolderStore):
        data = reader.get_or_none(keys.house_key(house, keys.MANIFEST))
        try:
            if data is not None:
                return [key for key in sha256_by_key(data) if key.startswith(prefix)]
        except (ValueError, KeyError, TypeError, AttributeError):
            pass  # damaged
    return reader.store.list(prefix)


def _folder_fingerprints(folder: Path) -> Iterator[tuple[str, str]]:
    try:
        names = sorted(path.name for path in folder.iterdir() if path.is_dir())
    except OSError:
        return
    for name in names:
        if _is_id(name):
            yield name, ":".join(_time(folder / name / part) for part in _WATCHED)


def _time(path: Path) -> str:
    try:
        return f"{path.stat().st_mtime_ns:x}"
    except OSError:
        return ""


def _lines(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Lines of bytes in pieces, with line ends."""
    rest = b""
    for piece in pieces:
        *whole, rest = (rest + piece).split(b"\n")
        yield from (line + b"\n" for line in whole)
    if rest:
        yield rest


def _manifest_fingerprints(lines: Iterable[bytes]) -> dict[str, str]:
    """House -> digest of its lines, which are its own manifest."""
    digests: dict[str, str] = {}
    for house, rows in groupby(lines, key=_house_of_row):
        digest = hashlib.sha256()
        for row in rows:
            digest.update(row)
        if _is_id(house):
            digests[house] = digest.hexdigest()
    return digests


def _house_of_row(line: bytes) -> str:
    match = _HOUSE_OF_ROW.search(line)
    return match[1].decode("ascii", "replace") if match else ""


def _listed(names: Iterator[str]) -> Iterator[tuple[str, str]]:
    parts = (key.split("/", 2) for key in names)
    in_houses = (p for p in parts if len(p) == 3)
    for house, group in groupby(sorted(in_houses), key=lambda p: p[1]):
        digest = hashlib.sha256("\n".join(p[2] for p in group).encode()).hexdigest()
        yield house, digest


def _is_id(name: str) -> bool:
    """True for names that can be part of a key."""
    try:
        check_key(name)
    except StoreFailed:
        return False
    return True
