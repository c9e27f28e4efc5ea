"""The word table against what the program and Debian's furniture package call their own pieces.

The program's own catalogue has a class for each of its ids; a piece of the furniture package is
what its English name says, where that package is fetched. Each is named in eleven languages.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from functools import cache

import pytest

from pbrs_farm.assets import furniture_package
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP
from pbrs_farm.read.catalogue.property_files import numbered_entries, parse_properties
from pbrs_farm.read.common.furniture_classes import PieceSize, class_of_piece, nyu40_of
from tests.example_homes import example_homes

LANGUAGES = ("de", "nl", "fr", "es", "it", "pt", "pl", "ru", "zh_CN", "ja")
IN_JAR = "com/eteks/sweethome3d/io/DefaultFurnitureCatalog"
IN_LIBRARY = "PluginFurnitureCatalog"
CHIEF = ("bed", "sofa", "chair", "table", "bathtub", "toilet", "refrigerator", "window", "door")


def _size(entry: dict[str, str]) -> PieceSize:
    return PieceSize(*(float(entry[side]) / 100 for side in ("width", "height", "depth")))


def _class(name: str, size: PieceSize) -> int:
    found = class_of_piece("", name, "", size).nyu40
    return OTHERPROP if found is None else found


@cache
def _named(language: str) -> tuple[tuple[str, int, PieceSize], ...]:
    """Each piece's name in that language, its class and its size."""
    return tuple(_found(language))


def _found(language: str) -> Iterator[tuple[str, int, PieceSize]]:
    resources = example_homes().resources()
    base = resources.read(f"{IN_JAR}.properties")
    own = resources.read(f"{IN_JAR}_{language}.properties")
    assert base is not None
    assert own is not None
    for entry, names in _pairs(base, own):
        known = nyu40_of(entry["id"], "")
        if known is not None and known != 0 and "texturable" not in entry["id"]:
            yield names, known, _size(entry)
    package = furniture_package.cached()
    for library in package.libraries if package else ():
        with zipfile.ZipFile(library) as archive:
            base = archive.read(f"{IN_LIBRARY}.properties")
            own = archive.read(f"{IN_LIBRARY}_{language}.properties")
        for entry, name in _pairs(base, own):
            said = class_of_piece("", entry["name"], "", _size(entry)).nyu40
            if said is not None and name != entry["name"]:
                yield name, said, _size(entry)


def _pairs(base: bytes, own: bytes) -> Iterator[tuple[dict[str, str], str]]:
    names = parse_properties(own)
    properties = parse_properties(base)
    numbers = {v: k.partition("#")[2] for k, v in properties.items() if k.startswith("id#")}
    for entry in numbered_entries(properties):
        name = names.get(f"name#{numbers[entry['id']]}") if "id" in entry else None
        if name and "width" in entry:
            yield entry, name


@pytest.mark.homes
@pytest.mark.parametrize("language", LANGUAGES)
def test_pieces_are_what_their_own_names_say(language: str) -> None:
    named = _named(language)
    assert len(named) >= 85
    right = [_class(name, size) == known for name, known, size in named]
    assert sum(right) >= 0.85 * len(named)
    # A home's chief furniture is known nearly always.
    chief = [k for k, (_n, known, _s) in enumerate(named) if NYU40_NAMES[known] in CHIEF]
    assert sum(right[k] for k in chief) >= 0.9 * len(chief)


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("Софа двухместная", "sofa"),
        ("Диван двухместный", "sofa"),
        ("двухместный диван", "sofa"),
        ("couchTwoSeats", "sofa"),
        ("SofaThreeSeats_02", "sofa"),
        ("Tweezitsbank", "sofa"),
        ("Ecksofa", "sofa"),
        ("Wardrobe two doors", "cabinet"),
        ("Two-seat sofa", "sofa"),
        ("Four poster bed", "bed"),
        ("Garde-robe", "cabinet"),
        ("Hanglamp", "lamp"),
    ],
)
def test_seats_and_doors_that_are_counted_name_no_thing(name: str, label: str) -> None:
    assert nyu40_of("", name) == NYU40_NAMES.index(label)
