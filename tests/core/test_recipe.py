"""Every number of a recipe has two bounds, and old recipes remain valid."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import RECIPE_NAMES, Recipe, recipe_from_json, recipe_from_name


def _numbers(schema: dict[str, Any], place: str, definitions: dict[str, Any]) -> Iterator[Any]:
    """(place, schema) of every number below a JSON schema."""
    schema = schema | definitions.get(schema.get("$ref", "").rpartition("/")[2], {})
    for name, inner in schema.get("properties", {}).items():
        yield from _numbers(inner, f"{place}.{name}", definitions)
    for inner in schema.get("prefixItems", []):
        yield from _numbers(inner, place, definitions)
    if schema.get("type") in ("integer", "number") and "enum" not in schema:
        yield place, schema


def test_every_number_of_a_recipe_has_a_lower_and_an_upper_bound():
    schema = Recipe.model_json_schema()
    ranges = dict(_numbers(schema, "", schema["$defs"]))
    assert len(ranges) > 60
    for place, number in ranges.items():
        assert {"maximum", "exclusiveMaximum"} & set(number), place
        assert {"minimum", "exclusiveMinimum"} & set(number), place


@pytest.mark.parametrize(
    "setting",
    ["light.spp=1e12", "light.chains=1000000000", "cameras.n_sectors=1000000000", "seed=1e30",
     "cameras.score_width_px=1000000", "raster.samples=1000000000", "image.width_px=1e12",
     "cameras.per_sector=1000000000", "repair.default_wall_rgb=[9,9,9]", "light.max_spp=1e12"],
)  # fmt: skip
def test_a_recipe_that_would_never_end_is_refused(setting):
    path, _, text = setting.partition("=")
    with pytest.raises(BadRecipe):
        recipe_from_name("fast", {path: text})


def test_a_picture_beyond_memory_is_refused_and_a_large_one_is_accepted():
    edge = {"image.width_px": "16384", "image.height_px": "16384"}
    with pytest.raises(BadRecipe, match="pixels"):
        recipe_from_name("fast", edge)
    recipe_from_name("fast", edge | {"image.height_px": "8192"})


@pytest.mark.parametrize("name", RECIPE_NAMES)
def test_a_stored_recipe_reads_back_and_a_damaged_one_names_its_place(name):
    recipe = recipe_from_name(name)
    assert recipe_from_json(recipe.model_dump_json().encode(), "here") == recipe
    with pytest.raises(BadRecipe, match="here"):
        recipe_from_json(b'{"light": 1}', "here")


def test_a_lens_changes_the_digest_of_cameras():
    plain, bent = recipe_from_name("fast"), recipe_from_name("fast", {"lens.preset": "kinect"})
    assert bent.digest("cameras", "lens") != plain.digest("cameras", "lens")
    assert bent.digest("cameras") == plain.digest("cameras")
    # A stored recipe without a lens is a pinhole.
    without = plain.model_dump(mode="json")
    del without["lens"]
    assert Recipe.model_validate(without) == plain


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"lens.model": "radtan", "lens.k1": "-1.5"}, "the distortion folds the picture"),
        ({"lens.model": "cubemap"}, "image.width_px=1536"),
        ({"lens.preset": "tum_vi"}, "image.width_px=512"),
        ({"lens.preset": "gopro"}, "lens.preset"),
    ],
)
def test_an_invalid_lens_is_refused_in_one_line(settings, words):
    with pytest.raises(BadRecipe, match=words) as error:
        recipe_from_name("fast", settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("settings", "hfov_deg", "score_px"),
    [
        # 60 degrees horizontally, according to Roberts et al. 2021; 86 for a D455, by its data
        # sheet.
        ({"lens.preset": "hypersim"}, 60.0, (640, 480)),
        ({"lens.preset": "d455", "image.width_px": "424"}, 86.0, (640, 362)),
    ],
)
def test_views_are_chosen_by_the_field_of_view_of_the_lens(settings, hfov_deg, score_px):
    judged = recipe_from_name("preview", settings | {"cameras.hfov_rad": "1.5"}).judged_cameras
    assert math.degrees(judged.hfov_rad) == pytest.approx(hfov_deg, abs=0.1)
    assert (judged.score_width_px, judged.score_height_px) == score_px
    assert judged.hfov_spread == 0


@pytest.mark.parametrize("lens", [{}, {"lens.model": "radtan", "lens.k1": "-0.1"}])
def test_views_of_a_lens_without_a_focal_length_are_chosen_by_its_rays(lens):
    recipe = recipe_from_name("preview", lens)
    assert recipe.judged_cameras == recipe.cameras
