"""Keeps an index up to date with its output root, in a thread of its own. Effects: reads the store."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass
from typing import Final

from pbrs_farm.board.index.house_rows import HouseRow, read_house, selection_fingerprint, verdicts
from pbrs_farm.board.index.stored_houses import FinishedHouses, StoredHouses
from pbrs_farm.board.index.view_index import ViewIndex
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.store.folder import FolderStore

_LOG: Final = logging.getLogger(__name__)
_CHUNK_VIEWS: Final = 500  # entered in one transaction
_FOLDER_S: Final = 5.0  # between two looks at a folder
_STORE_S: Final = 60.0  # between two looks at a store, which cost
_SHARE: Final = 0.1  # of the time that looking may take at most


@dataclass(frozen=True, slots=True)
class Progress:
    """How far the index is."""

    n_houses: int = 0  # that are to be read, 0 when all are
    n_read: int = 0
    is_listing: bool = False  # before the first look has found which homes there are
    fault: str = ""  # why the store cannot be read, or ""

    @property
    def text(self) -> str:
        """What is being read, for people; "" when all is read, or nothing can be."""
        if self.n_houses:
            return f"Reading homes: {self.n_read:,} of {self.n_houses:,}. What is read already is shown."
        return (
            "Looking for homes in the root. A large one takes a while." if self.is_listing else ""
        )


class Refresher:
    """Looks at the root again and again; `progress` says how far it is."""

    def __init__(
        self, reader: RootReader, index: ViewIndex, finished: FinishedHouses | None = None
    ) -> None:
        self._reader, self._index = reader, index
        self._houses = StoredHouses(reader, finished)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="board-index", daemon=True)
        self.progress = Progress(is_listing=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def end(self) -> None:
        """Stop, and wait until it has."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(timeout=10.0)

    def _run(self) -> None:
        pause_s = _FOLDER_S if isinstance(self._reader.store, FolderStore) else _STORE_S
        while not self._ended.is_set():
            started = time.monotonic()
            try:
                self.refresh()
            except (PbrsError, OSError) as error:
                _LOG.warning("index: %s", error)
                self.progress = Progress(fault=str(error))
            took_s = time.monotonic() - started
            self._ended.wait(max(pause_s, took_s * (1 / _SHARE - 1)))

    def refresh(self) -> None:
        """Enter what is new or changed, forget what is gone.

        Runs in the refresher's thread; tests call it directly. A house is read again when its
        fingerprint differs, so a root of many homes that did not change costs a listing.
        """
        known = self._index.fingerprints()
        now = self._houses.fingerprints()
        changed = [house for house, print_ in now.items() if known.get(house) != print_]
        gone = known.keys() - now.keys()
        if gone:
            self._index.remove(sorted(gone))
        self._read(changed, now)
        # The verdicts of the last selection stand apart.
        selection = selection_fingerprint(self._reader)
        if selection != self._index.fact("selection") or (changed and selection):
            self._index.set_verdicts(verdicts(self._reader), selection)

    def _read(self, changed: list[str], now: dict[str, str]) -> None:
        chunk: list[tuple[HouseRow, str]] = []
        n_views = 0
        for k, house in enumerate(changed):
            if self._ended.is_set():
                return
            self.progress = Progress(len(changed), k)
            row = read_house(self._reader, house)
            chunk.append((row, now[house]))
            n_views += max(1, len(row.views))
            if n_views >= _CHUNK_VIEWS:
                self._index.enter(chunk)
                chunk, n_views = [], 0
        if chunk:
            self._index.enter(chunk)
        self.progress = Progress()
