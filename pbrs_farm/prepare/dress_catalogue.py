"""The catalogue that a command or a step dresses homes with, read once a process.

Effects: reads the cached packages and the user's libraries, keeps the shapes that were read in the
cache; downloads nothing unless asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from pbrs_farm.assets import furniture_package, homes_package
from pbrs_farm.assets.debian import cache_folder
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.house import House, Note
from pbrs_farm.core.made_home import made_homes
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.source import SourceRef, check_unchanged, home_id, read_house

NO_FURNITURE = "no-furniture"
"""The kind of the note that says that the packages' furniture is not there."""


GENERATED = "generated"
"""The word of dress.catalogue that leaves the packages out."""


def fetch_packages(words: str) -> None:
    """Download the packages of catalogue_of_words where they are not cached; MachineFailed if apt cannot.

    The user's libraries are read: BadInput for a path that does not exist or is no catalogue.
    """
    given = [word for word in words.split(":") if word]
    if GENERATED not in given:
        furniture_package.fetch()
        homes_package.fetch()
    if any(word != GENERATED for word in given):
        catalogue_of_words(words)


def catalogue_of_words(words: str) -> Catalogue:
    """The catalogue that dress.catalogue names, paths with ":" between: the packages', then those.

    A missing package is a note of the kind NO_FURNITURE, and the rest serves. BadInput for a given
    path that does not exist or is no catalogue.
    """
    given = [word for word in words.split(":") if word]
    stamps = tuple((Path(word), _stamp(Path(word))) for word in given if word != GENERATED)
    if GENERATED in given:
        return _catalogue(stamps, None)
    return _catalogue(stamps, furniture_package.PACKAGE in _cached_names())


def own_catalogue(paths: Sequence[Path]) -> Catalogue:
    """What libraries and folders of the user's own give by themselves, indexed once; maybe nothing but notes.

    Raises BadInput for what is no library.
    """
    from pbrs_farm.read.catalogue.read_catalogue import catalogue_from

    return catalogue_from((), given=paths, store=_store(), may_be_empty=True)


def has_furniture() -> bool:
    """Whether the furniture package is cached, without reading it."""
    return furniture_package.PACKAGE in _cached_names()


def _cached_names() -> frozenset[str]:
    folder = cache_folder()
    return frozenset(p.name.split("_")[0] for p in folder.glob("*.deb"))


def _store() -> Path:
    # Beside the packages: what was read of their models.
    return cache_folder() / "shapes"


def _stamp(path: Path) -> int:
    # A library that changes is read anew.
    return path.stat().st_mtime_ns if path.exists() else 0


@lru_cache(maxsize=4)
def _catalogue(given: tuple[tuple[Path, int], ...], has_package: bool | None) -> Catalogue:
    from pbrs_farm.dress.things.families import with_families

    return with_families(_of_libraries(given, has_package))


def _of_libraries(given: tuple[tuple[Path, int], ...], has_package: bool | None) -> Catalogue:
    from pbrs_farm.read.catalogue.read_catalogue import catalogue_from

    # None: no package is wanted.
    if has_package is None:
        return catalogue_from((), given=[path for path, _ in given], store=_store())
    package, program = furniture_package.cached() if has_package else None, homes_package.cached()
    catalogue = catalogue_from(
        package.libraries if package else (),
        jar=program.jar if program else None,
        given=[path for path, _ in given],
        store=_store(),
    )
    if package is not None:
        note = package.note and Note("package-version", furniture_package.PACKAGE, package.note)
        return replace(catalogue, notes=(note, *catalogue.notes)) if note else catalogue
    text = "furniture package not fetched: `pbrs-farm homes --furniture` fetches it (120 MB)"
    return replace(
        catalogue, notes=(Note(NO_FURNITURE, furniture_package.PACKAGE, text), *catalogue.notes)
    )


# A source becomes a House: read by its reader, or generated and then read; the one way in.
# Effects: those of read/source.py; a made home takes its furniture from the cached package.


_MADE_BY = "home: made by pbrs_farm, CC0"


def house_of_source(source: SourceRef, fields: ReadFields) -> House:
    """The house as its source gives it, unrepaired. Raises BadHouse, BadInput, MachineFailed."""
    if source.kind == "made":
        return _made_house(source, fields)
    if source.kind == "plan":
        from pbrs_farm.prepare.plan_house import house_of_plan

        return house_of_plan(source, fields)
    return read_house(source, fields)


def _made_house(source: SourceRef, fields: ReadFields) -> House:
    from pbrs_farm.generate.made import made
    from pbrs_farm.read.sweethome3d import read_home

    # The package must be the one that the home was named with: other models, another home.
    check_unchanged(source)
    (home,) = made_homes(source.location)
    # An empty home needs no package, so that it is made where none can be read.
    catalogue = catalogue_of_words("") if home.furniture else EMPTY
    data = made(home, catalogue).data
    house = read_home(data, f"{home.name}.sh3d", fields=fields)
    credit = house.source.attribution.replace("pbrs_farm", _MADE_BY, 1)
    its_source = replace(house.source, kind="made", file=source.location, attribution=credit)
    return replace(house, id=home_id(source), source=its_source)
