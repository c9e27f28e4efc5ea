"""The furniture libraries of Debian's `sweethome3d-furniture` package: fetch, unpack once.

Effects: those of debian.py, and the unpacked libraries in the cache folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from pbrs_farm.assets.debian import Deb, cached_deb, fetched_deb, write_whole

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


def cached(cache: Path | None = None) -> FurniturePackage | None:
    """The cached package of furniture, or None; no network."""
    deb = cached_deb(PACKAGE, TESTED_VERSION, cache)
    return _unpacked(deb) if deb else None


def fetch(cache: Path | None = None) -> FurniturePackage:
    """The package from the cache, else downloaded through apt (120 MB).

    Raises MachineFailed, with the command to type, where apt cannot give it.
    """
    return _unpacked(fetched_deb(PACKAGE, TESTED_VERSION, cache))


def _unpacked(deb: Deb) -> FurniturePackage:
    # Keep them below their package's hash: another version never reads an older one's.
    folder = deb.path.parent / f"{PACKAGE}-{deb.sha256[:16]}"
    place = {name: folder / f"{name}.sh3f" for name in LIBRARIES}
    if not all(path.exists() for path in place.values()):
        paths = {f"{FOLDER}/{name}.sh3f" for name in LIBRARIES}
        files = deb.members(lambda name: name in paths)
        if set(files) != paths:
            missing = ", ".join(sorted(PurePosixPath(f).name for f in paths - set(files)))
            raise deb.damaged(f"has no {missing}")
        folder.mkdir(exist_ok=True)
        for name, path in place.items():
            write_whole(path, files[f"{FOLDER}/{name}.sh3f"])
    return FurniturePackage(deb.version, deb.sha256, tuple(place.values()), deb.note)
