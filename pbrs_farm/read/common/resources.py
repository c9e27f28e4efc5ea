"""Named contents beside a home's plan: models, textures. Effect: reads the archive, where it is a file.

Nothing is trusted: names with `..`, absolute names and entries of absurd size are rejected, and a
compressed entry is never unpacked further than it may be.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path
from typing import Protocol

from pbrs_farm.core.errors import BadHouse

MAX_ENTRY_BYTES = 256 * 2**20  # unpacked
MAX_TOTAL_BYTES = 2 * 2**30  # unpacked, of a whole archive
MAX_ENTRIES = 50_000


class Resources(Protocol):
    """Contents by name with "/" between folders."""

    def read(self, name: str) -> bytes | None:
        """The content's bytes, or None for an unknown name."""
        ...


class ZipResources:
    """The entries of a zip archive in memory or on disk; every read is bounded.

    Raises BadHouse for data that is not a zip, a damaged archive, a name that leaves the archive's
    root, too many entries, or an entry whose actual or declared size exceeds MAX_ENTRY_BYTES.
    """

    def __init__(self, data: bytes | Path, file: str) -> None:
        """data: the archive's bytes, or its path: entries are loaded on demand."""
        self._file = file
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(data) if isinstance(data, bytes) else data)
            entries = self._zip.infolist()
        except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError, EOFError):
            hint = "copy or save the file again"
            raise BadHouse(file, "", "damaged zip archive", hint=hint) from None
        if len(entries) > MAX_ENTRIES:
            raise BadHouse(file, "", f"{len(entries)} zip entries, at most {MAX_ENTRIES} are read")
        for entry in entries:
            self._check(entry)
        # Bound what the archive as a whole unpacks to.
        total = sum(e.file_size for e in entries)
        if total > MAX_TOTAL_BYTES:
            raise BadHouse(file, "", f"unpacks to {total} bytes, at most {MAX_TOTAL_BYTES}")
        self._entries = {e.filename: e for e in entries if not e.filename.endswith("/")}

    def _check(self, entry: zipfile.ZipInfo) -> None:
        name = entry.filename
        place = f"entry {name[:80]!r}"
        if name.startswith("/") or ".." in name.replace("\\", "/").split("/"):
            raise BadHouse(self._file, place, "its name leaves the archive")
        if entry.file_size > MAX_ENTRY_BYTES:
            text = f"unpacks to {entry.file_size} bytes, at most {MAX_ENTRY_BYTES}"
            raise BadHouse(self._file, place, text)

    def read(self, name: str) -> bytes | None:
        """The entry's bytes, or None for an unknown name; BadHouse for damage or more than the declared size."""
        entry = self._entries.get(name)
        if entry is None:
            return None
        place = f"entry {name[:80]!r}"
        try:
            with self._zip.open(entry) as stream:
                # Read one byte more than announced: a bomb is longer than it says.
                data = stream.read(entry.file_size + 1)
        except (
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            OSError,
            ValueError,
            NotImplementedError,
            RuntimeError,
        ):
            text = "cannot be unpacked: damaged, encrypted, or packed by an unknown method"
            raise BadHouse(self._file, place, text) from None
        if len(data) > entry.file_size:
            raise BadHouse(self._file, place, "unpacks to more than its directory says")
        return data

    def names(self) -> tuple[str, ...]:
        """Every entry's name, in the archive's order."""
        return tuple(self._entries)
