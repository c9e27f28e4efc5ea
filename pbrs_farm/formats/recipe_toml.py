"""recipe.toml: a user's recipe file, for --recipe. Effects: reads a file.

recipe = "fast"   # the base recipe, for values that the file does not set
seed = 3

[light]
spp = 128
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.recipe import RECIPE_NAMES, Recipe, changed_recipe
from pbrs_farm.core.shown_text import hint_of_choice, shown
from pbrs_farm.regular_files import toml_given

ENDING: Final = ".toml"


def recipe_from_toml(path: Path, overrides: Mapping[str, str]) -> Recipe:
    """The recipe of a file, called by the file's name; raises BadRecipe naming file and field.

    overrides: "group.field" -> text, as on the command line; they win over the file. The file's key
    `recipe` names the recipe it starts from ("fast" where it is left out). Raises BadRecipe for a
    file that cannot be read, is no TOML, is too large, or sets what no recipe has.
    """
    try:
        fields = toml_given(path)
    except BadInput as error:
        raise BadRecipe(error.message, hint=error.hint) from None
    base = fields.pop("recipe", "fast")
    if not isinstance(base, str) or base not in RECIPE_NAMES:
        hint = hint_of_choice(str(base), RECIPE_NAMES)
        raise BadRecipe(f"{path}: recipe: no recipe {base!r}", hint=hint)
    try:
        return changed_recipe(shown(path.stem), base, fields, overrides)
    except BadRecipe as error:
        raise BadRecipe(f"{path}: {error.message}", hint=error.hint) from None


def toml_from_recipe(recipe: Recipe) -> str:
    """The recipe as a file, every set value written, defaults of today too."""
    fields = recipe.model_dump(mode="json", exclude={"name"})
    lines = [f'recipe = "{recipe.name}"']
    # Values of the recipe itself precede its groups.
    groups = {name: value for name, value in fields.items() if isinstance(value, dict)}
    lines += [
        f"{name} = {_toml(value)}"
        for name, value in fields.items()
        if name not in groups and value is not None
    ]
    for name, values in groups.items():
        lines += ["", f"[{name}]"]
        # TOML has no null: omit unset values.
        lines += [f"{field} = {_toml(v)}" for field, v in values.items() if v is not None]
    return "\n".join(lines)


def _toml(value: Any) -> str:
    """A JSON value in TOML syntax: tables inline, without unset values."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value)
