"""Classes of furniture by catalogue id and by name."""

from __future__ import annotations

import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import ItemKind
from pbrs_farm.read.common.furniture_classes import kind_of, nyu40_of


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
def test_a_piece_is_what_the_head_of_its_name_says(
    catalogue_id: str, name: str, label: str
) -> None:
    assert nyu40_of(catalogue_id, name) == NYU40_NAMES.index(label)


def test_a_bare_box_takes_its_groups_name() -> None:
    assert nyu40_of("eTeks#texturableBox", "Box", "Bed") == NYU40_NAMES.index("bed")


def test_an_unknown_thing_has_no_class() -> None:
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
def test_persons_plants_and_stairs_are_told_apart(
    catalogue_id: str, name: str, kind: ItemKind
) -> None:
    nyu40 = nyu40_of(catalogue_id, name) or 0
    assert kind_of(catalogue_id, name, nyu40, is_opening=False, is_light=False) is kind
