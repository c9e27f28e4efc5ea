"""Named contents beside a house's plan: models, textures. Effect: reads the archive, where it is a file.

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
from pbrs_farm.read.mesh.obj import ObjMaterial, parse_mtl
from pbrs_farm.regular_files import digest_of_regular, fault_of, read_regular, real_path

MAX_ENTRY_BYTES = 256 * 2**20  # unpacked
MAX_TOTAL_BYTES = 2 * 2**30  # unpacked, of a whole archive
MAX_ENTRIES = 50_000


class Resources(Protocol):
    """Contents by name with "/" between folders."""

    def read(self, name: str) -> bytes | None:
        """The content's bytes, or None if there is none of that name."""
        ...


class ZipResources:
    """The entries of a zip archive in memory or on disk; every read is bounded.

    Raises BadHouse for what is no zip, a damaged one, a name that leaves the archive's root, too
    many entries, or one that is or claims to be larger than MAX_ENTRY_BYTES.
    """

    def __init__(self, data: bytes | Path, file: str) -> None:
        """data: the archive's bytes, or where it lies: what is not read is never loaded."""
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
        self._entries = {e.filename: e for e in entries if not e.is_dir()}

    def _check(self, entry: zipfile.ZipInfo) -> None:
        name = entry.filename
        place = f"entry {name[:80]!r}"
        if name.startswith("/") or ".." in name.replace("\\", "/").split("/"):
            raise BadHouse(self._file, place, "its name leaves the archive")
        if entry.file_size > MAX_ENTRY_BYTES:
            text = f"unpacks to {entry.file_size} bytes, at most {MAX_ENTRY_BYTES}"
            raise BadHouse(self._file, place, text)

    def read(self, name: str) -> bytes | None:
        """The entry's bytes, or None if there is none; BadHouse if it is damaged."""
        entry = self._entries.get(name)
        if entry is None:
            return None
        place = f"entry {name[:80]!r}"
        try:
            with self._zip.open(entry) as stream:
                # Read one byte more than announced: a bomb is longer than it says.
                data = stream.read(entry.file_size + 1)
        except (
            zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError,
            NotImplementedError, RuntimeError,
        ):  # fmt: skip
            text = "cannot be unpacked: damaged, encrypted, or packed by an unknown method"
            raise BadHouse(self._file, place, text) from None
        if len(data) > entry.file_size:
            raise BadHouse(self._file, place, "unpacks to more than its directory says")
        return data

    def names(self) -> tuple[str, ...]:
        """Every entry's name, in the archive's order."""
        return tuple(self._entries)


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


# Reads files below one folder and nothing outside it. Effect: reads files.


class RootFolder:
    """The files of a source below root; remembers what was read, so that a digest covers it all.

    Names are relative, with "/" between folders. A name or a symlink that leads out of root is
    rejected with BadHouse, as is a file larger than its limit.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._real = real_path(root)
        self._read: dict[str, str] = {}  # name -> sha256

    def name_from(self, folder: str, reference: str) -> str:
        """The name below root that a reference inside folder means; BadHouse if it leads out."""
        joined = posixpath.normpath(posixpath.join(folder, reference.replace("\\", "/")))
        if joined.startswith(("/", "../")) or joined == ".." or "\0" in joined:
            raise BadHouse(self.root, folder, f"{reference[:80]!r} leads out of the folder")
        return joined

    def path(self, name: str) -> Path | None:
        """The regular file of that name, or None if there is none; BadHouse if it lies outside."""
        path = self.root / self.name_from("", name)
        try:
            if not path.is_file():
                return None
            real = real_path(path)
        except OSError:
            return None
        # Follow links first: where the file really lies decides.
        if not real.is_relative_to(self._real):
            raise BadHouse(self.root, name, "is a link that leads out of the folder")
        return real

    def has_folder(self, name: str) -> bool:
        """Whether a folder of that name exists below root."""
        return (self.root / self.name_from("", name)).is_dir()

    def names(self, folder: str, suffixes: tuple[str, ...]) -> list[str]:
        """Names of the files directly in a folder below root, by suffix; [] without the folder."""
        below = self.root / self.name_from("", folder)
        if not below.is_dir():
            return []
        return [f"{folder}/{p.name}" for p in below.iterdir() if p.suffix in suffixes]

    def read(self, name: str, *, max_bytes: int, limit: str = "") -> bytes | None:
        """The file's bytes, or None if there is none. limit: the field that sets max_bytes."""
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
    def n_read(self) -> int:
        """Files read so far."""
        return len(self._read)

    @property
    def sha256(self) -> str:
        """Hex digest over the names and the bytes of every file read so far."""
        lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(self._read.items()))
        return hashlib.sha256(lines.encode()).hexdigest()


# Material libraries (MTL) below a root folder. Effect: reads them.


_MAX_MTL_BYTES = 4_000_000


def read_mtl(folder: RootFolder, name: str) -> tuple[ObjMaterial, ...] | None:
    """The library's materials, map_kd as a name below the root; None if there is no such file.

    Raises BadHouse for a picture that lies outside the folder.
    """
    data = folder.read(name, max_bytes=_MAX_MTL_BYTES)
    if data is None:
        return None
    at = posixpath.dirname(name)
    return tuple(
        replace(m, map_kd=folder.name_from(at, m.map_kd)) if m.map_kd else m
        for m in parse_mtl(data)
    )


# Digests of the files that a source reads beside its own. Effect: reads files.


class SourceFiles:
    """Files looked at while sources are named, each read once; state: what was found so far.

    Listing never fails: a file that is damaged or lies outside its folder counts as absent here,
    and the reader says what is wrong with it.
    """

    def __init__(self) -> None:
        self._digests: dict[tuple[Path, str], str] = {}  # (root, name) -> sha256, "" = no file
        self._pictures: dict[tuple[Path, str], tuple[str, ...]] = {}  # of material libraries

    def file_digest(self, path: Path) -> str:
        """SHA-256 of a file; raises OSError where it cannot be read."""
        key = (path, "")
        if key not in self._digests:
            self._digests[key] = digest_of_regular(path)
        return self._digests[key]

    def digest(self, folder: RootFolder, names: Iterable[str]) -> str:
        """Digest over the names and bytes of those files that exist; "" where none does."""
        found = {name: self._digest(folder, name) for name in names}
        lines = [f"{digest}  {name}\n" for name, digest in sorted(found.items()) if digest]
        return hashlib.sha256("".join(lines).encode()).hexdigest() if lines else ""

    def pictures(self, folder: RootFolder, mtl: str) -> tuple[str, ...]:
        """Names below the root of the pictures that a material library names."""
        key = (folder.root, mtl)
        if key not in self._pictures:
            try:
                materials = read_mtl(folder, mtl) or ()
                self._pictures[key] = tuple({m.map_kd for m in materials if m.map_kd})
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
