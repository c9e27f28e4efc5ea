"""Classes of furniture by catalogue id and by name."""

from __future__ import annotations

import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import ItemKind
from pbrs_farm.read.common.furniture_classes import (
    PieceSize,
    class_of_piece,
    kind_of,
    nyu40_of,
    plain,
)


@pytest.mark.parametrize(
    ("catalogue_id", "name", "label"),
    [
        ("eTeks#bed140x190", "Anything", "bed"),
        ("", "Desk lamp", "lamp"),
        ("", "Lamp desk", "desk"),
        ("", "Coffee table", "table"),
        ("", "TV stand", "cabinet"),
        ("", "Toilet brush", "otherprop"),
        ("", "Chair with cushion", "chair"),
        ("", "Sofa 2 seats", "sofa"),
        ("", "Double window 3 panes", "window"),
        ("", "Benches", "chair"),
        ("Maker#greenArmchair", "Fauteuil", "chair"),
        ("eTeks#texturableBox", "Carpet", "floor mat"),
        ("eTeks#texturableBox", "Box", "otherprop"),
    ],
)
def test_the_head_noun_of_a_name_gives_the_class(catalogue_id: str, name: str, label: str) -> None:
    assert nyu40_of(catalogue_id, name) == NYU40_NAMES.index(label)


def test_a_bare_box_takes_its_groups_name() -> None:
    assert nyu40_of("eTeks#texturableBox", "Box", "Bed") == NYU40_NAMES.index("bed")


def test_an_unknown_name_has_no_class() -> None:
    assert nyu40_of("", "Xyzzy") is None


@pytest.mark.parametrize(
    ("catalogue_id", "name", "kind"),
    [
        ("eTeks#plant", "Pflanze", ItemKind.PLANT),
        ("", "Japanese maple", ItemKind.PLANT),
        ("", "Plant box", ItemKind.OBJECT),
        ("eTeks#staircase", "Treppe", ItemKind.STAIRS),
        ("", "Sitting female", ItemKind.PERSON),
        ("", "Child swing", ItemKind.OBJECT),
    ],
)
def test_persons_plants_and_stairs_are_distinguished(
    catalogue_id: str, name: str, kind: ItemKind
) -> None:
    piece = class_of_piece(catalogue_id, name)
    assert kind_of(piece, piece.nyu40 or 0, is_opening=False, is_light=False) is kind


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("DeskPortrait", "picture"),
        ("CookingBench", "counter"),
        ("TVStand2", "cabinet"),
        ("Schreibtischlampe", "lamp"),
        ("Esszimmerstuhl", "chair"),
        ("Table de nuit", "night stand"),
        ("Lampe de bureau", "lamp"),
        ("Chaise bureau", "chair"),
        ("Lámpara de mesa", "lamp"),
        ("Armadio bianco", "cabinet"),
        ("Guarda-roupa", "cabinet"),
        ("Łóżko", "bed"),
        ("Кресло", "chair"),
        ("餐桌", "table"),
        ("Pair of curtains", "curtain"),
        ("Sleeping bag", "bed"),
        ("Door frame", "door"),
        ("Picture frame", "picture"),
    ],
)
def test_a_name_is_read_by_whole_words_in_its_language(name: str, label: str) -> None:
    assert nyu40_of("", name) == NYU40_NAMES.index(label)


@pytest.mark.parametrize(
    ("name", "place", "label", "rule"),
    [
        ("Chair", PieceSize(0.5, 0.9, 0.5), "chair", "name"),
        ("Chair", PieceSize(3.0, 0.9, 0.5), None, "size"),
        ("Table", PieceSize(0.6, 0.05, 0.4), None, "size"),
        ("Bed", PieceSize(0.6, 0.2, 0.3), "bed", "name"),
        ("Bed", PieceSize(0.6, 0.2, 0.3, bottom=0.8), None, "size"),
        ("Desk xyzzy", PieceSize(1.4, 0.75, 0.7), "desk", "inner-word"),
        ("Desk xyzzy", PieceSize(0.2, 0.3, 0.1), None, "size"),
        ("Xyzzy", PieceSize(1, 1, 1), None, "none"),
    ],
)
def test_size_and_place_overrule_words(
    name: str, place: PieceSize, label: str | None, rule: str
) -> None:
    piece = class_of_piece("", name, "", place)
    assert (piece.nyu40, piece.rule) == (None if label is None else NYU40_NAMES.index(label), rule)


def test_a_catalogue_piece_of_impossible_size_is_classified_by_name() -> None:
    tray = PieceSize(0.4, 0.03, 0.4)
    assert class_of_piece("eTeks#squareTable", "Tray", "", tray).rule == "name"
    assert class_of_piece("eTeks#squareTable", "Table", "", tray).rule == "size"
    assert class_of_piece("eTeks#squareTable", "Table").rule == "catalogue"


def test_a_television_unit_without_its_television_is_a_cabinet() -> None:
    whole, bench = PieceSize(1.0, 0.93, 0.52), PieceSize(1.0, 0.417, 0.52)
    for place, label in ((whole, "television"), (None, "television"), (bench, "cabinet")):
        nyu40 = class_of_piece("eTeks#tvUnit", "TV unit", "", place).nyu40
        assert nyu40 == NYU40_NAMES.index(label)
    # A flat screen is wide as well, but shallow.
    flat = class_of_piece("eTeks#flatTV", "Flat TV", "", PieceSize(1.6, 0.7, 0.2)).nyu40
    assert flat == NYU40_NAMES.index("television")


def test_a_name_of_megabytes_is_its_beginning() -> None:
    assert class_of_piece("", "chair " + "a" * 2**21).nyu40 == class_of_piece("", "chair").nyu40


def test_accents_and_case_part_no_words() -> None:
    assert plain("KüchenSchrank TVUnit") == "kuchen schrank tv unit"


def test_wide_flat_grass_is_no_plant() -> None:
    lawn = class_of_piece("", "Grass", place=PieceSize(8.0, 0.02, 6.0))
    assert (lawn.nyu40, lawn.word) == (None, "")
    assert class_of_piece("", "Grass", place=PieceSize(0.4, 0.3, 0.4)).word == "plant"
    assert class_of_piece("", "Hedge", place=PieceSize(4.0, 1.0, 0.5)).word == "plant"
