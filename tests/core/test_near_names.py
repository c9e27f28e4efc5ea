"""A misspelling is answered with the nearest name, or with nothing if none is near."""

from __future__ import annotations

import pytest

from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import Recipe, field_paths, recipe_from_name
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice, near_names

HOMES = ("Studio", "2BedroomApartment", "4BedroomHouse", "builtin")


def test_the_nearest_name_in_any_case_comes_first() -> None:
    assert near_names("studoi", HOMES) == ["Studio"]
    assert near_names("4bedroomhose", HOMES)[0] == "4BedroomHouse"


def test_a_word_unlike_all_others_gets_no_suggestion() -> None:
    assert near_names("zzz", HOMES) == []
    assert did_you_mean("zzz", HOMES) == ""
    assert hint_of_choice("zzz", ("a", "b")) == "of a, b"


def test_a_long_strange_word_costs_nothing() -> None:
    assert near_names("x" * 10_000_000, HOMES) == []


@pytest.mark.parametrize(
    ("path", "offer"),
    [
        ("light.sp", "light.spp"),
        ("spp", "light.spp"),
        ("image.width", "image.width_px"),
        ("camera.preset", "cameras.preset"),
        ("sed", "seed"),
    ],
)
def test_an_unknown_field_is_answered_with_the_nearest(path: str, offer: str) -> None:
    with pytest.raises(BadRecipe, match=rf"no such field, did you mean.* {offer}\b"):
        recipe_from_name("fast", {path: "1"})


def test_every_field_is_named_as_set_takes_it() -> None:
    recipe = Recipe()
    for path in field_paths():
        group, _, field = path.partition(".")
        values = getattr(recipe, group)
        assert hasattr(values, field) if field else True, path
    assert {"seed", "light.spp", "dress.catalogue"} <= set(field_paths())
