"""The board's style, scripts and vendored libraries, in memory. Effects: reads the package."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

_TYPES: Final = {
    "js": "text/javascript; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "svg": "image/svg+xml",
    "txt": "text/plain; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Asset:
    """A file of the package for browsers."""

    data: bytes
    zipped: bytes  # with gzip
    content_type: str
    version: str  # digest of the bytes


def assets() -> dict[str, Asset]:
    """Name -> asset, of the package's folders static and vendor."""
    package = files("pbrs_farm.board")
    static = [f for folder in ("static", "vendor") for f in (package / folder).iterdir()]
    return {
        file.name: _asset(file.name, file.read_bytes())
        for file in sorted(static, key=lambda f: f.name)
        if file.name.rpartition(".")[2] in _TYPES
    }


def _asset(name: str, data: bytes) -> Asset:
    content_type = _TYPES[name.rpartition(".")[2]]
    version = hashlib.sha256(data).hexdigest()[:12]
    return Asset(data, gzip.compress(data, 9, mtime=0), content_type, version)
