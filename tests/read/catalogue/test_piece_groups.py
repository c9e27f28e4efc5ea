from __future__ import annotations

import pytest

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.house import ItemKind
from pbrs_farm.read.catalogue.piece_groups import group_rule, group_rules, piece_verdicts


@pytest.mark.parametrize(
    ("name", "category", "size", "group"),
    [
        ("Coffee cup", "Kitchen", (0.1, 0.1, 0.05), "cup"),
        ("Coffee table", "Living room", (1.2, 0.7, 0.45), "coffee_table"),
        ("Table", "Living room", (1.4, 0.9, 0.74), "dining_table"),
        ("Table", "Office", (1.6, 0.8, 0.75), "desk"),
        ("Table", "Living room", (1.0, 0.7, 0.54), "coffee_table"),
        ("Chair with cushion", "Living room", (0.44, 0.44, 0.95), "chair"),
        ("Lamp", "Lights", (0.4, 0.4, 1.4), "floor_lamp"),
        ("Lamp", "Lights", (0.3, 0.3, 0.4), "table_lamp"),
        ("Plates", "Kitchen", (0.2, 0.2, 0.05), "plate"),
        ("Bowl with fruits", "Kitchen", (0.3, 0.3, 0.14), "fruit"),
        ("Bücherregal", "Wohnzimmer", (0.9, 0.3, 1.8), "bookcase"),
        ("Armoire", "", (1.0, 0.6, 2.0), "wardrobe"),
    ],
)
def test_name_category_and_size_give_the_group(
    name: str, category: str, size: tuple[float, float, float], group: str
) -> None:
    rule = group_rule(name, category, size)
    assert rule is not None
    assert rule.group == group


@pytest.mark.parametrize(
    ("name", "category", "size"),
    [
        ("Chair", "Exterior", (0.5, 0.5, 0.9)),
        ("Female", "Characters", (0.5, 0.5, 1.7)),
        ("Thing", "Living room", (0.5, 0.5, 0.9)),
        ("Bed", "Bedroom", (0.05, 0.1, 0.03)),
        ("", "", (1.0, 1.0, 1.0)),
    ],
)
def test_outdoor_and_unknown_models_have_no_group(
    name: str, category: str, size: tuple[float, float, float]
) -> None:
    assert group_rule(name, category, size) is None


def test_a_group_that_the_user_names_goes_before_the_words() -> None:
    rule = group_rule("Kallax", "", (0.8, 0.4, 1.5), group="shelves")
    assert rule is not None
    assert rule.group == "shelves"
    assert group_rule("Chair", "", (0.5, 0.5, 0.9), group="nonsense") is None


def test_lamps_plants_doors_and_windows_are_of_their_kind() -> None:
    kinds = {r.group: r.kind for r in group_rules()}
    assert kinds["floor_lamp"] is ItemKind.LAMP
    assert kinds["plant"] is ItemKind.PLANT
    assert (kinds["door"], kinds["window"]) == (ItemKind.DOOR, ItemKind.WINDOW)
    assert kinds["chair"] is ItemKind.OBJECT


def test_wall_pieces_are_measured_along_walls() -> None:
    rule = group_rule("Wall clock", "", (0.3, 0.03, 0.3))
    assert rule is not None
    assert rule.place is Place.WALL


def test_every_exception_has_a_reason_and_a_group_that_exists() -> None:
    groups = {r.group for r in group_rules()} | {""}
    assert all(v.reason and v.group in groups for v in piece_verdicts().values())
