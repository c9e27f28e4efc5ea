"""Debian's packages as pinned files, for machines where apt gives none: place, size and sha256.

Effects: downloads a file from a mirror of Debian.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.record import Record, read_csv

DEFAULT_MIRROR: Final = "https://deb.debian.org/debian"
_TIMEOUT_S: Final = 30.0  # of an answer
_CHUNK: Final = 2**20


class Pin(Record):
    """One file of Debian's pool: a row of pinned_packages.csv."""

    package: str
    path: str  # below the mirror
    n_bytes: int
    sha256: str

    @property
    def file_name(self) -> str:
        """Its name in the pool and in the cache."""
        return self.path.rpartition("/")[2]


PINS: Final = {pin.package: pin for pin in read_csv(Path(__file__).with_suffix(".csv"), Pin)}


def download_pinned(pin: Pin, folder: Path) -> Path:
    """The pinned file, downloaded into a folder and checked; raises MachineFailed, saying what to do.

    From PBRS_DEBIAN_MIRROR where it is set. Size and sha256 are compared, so no signature is
    needed; a file that differs is removed. One try, with a time limit.
    """
    import urllib.request  # with all of HTTP, which most commands do without

    mirror = os.environ.get("PBRS_DEBIAN_MIRROR", "") or DEFAULT_MIRROR
    url, path = f"{mirror.rstrip('/')}/{pin.path}", folder / pin.file_name
    digest, size = hashlib.sha256(), 0
    try:
        with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as answer, path.open("wb") as file:
            # One byte too many says that it is another file; more is not waited for.
            while size <= pin.n_bytes and (chunk := answer.read(_CHUNK)):
                size += len(chunk)
                digest.update(chunk)
                file.write(chunk)
    except (OSError, ValueError) as error:
        path.unlink(missing_ok=True)
        raise MachineFailed(f"{url}: {error}", hint=_hint(pin)) from None
    if digest.hexdigest() != pin.sha256:
        path.unlink(missing_ok=True)
        text = f"{url}: has another checksum (sha256 {digest.hexdigest()[:16]}...)"
        raise MachineFailed(text, hint=_hint(pin))
    return path


def _hint(pin: Pin) -> str:
    return (
        f"get {pin.file_name} and put it into $PBRS_CACHE or ~/.cache/pbrs_farm,"
        " or name a mirror in PBRS_DEBIAN_MIRROR"
    )
