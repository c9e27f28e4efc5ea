"""Debian packages as a source of data: downloaded once, through apt where it is, read without installing.

Effects: runs `apt-get download` (no root; apt's signed index vouches for the file), or downloads the
pinned file where apt is missing or has no package lists (its sha256 vouches for it), and keeps packages
in a cache folder. Nothing of a package is committed or shipped.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import io
import lzma
import os
import re
import shutil
import subprocess
import tarfile
import tempfile
import time
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from pbrs_farm.assets.pinned_packages import PINS, download_pinned
from pbrs_farm.core.errors import MachineFailed

APT_TIMEOUT_S: Final = 600  # of one download
_LOOK_EVERY: Final = 32  # new files of a folder
_DAY_S: Final = 86_400
_SCRATCH: Final = ""  # ending of a file that write_whole has not renamed yet
_SHORT_LIVED: Final = (_SCRATCH, ".index")  # endings of files that go after a day without use
_NOTE: Final = ".sha256"  # ending of the file beside a package that holds its hash


def cache_folder() -> Path:
    """Folder for downloads and data derived from them: $PBRS_CACHE, else ~/.cache/pbrs_farm."""
    chosen = os.environ.get("PBRS_CACHE", "")
    return Path(chosen) if chosen else Path.home() / ".cache" / "pbrs_farm"


@dataclass(frozen=True, slots=True)
class Deb:
    """A downloaded package."""

    name: str
    version: str
    path: Path  # of the .deb
    sha256: str  # of the .deb
    note: str = ""  # irregularities of the package

    def members(self, wanted: Callable[[str], bool]) -> dict[str, bytes]:
        """Path in the package -> bytes of every wanted file; MachineFailed for a damaged package.

        wanted: called with each path, without a leading "./". Files are held in memory: request only the
        necessary ones. The package is never installed and no script of it runs.
        """
        try:
            for name, content in _ar_members(self.path.read_bytes()):
                if name.startswith("data.tar"):
                    return _extract_files(_plain_tar(name, content, self.path), wanted)
        except (tarfile.TarError, lzma.LZMAError, EOFError, OSError, ValueError) as error:
            raise self.damaged(str(error)) from None
        raise self.damaged("has no files")

    def damaged(self, why: str) -> MachineFailed:
        """The error for a package with missing or invalid contents."""
        return MachineFailed(f"{self.path}: {why}", hint="delete the file and fetch it again")


@dataclass(frozen=True, slots=True)
class DebFiles:
    """Files of a package. The cache keeps them unpacked, and of the package its version and hash."""

    package: str
    tested_version: str
    endings: Mapping[str, str]  # path in the package -> end of its name in the cache

    def cached(self, folder: Path | None = None) -> Deb | None:
        """The cached package, unpacked, the tested version if there is a choice; None if `fetch` has to be run."""
        debs = self._debs(folder or cache_folder())
        return self._unpacked(debs[-1]) if debs else None

    def fetch(self, folder: Path | None = None) -> Deb:
        """The package from the cache, else downloaded, unpacked; MachineFailed as of `fetched_deb`."""
        deb = self.cached(folder)
        return deb or self._unpacked(fetched_deb(self.package, self.tested_version, folder))

    def places(self, deb: Deb) -> dict[str, Path]:
        """Path in the package -> file in the cache, under the hash: another version never reads an older one's."""
        start = deb.path.parent / f"{self.package}-{deb.sha256[:16]}"
        return {path: Path(f"{start}{ending}") for path, ending in self.endings.items()}

    def cached_files(self) -> list[Path]:
        """Files of the cached package, the one that shows that it is whole last; none if it is not cached."""
        debs = self._debs(cache_folder())
        if not debs or debs[-1].path.exists():
            return [deb.path for deb in debs[-1:]]
        return [*self.places(debs[-1]).values(), _note_of(debs[-1].path)]

    def has_file(self, name: str) -> bool:
        """True if a path below a cache may be one of `cached_files`."""
        endings = "|".join(map(re.escape, self.endings.values()))
        unpacked = rf"-[0-9a-f]{{16}}({endings})"
        own = re.escape(self.package)
        return re.fullmatch(rf"{own}(_[^/]+\.deb(\.sha256)?|{unpacked})", name) is not None

    def _debs(self, folder: Path) -> list[Deb]:
        paths = {
            path.with_name(path.name.removesuffix(_NOTE))
            for path in folder.glob(f"{self.package}_*.deb*")
        }
        # The tested version goes last, where it is taken.
        ordered = sorted(paths, key=lambda p: (version_of(p) == self.tested_version, p))
        debs = [_deb(self.package, self.tested_version, path) for path in ordered]
        return [deb for deb in debs if deb.path.exists() or self._is_unpacked(deb)]

    def _is_unpacked(self, deb: Deb) -> bool:
        return bool(deb.sha256) and all(path.exists() for path in self.places(deb).values())

    def _unpacked(self, deb: Deb) -> Deb:
        if self._is_unpacked(deb):
            return deb
        try:
            files = deb.members(self.endings.__contains__)
        except MachineFailed:
            if self._is_unpacked(deb):  # by another process
                return deb
            raise
        missing = self.endings.keys() - files
        if missing:
            raise deb.damaged(f"has no {', '.join(sorted(missing))}")
        for path, place in self.places(deb).items():
            place.parent.mkdir(exist_ok=True)
            write_whole(place, files[path])
        if _note_of(deb.path).exists():
            deb.path.unlink(missing_ok=True)
        return deb


def fetched_deb(package: str, tested_version: str, folder: Path | None = None) -> Deb:
    """The package from the cache, else downloaded: through apt, else as the pinned file.

    Raises MachineFailed, with what to do, where neither can give it.
    """
    folder = folder or cache_folder()
    try:
        debs = sorted(folder.glob(f"{package}_*.deb"))
        debs.sort(key=lambda p: version_of(p) == tested_version)
        if debs:
            return _deb(package, tested_version, debs[-1])
        return _download_into(package, tested_version, folder)
    except OSError as error:
        hint = "set PBRS_CACHE to a writable folder"
        raise MachineFailed(f"{folder}: {error.strerror or error}", hint=hint) from None


def _download_into(package: str, tested_version: str, folder: Path) -> Deb:
    folder.mkdir(parents=True, exist_ok=True)
    # Download beside the cache, then move: a package is there whole or not at all.
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        fetch_deb(package, tested_version, Path(scratch))
        debs = sorted(Path(scratch).glob(f"{package}_*.deb"))
        if not debs:
            raise MachineFailed(f"apt-get downloaded no {package}", hint=_HINT)
        target = folder / debs[0].name
        debs[0].replace(target)
    return _deb(package, tested_version, target)


def fetch_deb(package: str, tested_version: str, scratch: Path) -> None:
    """Through apt; where apt is missing, or refuses as it does without its lists, the pinned file."""
    has_apt = shutil.which("apt-get") is not None
    if not has_apt and package not in PINS:
        hint = f"put Debian's {package}_{tested_version}_all.deb into the cache folder"
        raise MachineFailed(f"no apt-get here to fetch {package}", hint=hint)
    if not has_apt:
        download_pinned(PINS[package], scratch)
        return
    try:
        _download(package, scratch)
    except MachineFailed as refused:
        if package not in PINS:
            raise
        try:
            download_pinned(PINS[package], scratch)
        except MachineFailed as failed:
            raise MachineFailed(f"{refused}; {failed.message}", hint=failed.hint) from None


def _deb(package: str, tested_version: str, path: Path) -> Deb:
    version, note = version_of(path), ""
    if version != tested_version:
        note = f"{package} {version} is not the tested version {tested_version}"
    if not path.exists():  # unpacked
        return Deb(package, version, path, "".join(_noted(path)[:1]), note)
    # Hash a file once a process: a job of many homes asks for its package with each.
    status = path.stat()
    return Deb(
        package, version, path, cached_sha256(path, status.st_size, status.st_mtime_ns), note
    )


def _note_of(path: Path) -> Path:
    return path.with_name(f"{path.name}{_NOTE}")


def _noted(path: Path) -> list[str]:
    """Hash, size and date of a package from the note beside it; [] without a note."""
    try:
        words = _note_of(path).read_text("ascii", "replace").split()
    except OSError:
        return []
    return words if len(words) == 3 else []


@lru_cache(maxsize=16)
def cached_sha256(path: Path, size: int, mtime_ns: int) -> str:
    # Keep the hash beside the file, under its size and date: a hundred megabytes take a while.
    noted = _noted(path)
    if noted[1:] == [str(size), str(mtime_ns)]:
        return noted[0]
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    with contextlib.suppress(OSError):  # works without a writable cache
        write_whole(_note_of(path), f"{sha256} {size} {mtime_ns}\n".encode())
    return sha256


_HINT: Final = "run `sudo apt-get update`, then try again"


def _download(package: str, scratch: Path) -> None:
    try:
        done = subprocess.run(
            ["apt-get", "download", package],
            cwd=scratch,
            capture_output=True,
            text=True,
            timeout=APT_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MachineFailed(f"apt-get download {package}: {error}", hint=_HINT) from None
    if done.returncode != 0:
        # apt says what went wrong in lines that begin with E:.
        lines = [x for x in (done.stderr + done.stdout).splitlines() if x.startswith("E:")]
        reason = lines[0] if lines else f"exit status {done.returncode}"
        raise MachineFailed(f"apt-get download {package}: {reason}", hint=_HINT)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file of the cache atomically, by renaming it into place."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as scratch:
        scratch.write(data)
    Path(scratch.name).replace(path)


def read_used(path: Path) -> bytes:
    """The bytes of a file of the cache, which drop_oldest then takes for a new one."""
    data = path.read_bytes()
    with contextlib.suppress(OSError):  # works without a writable cache
        os.utime(path)
    return data


def drop_oldest(written: Path, most_bytes: int, *, every: int = _LOOK_EVERY) -> None:
    """Remove the folder's oldest files until at most most_bytes remain.

    A file is as old as its writing or its last read_used. Indexes and scratch files of killed processes
    have a day. Looks once per `every` new files, chosen by their names.
    """
    if zlib.crc32(written.name.encode()) % every:
        return
    files = []
    yesterday = time.time() - _DAY_S
    for path in filter(Path.is_file, written.parent.iterdir()):
        with contextlib.suppress(FileNotFoundError):  # another process took it out
            status = path.stat()
            if path.suffix in _SHORT_LIVED and status.st_mtime < yesterday:
                path.unlink()
            elif path.suffix != _SCRATCH:
                files.append((status.st_mtime, status.st_size, path))
    spare = sum(n_bytes for _modified, n_bytes, _path in files) - most_bytes
    for _modified, n_bytes, path in sorted(files):
        if spare <= 0:
            return
        path.unlink(missing_ok=True)
        spare -= n_bytes


def version_of(deb: Path) -> str:
    """The version in a .deb's file name; "" without one."""
    return deb.name.split("_")[1].replace("%3a", ":") if deb.name.count("_") >= 2 else ""


def _extract_files(tar: bytes, wanted: Callable[[str], bool]) -> dict[str, bytes]:
    files = {}
    with tarfile.open(fileobj=io.BytesIO(tar)) as archive:
        # Read the wanted files alone; links and folders are passed over.
        for member in archive:
            name = member.name.removeprefix("./")
            stream = archive.extractfile(member) if member.isfile() and wanted(name) else None
            if stream is not None:
                files[name] = stream.read()
    return files


def _ar_members(data: bytes) -> list[tuple[str, bytes]]:
    if not data.startswith(b"!<arch>\n"):
        raise ValueError("not a Debian package")
    members, offset = [], 8
    while offset + 60 <= len(data):
        # A member's header has 60 bytes: name in 16, size at 48; contents begin at even places.
        name = data[offset : offset + 16].decode("ascii", "replace").strip().rstrip("/")
        size = int(data[offset + 48 : offset + 58])
        members.append((name, data[offset + 60 : offset + 60 + size]))
        offset += 60 + size + size % 2
    return members


def _plain_tar(name: str, content: bytes, deb: Path) -> bytes:
    if name.endswith(".xz"):
        return lzma.decompress(content)
    if name.endswith((".tar", ".gz")):
        return gzip.decompress(content) if name.endswith(".gz") else content
    # Leave zstd to Debian's own tool.
    if shutil.which("dpkg-deb") is None:
        raise ValueError(f"{name}: dpkg-deb is needed to unpack it")
    done = subprocess.run(
        ["dpkg-deb", "--fsys-tarfile", str(deb)], capture_output=True, check=True, timeout=300
    )
    return done.stdout
