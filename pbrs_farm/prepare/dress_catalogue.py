"""The catalogue for dressing, read once per process from cached packages and users' libraries; caches shapes."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Final

from pbrs_farm.assets import furniture_package, homes_package
from pbrs_farm.assets.debian import cache_folder
from pbrs_farm.assets.furniture_package import FurniturePackage
from pbrs_farm.assets.homes_package import Package
from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.house import Note
from pbrs_farm.core.plugins import plugins
from pbrs_farm.core.recipe import DressFields

NO_FURNITURE = "no-furniture"
"""Kind of the note about missing furniture packages."""


GENERATED = "generated"
"""Word of dress.catalogue that excludes the packages."""

_CODE: Final = {".py", ".csv", ".toml"}


def fetch_packages(words: str) -> None:
    """Download the missing packages of catalogue_of_words; MachineFailed, BadInput for a bad path."""
    paths = [word for word in words.split(":") if word]
    if GENERATED not in paths:
        furniture_package.fetch()
        homes_package.fetch()
    if any(word != GENERATED for word in paths):
        catalogue_of_words(words)


def catalogue_of_words(words: str, licences: tuple[str, ...] = ()) -> Catalogue:
    """The packages (a missing one is a note), then paths separated by ":"; BadInput for a bad path.

    licences: of the pieces and pictures of libraries; () for any.
    """
    paths = [word for word in words.split(":") if word]
    stamps = tuple((Path(word), _stamp(Path(word))) for word in paths if word != GENERATED)
    if GENERATED in paths:
        return _catalogue(stamps, None, licences)
    return _catalogue(stamps, has_furniture(), licences)


def own_catalogue(paths: Sequence[Path]) -> Catalogue:
    """Index the user's libraries and folders alone, once; may hold only notes. BadInput for no library."""
    from pbrs_farm.read.catalogue.read_catalogue import catalogue_from

    return catalogue_from((), given=paths, store=_store(), may_be_empty=True)


def has_furniture() -> bool:
    """True if the furniture package is cached; does not unpack it."""
    return bool(furniture_package.FILES.cached_files())


def _store() -> Path:
    # Shapes read from the packages' models, beside the packages.
    return cache_folder() / "shapes"


def _stamp(path: Path) -> int:
    # A changed library is read again.
    return path.stat().st_mtime_ns if path.exists() else 0


@lru_cache(maxsize=4)
def _catalogue(
    libraries: tuple[tuple[Path, int], ...], has_package: bool | None, licences: tuple[str, ...]
) -> Catalogue:
    @cache
    def whole() -> Catalogue:
        from pbrs_farm.dress.content import content

        of_libraries = _of_libraries(libraries, has_package).with_licences(licences)
        catalogue = content().with_families(of_libraries)
        # Nobody can tell when the code of a plugin's furniture changes.
        return catalogue if plugins("furniture") else _through_store(catalogue)

    if libraries or plugins("furniture"):
        catalogue = whole()
    else:
        from pbrs_farm.read.catalogue.read_catalogue import indexed

        files = [] if has_package is None else _files_of_packages(has_package=has_package)
        name = keys.digest(digest_of_code(), licences, has_package, files)
        catalogue = indexed(_store() / f"{name}.index", whole)
    return replace(catalogue, painted_folder=cache_folder() / "painted")


def _files_of_packages(*, has_package: bool) -> list[tuple[str, int, int]]:
    package, program = _packages(has_package)
    paths = [*(package.libraries if package else ()), *([program.jar] if program else ())]
    stats = [(path, path.stat()) for path in paths]
    notes = [(package.note, 0, 0)] if package else []
    return [*notes, *((str(path), s.st_size, s.st_mtime_ns) for path, s in stats)]


def _packages(has_package: bool) -> tuple[FurniturePackage | None, Package | None]:
    return furniture_package.cached() if has_package else None, homes_package.cached()


def _through_store(catalogue: Catalogue) -> Catalogue:
    """The catalogue with generated furniture from the store, too: its shapes depend on the code alone."""
    from pbrs_farm.read.catalogue.read_catalogue import ShapeStore

    store, code = ShapeStore(_store()), digest_of_code()
    keys_of_ours = {p.id: (code, p.id) for p in catalogue.pieces if p.id not in catalogue.stored}

    def load(piece: Piece) -> Shape | None:
        if piece.id not in keys_of_ours:
            return catalogue.load(piece)
        return store.shape(keys_of_ours[piece.id], lambda: catalogue.load(piece))

    return replace(catalogue, load=load, stored={**catalogue.stored, **keys_of_ours})


@cache
def digest_of_code(package: Path = Path(__file__).parents[1]) -> str:
    """The digest of a package's code and tables, of Python and of the installed packages, whatever they do.

    A list of the modules that furniture depends on would not stay true.
    """
    digest = hashlib.sha256(sys.version.encode())
    # The folders' names hold the versions, which importlib would take twenty times as long to parse.
    installed = {path.name for place in sys.path for path in Path(place).glob("*.dist-info")}
    digest.update("\n".join(sorted(installed)).encode())
    places = (Path(folder, name) for folder, _, names in os.walk(package) for name in names)
    for path in sorted(path for path in places if path.suffix in _CODE):
        data = path.read_bytes()
        digest.update(f"\n{path.relative_to(package).as_posix()} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()


def _of_libraries(libraries: tuple[tuple[Path, int], ...], has_package: bool | None) -> Catalogue:
    from pbrs_farm.read.catalogue.read_catalogue import catalogue_from

    # None: no package needed.
    if has_package is None:
        return catalogue_from((), given=[path for path, _ in libraries], store=_store())
    package, program = _packages(has_package)
    catalogue = catalogue_from(
        package.libraries if package else (),
        jar=program.jar if program else None,
        given=[path for path, _ in libraries],
        store=_store(),
    )
    if package is not None:
        note = package.note and Note("package-version", furniture_package.PACKAGE, package.note)
        return replace(catalogue, notes=(note, *catalogue.notes)) if note else catalogue
    text = "furniture package not downloaded: `pbrs-farm homes --furniture` (120 MB)"
    return replace(
        catalogue, notes=(Note(NO_FURNITURE, furniture_package.PACKAGE, text), *catalogue.notes)
    )


def catalogue_of(fields: DressFields) -> Catalogue:
    """The catalogue of a recipe, read once a process."""
    return catalogue_of_words(fields.catalogue, fields.licences)


def fetch_catalogue(fields: DressFields) -> None:
    """Download the missing packages of a recipe; MachineFailed with the command, BadInput for a bad path."""
    fetch_packages(fields.catalogue)
