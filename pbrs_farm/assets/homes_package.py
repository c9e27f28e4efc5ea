"""The nine example homes of Debian's `sweethome3d` package: list, fetch, read their bytes.

Effects: those of debian.py, and the unpacked jar in the cache folder.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.assets.debian import Deb, DebFiles
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import hint_of_choice

PACKAGE: Final = "sweethome3d"
TESTED_VERSION: Final = "7.0.2+dfsg-3"
JAR: Final = "usr/share/sweethome3d/sweethome3d.jar"  # in the package
EXAMPLES: Final = "com/eteks/sweethome3d/io/resources/examples"  # in the jar


@dataclass(frozen=True, slots=True)
class ExampleHome:
    """A home drawn by E. and V. Puybaret / eTeks (CC-BY 3.0)."""

    name: str  # to ask for it by
    n_rooms: int
    n_levels: int


_HOMES: Final = (
    ExampleHome("Studio", 5, 1),
    ExampleHome("1BedroomApartmentWithRoundWall", 3, 1),
    ExampleHome("2BedroomApartment", 7, 1),
    ExampleHome("2BedroomApartmentWithBowWindow", 8, 1),
    ExampleHome("2BedroomHouseWithBasement", 13, 3),
    ExampleHome("3BedroomApartment", 9, 1),
    ExampleHome("3BedroomHouseWithAttic", 11, 4),
    ExampleHome("3BedroomHouseWithMezzanine", 23, 3),
    ExampleHome("4BedroomHouse", 11, 2),
)


def example_homes() -> tuple[ExampleHome, ...]:
    """The example homes by name; rooms and levels as drawn, hidden levels included."""
    return _HOMES


def exact_name(word: str) -> str:
    """The example home that a word names, letters' case apart; raises BadInput naming the nearest.

    word: with or without ".xml". The package need not be there: the names are known without it.
    """
    exact_names = {h.name.lower(): h.name for h in _HOMES}
    exact = exact_names.get(word.lower().removesuffix(".xml"))
    if exact is None:
        hint = hint_of_choice(word, [*exact_names.values(), "builtin"])
        raise BadInput(word, "", "no such file, and no example home of that name", hint=hint)
    return exact


@dataclass(frozen=True, slots=True)
class Package:
    """A fetched package."""

    version: str
    deb_sha256: str
    jar: Path  # unpacked, in the cache
    note: str = ""  # irregularities of the package

    @property
    def label(self) -> str:
        """For Source.package: name, version and hash."""
        return f"{PACKAGE} {self.version} (Debian, sha256 {self.deb_sha256})"

    def home(self, name: str) -> tuple[bytes, str]:
        """The XML of an example home and its file name; BadInput for an unknown name.

        name: as `exact_name` takes it. Opens the jar at each call.
        """
        exact = exact_name(name)
        with zipfile.ZipFile(self.jar) as jar:
            try:
                return jar.read(f"{EXAMPLES}/{exact}.xml"), f"{exact}.xml"
            except KeyError:
                raise BadInput(self.jar, f"{EXAMPLES}/{exact}.xml", "not in this version") from None

    def resources(self) -> JarResources:
        """The program's own models and textures, for homes that refer to them."""
        return JarResources(self.jar)


class JarResources:
    """Contents of the program's jar by name; opened on the first read."""

    def __init__(self, jar: Path) -> None:
        self._jar = jar
        self._zip: zipfile.ZipFile | None = None

    def read(self, name: str) -> bytes | None:
        """The content's bytes, or None for an unknown name.

        name: path within the jar. The jar stays open for the next call.
        """
        if self._zip is None:
            self._zip = zipfile.ZipFile(self._jar)
        try:
            return self._zip.read(name)
        except KeyError:
            return None


FILES: Final = DebFiles(PACKAGE, TESTED_VERSION, {JAR: ".jar"})


def cached(cache: Path | None = None) -> Package | None:
    """The cached package of example homes and models, or None; no network."""
    deb = FILES.cached(cache)
    return _package(deb) if deb else None


def fetch(cache: Path | None = None) -> Package:
    """The package from the cache, else downloaded through apt.

    Raises MachineFailed, with the command to type, where apt cannot give it.
    """
    return _package(FILES.fetch(cache))


def _package(deb: Deb) -> Package:
    return Package(deb.version, deb.sha256, FILES.places(deb)[JAR], deb.note)
