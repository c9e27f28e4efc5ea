"""Light of a home in which a door opens: at each time that of a home whose door stands there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.motions import Motion
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.geometry.moving import house_at
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sky_for_house

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="light that moves needs LLVM"
)
RECIPE: Recipe = recipe_from_name("preview", {"light.spp": "4", "light.pilot_spp": "4"})


def home() -> House:
    opens = Motion("door_front", "leaf 1", (0.0, 2.0), ((0.0,), (1.5,)))
    return replace(builtin_home(), motions=(opens,))


def scene_of(house: House) -> LightScene:
    return LightScene.load(house, {}, RECIPE, sky_for_house(RECIPE, house.id))


def picture(scene: LightScene, camera: Camera) -> np.ndarray:
    result = scene.render(camera, "0_0", RECIPE.light, 7)
    return np.concatenate([result.outdoor, result.indoor], -1)


def before_the_door(house: House) -> Camera:
    door = next(item for item in house.items if item.id == "door_front")
    middle = door.bounds.mean(0)
    room = house.rooms[0].polygon.mean(0)
    eye = np.array([room[0], middle[1], room[1]])
    return Camera.look(Intrinsics.from_hfov(64, 48), eye, middle - eye)


def test_light_at_a_time_is_that_of_a_home_that_stands_there() -> None:
    moving = home()
    camera = before_the_door(moving)
    scene = scene_of(moving)
    shut = picture(scene, camera)
    scene.move_to(1.0)
    opened = picture(scene, camera)
    stopped = picture(scene_of(replace(house_at(moving, 1.0), motions=())), camera)
    assert stopped.mean() > 0
    np.testing.assert_allclose(opened, stopped, rtol=1e-4, atol=1e-4 * stopped.max())
    assert np.abs(opened - shut).mean() > 0.02 * shut.mean()
    # At rest again it is what it was.
    scene.move_to(None)
    np.testing.assert_array_equal(picture(scene, camera), shut)


def test_a_lamp_that_moves_is_told() -> None:
    house = home()
    lamp = next(item for item in house.items if item.lights)
    falls = Motion(lamp.id, "", (0.0,), ((0, 0, 0, 1, 0, 0, 0),))
    scene = scene_of(replace(house, motions=(falls,)))
    with pytest.raises(BadHouse, match="lamp that moves"):
        scene.move_to(1.0)
