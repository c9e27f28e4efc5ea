"""The paper's rules held by every winner of real homes, recomputed from their geometry."""

import functools

import pytest

from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, Recipe, recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.sweethome3d import read_home
from pbrs_farm.repair import repair
from tests.example_homes import example_homes
from tests.sample.test_rules import hold_the_rules

pytestmark = pytest.mark.homes
SMALL = {"score_width_px": 160, "score_height_px": 120, "coarse_width_px": 80, "cell_m": 0.4}


@functools.cache
def repaired(name: str) -> House:
    package = example_homes()
    data, file = package.home(name)
    recipe = Recipe()
    house = read_home(data, file, resources=package.resources(), fields=recipe.read)
    return repair(
        house, recipe.repair, occluder_from=lambda some: Caster(geometry_from_house(some))
    )[0]


@pytest.mark.parametrize(
    "name",
    [
        "Studio",
        pytest.param("3BedroomHouseWithAttic", marks=pytest.mark.slow),
        pytest.param("2BedroomApartmentWithBowWindow", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("recipe", ["paper", "fast"])
def test_winners_of_an_example_home_keep_every_rule(name: str, recipe: str) -> None:
    fields: CameraFields = recipe_from_name(recipe).cameras
    fields = fields.model_copy(update={**SMALL, "coarse_height_px": 60})
    assert hold_the_rules(repaired(name), fields, 0) >= 10
