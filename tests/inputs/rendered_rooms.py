"""Rooms with known light, rendered small."""

from __future__ import annotations

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import Sky

RECIPE: Recipe = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "pilot_spp": 0})


def rendered(
    house: House,
    camera: Camera,
    sky: Sky,
    *,
    seed: int = 1,
    recipe: Recipe = RECIPE,
    **fields: object,
) -> LightResult:
    scene = LightScene.load(house, {}, recipe, sky)
    return scene.render(camera, "0_0", FIELDS.model_copy(update=fields), seed)


METROPOLIS: LightFields = FIELDS.model_copy(
    update={
        "integrator": "metropolis",
        "direct_spp": 32,
        "mutations_per_pixel": 128,
        "chains": 2048,
        "pilot_spp": 4,
    }
)
