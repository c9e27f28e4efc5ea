"""The word table against the names that the program and Debian's furniture package give their pieces.

The program's catalogue has a class for each id; the class of a package's piece is that of its
English name, if the package was fetched. Each piece is named in eleven languages.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from functools import cache

import pytest

from pbrs_farm.assets import furniture_package
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP
from pbrs_farm.read.catalogue.library_files import numbered_entries, parse_properties
from pbrs_farm.read.common.furniture_classes import PieceSize, class_of_piece, nyu40_of
from tests.example_homes import example_homes

LANGUAGES = ("de", "nl", "fr", "es", "it", "pt", "pl", "ru", "zh_CN", "ja")
IN_JAR = "com/eteks/sweethome3d/io/DefaultFurnitureCatalog"
IN_LIBRARY = "PluginFurnitureCatalog"
CHIEF = ("bed", "sofa", "chair", "table", "bathtub", "toilet", "refrigerator", "window", "door")


def _size(entry: dict[str, str]) -> PieceSize:
    return PieceSize(*(float(entry[side]) / 100 for side in ("width", "height", "depth")))


def _class(name: str, size: PieceSize) -> int:
    nyu40 = class_of_piece("", name, "", size).nyu40
    return OTHERPROP if nyu40 is None else nyu40


@cache
def _named(language: str) -> tuple[tuple[str, int, PieceSize], ...]:
    """Name, class and size of each piece in that language."""
    return tuple(_entries(language))


def _entries(language: str) -> Iterator[tuple[str, int, PieceSize]]:
    resources = example_homes().resources()
    base = resources.read(f"{IN_JAR}.properties")
    texts = resources.read(f"{IN_JAR}_{language}.properties")
    assert base is not None
    assert texts is not None
    for entry, names in _pairs(base, texts):
        nyu40 = nyu40_of(entry["id"], "")
        if nyu40 is not None and nyu40 != 0 and "texturable" not in entry["id"]:
            yield names, nyu40, _size(entry)
    package = furniture_package.cached()
    for library in package.libraries if package else ():
        with zipfile.ZipFile(library) as archive:
            base = archive.read(f"{IN_LIBRARY}.properties")
            texts = archive.read(f"{IN_LIBRARY}_{language}.properties")
        for entry, name in _pairs(base, texts):
            name_nyu40 = class_of_piece("", entry["name"], "", _size(entry)).nyu40
            if name_nyu40 is not None and name != entry["name"]:
                yield name, name_nyu40, _size(entry)


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
def test_pieces_have_the_class_of_their_name(language: str) -> None:
    named = _named(language)
    assert len(named) >= 85
    right = [_class(name, size) == nyu40 for name, nyu40, size in named]
    assert sum(right) >= 0.85 * len(named)
    # The main furniture of a home is nearly always recognised.
    chief = [k for k, (_n, nyu40, _s) in enumerate(named) if NYU40_NAMES[nyu40] in CHIEF]
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
def test_counts_of_seats_and_doors_are_no_class(name: str, label: str) -> None:
    assert nyu40_of("", name) == NYU40_NAMES.index(label)
