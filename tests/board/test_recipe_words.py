"""The recipe of a root in words of the command line."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from pbrs_farm.board.pages.viewing import RecipeWords, recipe_words
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.store.folder import FolderStore


def test_a_view_shows_its_recipe(client: httpx.Client) -> None:
    assert "<dt>recipe</dt><dd><b>preview</b></dd>" in client.get("/homes/a-1/views/0_0_1").text


def test_a_recipe_is_the_nearest_preset_and_the_differences(tmp_path: Path) -> None:
    recipe = recipe_from_name("paper", {"light.spp": "16", "tone.key": "0.5"})
    (tmp_path / "recipe.json").write_bytes(json_bytes(recipe))
    words = recipe_words(RootReader(FolderStore(tmp_path)))
    assert words == RecipeWords("paper", ("light.spp=16", "tone.key=0.5"))


@pytest.mark.parametrize("data", [None, b"{", b'{"light": 3}', b"[]"])
def test_a_recipe_that_cannot_be_read_is_left_out(data: bytes | None, tmp_path: Path) -> None:
    if data is not None:
        (tmp_path / "recipe.json").write_bytes(data)
    assert recipe_words(RootReader(FolderStore(tmp_path))) is None
