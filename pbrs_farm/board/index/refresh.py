"""Thread that keeps an index up to date. Effects: reads the store, writes the index."""

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
_CHUNK_VIEWS: Final = 500  # views per transaction
_FOLDER_S: Final = 5.0  # between reads of a folder
_STORE_S: Final = 60.0  # between reads of another store
_SHARE: Final = 0.1  # maximum share of the time for reading


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of the index."""

    n_houses: int = 0  # to be read, 0 at the end
    n_read: int = 0
    is_listing: bool = False  # before the first list of homes
    fault: str = ""  # of the store, or ""

    @property
    def text(self) -> str:
        """Progress as text; "" at the end and for a fault."""
        if self.n_houses:
            return (
                f"Reading homes: {self.n_read:,} of {self.n_houses:,}. Homes read so far are shown."
            )
        return (
            "Looking for homes in the root. This can take a while for a large root."
            if self.is_listing
            else ""
        )


class Refresher:
    """Reads the root periodically; `progress` is the state of the first read."""

    def __init__(
        self, reader: RootReader, index: ViewIndex, finished: FinishedHouses | None = None
    ) -> None:
        self._reader, self._index = reader, index
        self._houses = StoredHouses(reader, finished)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="board-index", daemon=True)
        self.progress = Progress(is_listing=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def end(self) -> None:
        """Stop the thread and wait for its end."""
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
        """Read houses with a new fingerprint, and remove deleted ones."""
        indexed = self._index.fingerprints()
        now = self._houses.fingerprints()
        changed = [house for house, print_ in now.items() if indexed.get(house) != print_]
        removed = indexed.keys() - now.keys()
        if removed:
            self._index.remove(sorted(removed))
        self._read(changed, now)
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
