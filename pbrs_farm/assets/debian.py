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
import shutil
import subprocess
import tarfile
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from pbrs_farm.assets.pinned_packages import PINS, download_pinned
from pbrs_farm.core.errors import MachineFailed

APT_TIMEOUT_S: Final = 600  # of one download


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


def cached_deb(package: str, tested_version: str, folder: Path | None = None) -> Deb | None:
    """The cached package, the tested version if there is a choice; None if `fetch` has to be run."""
    # The tested version goes last, where it is taken.
    debs = sorted((folder or cache_folder()).glob(f"{package}_*.deb"))
    debs.sort(key=lambda p: version_of(p) == tested_version)
    return _deb(package, tested_version, debs[-1]) if debs else None


def fetched_deb(package: str, tested_version: str, folder: Path | None = None) -> Deb:
    """The package from the cache, else downloaded: through apt, else as the pinned file.

    Raises MachineFailed, with what to do, where neither can give it.
    """
    folder = folder or cache_folder()
    try:
        cached = cached_deb(package, tested_version, folder)
        return cached or _download_into(package, tested_version, folder)
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
    # Hash a file once a process: a job of many homes asks for its package with each.
    status, version, note = path.stat(), version_of(path), ""
    if version != tested_version:
        note = f"{package} {version} is not the tested version {tested_version}"
    return Deb(
        package, version, path, cached_sha256(path, status.st_size, status.st_mtime_ns), note
    )


@lru_cache(maxsize=16)
def cached_sha256(path: Path, size: int, mtime_ns: int) -> str:
    # Keep the hash beside the file, under its size and date: a hundred megabytes take a while.
    note, cached = path.with_name(f"{path.name}.sha256"), [""]
    with contextlib.suppress(OSError):
        cached = note.read_text("ascii", "replace").split()
    if len(cached) == 3 and cached[1:] == [str(size), str(mtime_ns)]:
        return cached[0]
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    with contextlib.suppress(OSError):  # works without a writable cache
        write_whole(note, f"{sha256} {size} {mtime_ns}\n".encode())
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
