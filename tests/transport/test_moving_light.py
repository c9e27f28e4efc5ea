"""Light of a home with an opening door equals, at each time, that of a home with the door in that pose."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera, CameraBlur, Intrinsics
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.motions import Motion
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.geometry.moving import house_at
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.sample_passes import MOST_PARTS, SampledView, parts_of_shutter
from pbrs_farm.transport.scene_tables.sky import sky_for_house, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

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


@pytest.mark.long
def test_light_at_a_time_equals_that_of_a_home_in_that_pose() -> None:
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
    # Back at rest the light is as before.
    scene.move_to(None)
    np.testing.assert_array_equal(picture(scene, camera), shut)


def test_a_moving_lamp_is_reported() -> None:
    house = home()
    lamp = next(item for item in house.items if item.lights)
    falls = Motion(lamp.id, "", (0.0,), ((0, 0, 0, 1, 0, 0, 0),))
    scene = scene_of(replace(house, motions=(falls,)))
    with pytest.raises(BadHouse, match="moving lamp"):
        scene.move_to(1.0)


FOCAL_PX = 48 / math.tan(0.3)
SHUTTER_S = 0.5


def panel_that_moves() -> tuple[House, Camera]:
    """A black panel 2 m from a camera, moving to the right at .4 m/s in front of a white wall."""
    wall = rooms.quad([(-9, -9, -0.5), (9, -9, -0.5), (9, 9, -0.5), (-9, 9, -0.5)], 1)
    panel = rooms.quad([(-9, -9, 0), (0, -9, 0), (0, 9, 0), (-9, 9, 0)], 0)
    item = Item("panel", "panel", ItemKind.WALL, "0", (panel,), room_id="0_0")
    paints = [rooms.matte("black", 0.0), rooms.matte("white", 0.8)]
    house = rooms.house([wall], paints, lamps=[item])
    moves = Motion("panel", "", (0.0, 2.0), ((0, 0, 0, 1, 0, 0, 0), (0.8, 0, 0, 1, 0, 0, 0)))
    return replace(house, motions=(moves,)), rooms.camera((0.4, 0, 2), (0.4, 0, 0), 96, 8, 0.6)


def albedo_rows(scene: LightScene, camera: Camera, spp: int, shutter_s: float = 0.0) -> np.ndarray:
    update = {"filter": "box", "pilot_spp": 0, "spp": spp}
    fields = RECIPE.light.model_copy(update=update)
    result = scene.render(camera, "0_0", fields, 1, shutter_s=shutter_s)
    return np.asarray(result.albedo[..., 0].mean(0))


def test_an_item_moving_during_the_shutter_is_blurred_about_its_middle() -> None:
    house, camera = panel_that_moves()
    scene = LightScene.load(house, {}, RECIPE, uniform_sky(1.0))
    scene.move_to(1.0)
    blurred = albedo_rows(scene, replace(camera, blur=CameraBlur()), 64, SHUTTER_S)
    # At 1 s the edge is at .4 m, the picture's middle, and moves .2 m while the shutter is open: a
    # column is dark for as long as the panel covers it.
    width = FOCAL_PX * 0.4 * SHUTTER_S / 2
    expected = 0.8 * np.clip((np.arange(96) + 0.5 - 48) / width + 0.5, 0, 1)
    assert np.abs(blurred - expected).max() < 0.06
    # Sixteen instants: the mean of many sharp pictures over the shutter time.
    sharp = []
    for k in range(32):
        scene.move_to(1.0 + SHUTTER_S * ((k + 0.5) / 32 - 0.5))
        sharp.append(albedo_rows(scene, replace(camera, blur=CameraBlur()), 4))
    assert np.abs(blurred - np.mean(sharp, axis=0)).max() < 0.06
    assert np.abs(blurred - sharp[16]).max() > 0.3


def test_a_camera_that_follows_an_item_sees_it_sharp() -> None:
    house, camera = panel_that_moves()
    scene = LightScene.load(house, {}, RECIPE, uniform_sky(1.0))
    scene.move_to(1.0)
    along = CameraBlur(velocity_m=(0.4 * SHUTTER_S, 0.0, 0.0))
    rows = albedo_rows(scene, replace(camera, blur=along), 64, SHUTTER_S)
    # Within each of 16 instants only the camera moves, by a sixteenth of 14.5 px.
    assert ((rows > 0.05) & (rows < 0.75)).sum() <= 2


def test_the_scene_is_at_its_time_after_a_blurred_picture() -> None:
    house, camera = panel_that_moves()
    scene = LightScene.load(house, {}, RECIPE, uniform_sky(1.0))
    scene.move_to(1.0)
    before = albedo_rows(scene, camera, 4)
    albedo_rows(scene, replace(camera, blur=CameraBlur()), 4, SHUTTER_S)
    np.testing.assert_array_equal(albedo_rows(scene, camera, 4), before)


@pytest.mark.parametrize("spp", [1, 2, 10, 28, 50, 64])
def test_any_number_of_samples_is_spread_over_the_shutters_time(spp: int) -> None:
    moved: list[float] = []
    fields = RECIPE.light.model_copy(update={"spp": spp})
    camera = replace(panel_that_moves()[1], blur=CameraBlur())
    view = SampledView(None, None, camera, fields, 1, move=moved.append)  # type: ignore[arg-type]
    whole = list(parts_of_shutter(view, 0, spp))
    assert sum(n for _first, n, _camera in whole) == spp
    assert len(whole) <= MOST_PARTS
    # Each interval is proportional to its samples, and items have the pose of its middle.
    parts = sorted(
        (middle, n / spp, c.blur.open_share)
        for middle, (_first, n, c) in zip(moved, whole, strict=True)
        if c.blur is not None
    )
    ends = np.cumsum([share for _middle, share, _open in parts])
    np.testing.assert_allclose([p[2] for p in parts], [p[1] for p in parts])
    np.testing.assert_allclose([p[0] for p in parts], ends - [0.5 * p[1] for p in parts])
    # With other launch sizes each sample has the same interval.
    moved_before, moved[:] = list(moved), []
    pieces = [p for k in range(0, spp, 3) for p in parts_of_shutter(view, k, min(3, spp - k))]
    by_sample = [m for m, (_f, n, _c) in zip(moved, pieces, strict=True) for _ in range(n)]
    expected = [m for m, (_f, n, _c) in zip(moved_before, whole, strict=True) for _ in range(n)]
    assert by_sample == expected
