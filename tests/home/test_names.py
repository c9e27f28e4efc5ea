"""Names of items by whole words."""

from dataclasses import replace

import pytest

from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.house import Item
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.walls.radiators import wants_radiators
from pbrs_farm.home.names import words_of
from pbrs_farm.home.room_use import is_cooked_in
from tests.dress.furniture import house, solid


def named(name: str, source_class: str = "") -> Item:
    item = solid("thing", [0.0, 0.0, 0.0], [0.6, 0.8, 0.6], OTHERFURNITURE)
    return replace(item, name=name, source_class=source_class)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Woven basket", {"woven", "basket"}),
        ("cookerHood_2", {"cookerhood", "cooker", "hood"}),
        ("TVUnit01", {"tvunit", "tv", "unit"}),
        ("Heizkörper", {"heizkorper"}),
        ("ovens", {"oven", "ovens"}),
        ("주방", {"주방"}),
    ],
)
def test_a_name_is_parted_into_whole_words(name: str, words: set[str]) -> None:
    assert words_of(name) == words


@pytest.mark.parametrize("name", ["Woven basket", "Hobby table", "Shepherd's crook"])
def test_a_word_that_contains_cooker_makes_no_kitchen(name: str) -> None:
    assert not is_cooked_in([named(name)])


@pytest.mark.parametrize("name", ["Oven", "GasCooker", "Range_hood", "Elektroherd", "Ovens 2"])
def test_a_cooker_makes_a_kitchen(name: str) -> None:
    assert is_cooked_in([named(name)])
    assert is_cooked_in([named("", name)])


def test_a_home_theater_heats_no_home() -> None:
    seeds = range(1, 9)
    bare, theater, heater = (
        [wants_radiators(MutableHouse(house(*items), seed)) for seed in seeds]
        for items in ((), (named("Home theater"),), (named("GasHeater"),))
    )
    assert theater == bare
    assert any(bare)
    assert not any(heater)


def test_the_words_of_a_name_are_found_once() -> None:
    assert words_of("Wardrobes left") == {"wardrobes", "wardrobe", "left"}
    assert words_of("Wardrobes left") is words_of("Wardrobes left")
