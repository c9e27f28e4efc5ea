"""Cache of pictures in a folder. Effects: writes and removes files there."""

from __future__ import annotations

import logging
import os
import secrets
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from pbrs_farm.core import keys

_LOG: Final = logging.getLogger(__name__)
MAX_BYTES: Final = 4 * 10**9  # of the folder; the oldest files are removed first
_AT_ONCE: Final = 2  # number of pictures made in parallel
_SWEEP_EVERY: Final = 2000  # number of new pictures between two checks of the folder's size


class PictureCache:
    """Pictures by their words."""

    def __init__(self, folder: Path, *, max_bytes: int = MAX_BYTES) -> None:
        self.folder = folder
        self._max_bytes = max_bytes
        self._making = threading.Semaphore(_AT_ONCE)
        self._n_made = 0
        self.folder.mkdir(parents=True, exist_ok=True)

    def file(self, words: tuple[str, ...], ending: str) -> Path:
        """File of a picture; its name is a digest of the words."""
        digest = keys.digest(list(words))
        return self.folder / digest[:2] / f"{digest}.{ending}"

    def get(self, words: tuple[str, ...], ending: str, make: Callable[[], bytes]) -> bytes:
        """The cached picture of these words, made by the first call. Raises errors of make.

        The words must determine the picture, so they include the version of its files.
        """
        path = self.file(words, ending)
        try:
            return path.read_bytes()
        except OSError:
            pass
        with self._making:
            # Another request may have made it while this one waited.
            try:
                return path.read_bytes()
            except OSError:
                data = make()
        self._keep(path, data)
        return data

    def _keep(self, path: Path, data: bytes) -> None:
        part = path.with_name(f"{secrets.token_hex(8)}.part")
        try:
            path.parent.mkdir(exist_ok=True)
            part.write_bytes(data)
            part.replace(path)
        except OSError as error:
            _LOG.warning("cannot cache %s: %s", path, error)
            part.unlink(missing_ok=True)
        self._n_made += 1
        if self._n_made % _SWEEP_EVERY == 0:
            self.sweep()

    def sweep(self) -> None:
        """Remove the oldest files until the folder is within its size."""
        files = sorted(
            (e.stat().st_mtime, e.stat().st_size, e.path) for e in _cached_files(self.folder)
        )
        excess = sum(size for _time, size, _path in files) - self._max_bytes
        for _time, size, path in files:
            if excess <= 0:
                return
            Path(path).unlink(missing_ok=True)
            excess -= size


def _cached_files(folder: Path) -> list[os.DirEntry[str]]:
    with os.scandir(folder) as parts:
        folders = [entry.path for entry in parts if entry.is_dir()]
    files: list[os.DirEntry[str]] = []
    for path in folders:
        with os.scandir(path) as entries:
            files += [entry for entry in entries if entry.is_file()]
    return files
