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
    """What --recipe and --set would say: a preset and every field that differs, "light.spp=16"."""

    preset: str
    settings: tuple[str, ...]


def recipe_words(reader: RootReader) -> RecipeWords | None:
    """The root's recipe from the preset that it is nearest to; None without one of this version.

    The nearest preset is that with the fewest fields that differ; of equals the one that the recipe
    is named after.
    """
    # A root that is still empty, or of another version, has pages all the same.
    data = reader.get_or_none(keys.RECIPE, _MOST_BYTES)
    if data is None:
        return None
    try:
        recipe = recipe_from_json(data, keys.RECIPE)
    except BadRecipe:
        return None
    # The nearest preset has the fewest fields that differ; its own name decides between equals.
    found = {name: differences(recipe_from_name(name), recipe) for name in RECIPE_NAMES}
    preset = min(found, key=lambda name: (len(found[name]), name != recipe.name))
    return RecipeWords(preset, tuple(_setting(line) for line in found[preset]))


def _setting(difference: str) -> str:
    """ "light.spp: 64 -> 16" as "light.spp=16"."""
    path, _, values = difference.partition(": ")
    return f"{path}={values.rpartition(' -> ')[2]}"
