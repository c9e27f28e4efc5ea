"""Debian's packages as pinned files, for machines where apt gives none: place, size and sha256.

Effects: downloads a file from a mirror of Debian.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import MachineFailed

DEFAULT_MIRROR: Final = "https://deb.debian.org/debian"
_TIMEOUT_S: Final = 30.0  # of an answer
_CHUNK: Final = 2**20


@dataclass(frozen=True, slots=True)
class Pin:
    """One file of Debian's pool."""

    package: str
    path: str  # below the mirror
    n_bytes: int
    sha256: str

    @property
    def file_name(self) -> str:
        """Its name in the pool and in the cache."""
        return self.path.rpartition("/")[2]


PINS: Final = {
    pin.package: pin
    for pin in (
        Pin(
            "sweethome3d",
            "pool/main/s/sweethome3d/sweethome3d_7.0.2+dfsg-3_all.deb",
            17004768,
            "54bce4394ae763da1ffccff8f025565ce7161dc6934371e07480034ef155c411",
        ),
        Pin(
            "sweethome3d-furniture",
            "pool/main/s/sweethome3d-furniture/sweethome3d-furniture_1.8-1_all.deb",
            119782356,
            "3ccb90c63f9525e887a767b9cd5c8b6933b8b6b2973a615a5359ee68a2118668",
        ),
        Pin(
            "blender-data",
            "pool/main/b/blender/blender-data_3.4.1+dfsg-2_all.deb",
            31389128,
            "5ceaf56a49ba3ded95c751d739aeec3d19e7fad76fba5cb70666986af9303b0e",
        ),
        Pin(
            "libatomic1",
            "pool/main/g/gcc-12/libatomic1_12.2.0-14+deb12u1_amd64.deb",
            9376,
            "fbd4e154a6b444229ea002cc209df099209c0adc09102e5fd21239a3d2b55e2d",
        ),
    )
}


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
