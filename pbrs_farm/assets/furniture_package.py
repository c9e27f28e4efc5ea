"""The furniture libraries of Debian's `sweethome3d-furniture` package: fetch, unpack once.

Effects: those of debian.py, and the unpacked libraries in the cache folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.assets.debian import Deb, DebFiles

PACKAGE: Final = "sweethome3d-furniture"
TESTED_VERSION: Final = "1.8-1"
FOLDER: Final = "usr/share/sweethome3d/furniture"  # in the package
LIBRARIES: Final = ("BlendSwap-CC-0", "BlendSwap-CC-BY", "KatorLegaz", "Scopia")
"""The libraries to dress with. Reallusion's holds people alone."""


@dataclass(frozen=True, slots=True)
class FurniturePackage:
    """A fetched package."""

    version: str
    deb_sha256: str
    libraries: tuple[Path, ...]  # .sh3f files, unpacked, in the cache
    note: str = ""  # irregularities of the package


FILES: Final = DebFiles(
    PACKAGE, TESTED_VERSION, {f"{FOLDER}/{name}.sh3f": f"/{name}.sh3f" for name in LIBRARIES}
)


def cached(cache: Path | None = None) -> FurniturePackage | None:
    """The cached package of furniture, or None; no network."""
    deb = FILES.cached(cache)
    return _package(deb) if deb else None


def fetch(cache: Path | None = None) -> FurniturePackage:
    """The package from the cache, else downloaded through apt (120 MB).

    Raises MachineFailed, with the command to type, where apt cannot give it.
    """
    return _package(FILES.fetch(cache))


def _package(deb: Deb) -> FurniturePackage:
    return FurniturePackage(deb.version, deb.sha256, tuple(FILES.places(deb).values()), deb.note)
