"""The recipe of a root in the words of the command line. Effects: reads recipe.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import RECIPE_NAMES, differences, recipe_from_json, recipe_from_name

_MOST_BYTES: Final = 2**20


@dataclass(frozen=True)
class RecipeWords:
    """Values of --recipe and --set: a preset and every different field, "light.spp=16"."""

    preset: str
    settings: tuple[str, ...]


def recipe_words(reader: RootReader) -> RecipeWords | None:
    """The root's recipe as a preset and settings; None without a recipe of this version.

    The preset with the fewest different fields, and of several the one with the recipe's name.
    """
    data = reader.get_or_none(keys.RECIPE, _MOST_BYTES)
    if data is None:
        return None
    try:
        recipe = recipe_from_json(data, keys.RECIPE)
    except BadRecipe:
        return None
    changes = {name: differences(recipe_from_name(name), recipe) for name in RECIPE_NAMES}
    preset = min(changes, key=lambda name: (len(changes[name]), name != recipe.name))
    return RecipeWords(preset, tuple(_setting(line) for line in changes[preset]))


def _setting(difference: str) -> str:
    """ "light.spp: 64 -> 16" as "light.spp=16"."""
    path, _, values = difference.partition(": ")
    return f"{path}={values.rpartition(' -> ')[2]}"
