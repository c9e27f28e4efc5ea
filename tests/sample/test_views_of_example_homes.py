"""The paper's rules held by every winner of real homes, recomputed from their geometry."""

import functools

import pytest

from pbrs_farm.core.house import House, ItemKind, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, Recipe, recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import repair
from pbrs_farm.sample.house_sampler import sample_cameras
from tests.example_homes import example_homes
from tests.inputs.camera_rules import assert_rules
from tests.sample.sampled_rooms import IndependentLook

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


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "Studio",
        pytest.param("3BedroomHouseWithAttic", marks=pytest.mark.slow),
        pytest.param("2BedroomApartmentWithBowWindow", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("bounds", [{}, {"max_item_fraction": 0.35, "max_wall_fraction": 0.55}])
def test_winners_of_an_example_home_keep_every_rule(name: str, bounds: dict[str, float]) -> None:
    fields: CameraFields = recipe_from_name("paper").cameras
    fields = fields.model_copy(update={**SMALL, "coarse_height_px": 60, **bounds})
    assert assert_rules(repaired(name), fields, 0) >= 10


def test_photos_of_an_example_home_show_furniture_from_walkable_places() -> None:
    house = repaired("Studio")
    fields: CameraFields = recipe_from_name("fast").cameras
    fields = fields.model_copy(update={**SMALL, "coarse_height_px": 60})
    caster = Caster(geometry_from_house(house))
    sampling = sample_cameras(house, fields, 0, caster.item_counts, caster.item_pictures)
    assert len(sampling.views) >= 8
    look = IndependentLook(house)
    openings = {
        k + 1 for k, i in enumerate(house.items) if i.kind in (ItemKind.DOOR, ItemKind.WINDOW)
    }
    for view in sampling.views:
        room, camera = house.room(view.room_id), view.camera
        look.assert_rules_of_place(room, camera, fields)
        shown = sum(n for k, n in look.pixels(camera).items() if k in openings)
        n_pixels = camera.intrinsics.width_px * camera.intrinsics.height_px
        assert shown <= (fields.max_opening_fraction + 0.01) * n_pixels
