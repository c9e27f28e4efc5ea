"""Files below one folder or in an archive, and nothing outside it; digests of companions. Effect: reads them.

Nothing is trusted: names with `..`, absolute names and entries of absurd size are rejected, and a
compressed entry is never unpacked further than it may be.
"""

from __future__ import annotations

import hashlib
import io
import posixpath
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.mesh.mtl import ObjMaterial, parse_mtl
from pbrs_farm.regular_files import digest_of_regular, fault_of, read_regular, real_path

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


class RootFolder:
    """The files of a source below root; records all reads for a digest.

    Names are relative, with "/" between folders. A name or a symlink that leads out of root is
    rejected with BadHouse, as is a file larger than its limit.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._real = real_path(root)
        self._read: dict[str, str] = {}  # name -> sha256

    def name_from(self, folder: str, reference: str) -> str:
        """The name below root of a reference ("/" or backslashes) in a folder; BadHouse if it leads out."""
        joined = posixpath.normpath(posixpath.join(folder, reference.replace("\\", "/")))
        if joined.startswith(("/", "../")) or joined == ".." or "\0" in joined:
            raise BadHouse(self.root, folder, f"{reference[:80]!r} leads out of the folder")
        return joined

    def path(self, name: str) -> Path | None:
        """The regular file of that name, or None if it does not exist; BadHouse if it is outside.

        name: relative, from an untrusted file. Links are resolved first, so that none leads out. The path
        is the resolved one: do not derive names from it.
        """
        path = self.root / self.name_from("", name)
        try:
            if not path.is_file():
                return None
            real = real_path(path)
        except OSError:
            return None
        # Resolve links first: the real location decides.
        if not real.is_relative_to(self._real):
            raise BadHouse(self.root, name, "is a link that leads out of the folder")
        return real

    def has_folder(self, name: str) -> bool:
        """Whether a folder of that name exists below root."""
        return (self.root / self.name_from("", name)).is_dir()

    def names(self, folder: str, suffixes: tuple[str, ...]) -> list[str]:
        """Names (with the folder, as `read` takes them) of a folder's files with these suffixes; or []."""
        below = self.root / self.name_from("", folder)
        if not below.is_dir():
            return []
        return [f"{folder}/{p.name}" for p in below.iterdir() if p.suffix in suffixes]

    def read(self, name: str, *, max_bytes: int, limit: str = "") -> bytes | None:
        """The bytes of a file below the folder, or None if it does not exist; records its digest.

        max_bytes: limit. limit: the recipe field that sets max_bytes, for the message. Raises BadHouse for
        a larger file, and for a name or a link that leads out of the folder.
        """
        path = self.path(name)
        if path is None:
            return None
        try:
            size = path.stat().st_size
            if size > max_bytes:
                text = f"is {size / 1e6:.0f} MB; at most {max_bytes / 1e6:.0f} MB are read"
                raise BadHouse(self.root, name, text, hint=limit and f"limit: {limit}")
            data = read_regular(path, max_bytes)
        except OSError as error:
            raise BadHouse(self.root, name, fault_of(error)) from None
        self._read[name] = hashlib.sha256(data).hexdigest()
        return data

    @property
    def names_read(self) -> tuple[str, ...]:
        """Names of the files read so far."""
        return tuple(self._read)

    @property
    def sha256(self) -> str:
        """Hex digest over the names and bytes of all files read so far, in whatever order."""
        lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(self._read.items()))
        return hashlib.sha256(lines.encode()).hexdigest()


_MAX_MTL_BYTES = 4_000_000


class Layered:
    """Contents looked up in several places, the first that has them."""

    def __init__(self, *layers: Resources | None) -> None:
        self._layers = tuple(layer for layer in layers if layer is not None)

    def read(self, name: str) -> bytes | None:
        """The content's bytes from the first layer that has it, or None."""
        for layer in self._layers:
            data = layer.read(name)
            if data is not None:
                return data
        return None


def read_mtl(folder: RootFolder, name: str) -> tuple[ObjMaterial, ...] | None:
    """The library's materials, pictures as names below the root, or None; BadHouse for a picture outside."""
    data = folder.read(name, max_bytes=_MAX_MTL_BYTES)
    if data is None:
        return None
    parent = posixpath.dirname(name)

    def below_root(name: str) -> str:
        return folder.name_from(parent, name) if name else ""

    return tuple(
        replace(m, map_kd=below_root(m.map_kd), map_d=below_root(m.map_d)) for m in parse_mtl(data)
    )


class SourceFiles:
    """Files inspected while sources are identified, each read once; damaged ones count as absent."""

    def __init__(self) -> None:
        self._digests: dict[tuple[Path, str], str] = {}  # (root, name) -> sha256, "" = no file
        self._pictures: dict[tuple[Path, str], tuple[str, ...]] = {}  # of material libraries

    def file_digest(self, path: Path) -> str:
        """SHA-256 of a file, taken once, however many houses read it; OSError if unreadable."""
        key = (path, "")
        if key not in self._digests:
            self._digests[key] = digest_of_regular(path)
        return self._digests[key]

    def digest(self, folder: RootFolder, names: Iterable[str]) -> str:
        """Digest over names and bytes of the existing ones of these files below a folder; "" for none."""
        digests = {name: self._digest(folder, name) for name in names}
        lines = [f"{digest}  {name}\n" for name, digest in sorted(digests.items()) if digest]
        return hashlib.sha256("".join(lines).encode()).hexdigest() if lines else ""

    def pictures(self, folder: RootFolder, mtl: str) -> tuple[str, ...]:
        """Names below the root of the pictures in a material library, cached; () if it is damaged."""
        key = (folder.root, mtl)
        if key not in self._pictures:
            try:
                materials = read_mtl(folder, mtl) or ()
                self._pictures[key] = tuple(
                    {name for m in materials for name in (m.map_kd, m.map_d) if name}
                )
            except BadHouse:
                self._pictures[key] = ()
        return self._pictures[key]

    def _digest(self, folder: RootFolder, name: str) -> str:
        key = (folder.root, name)
        if key not in self._digests:
            try:
                path = folder.path(name)
                self._digests[key] = "" if path is None else self.file_digest(path)
            except (BadHouse, OSError):
                self._digests[key] = ""
        return self._digests[key]
