"""Outdoor objects are visible, lit by the sky, and light the rooms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import LIT, OUTSIDE, House, Item, ItemKind, Material
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.kernels.outside import HAZE_M, STREET_LX, STREET_RGB
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import Sky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

pytestmark = pytest.mark.skipif(
    not choose_variant().startswith("llvm"), reason="the outside needs LLVM"
)

RECIPE: Recipe = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(
    update={"filter": "box", "pilot_spp": 0, "spp": 16, "max_depth": 3}
)
SKY = (1.0, 2.0, 3.0)
BOARD = ((0.6 + 0.055) / 1.055) ** 2.4  # albedo of home()'s board


def home(*, outside: str = "") -> tuple[House, Camera]:
    """A grey wall with a hole, and a floor in front; outside: material name of a board behind it."""
    wall = [
        rooms.quad([(-4, 0, 0), (-1, 0, 0), (-1, 3, 0), (-4, 3, 0)], 0),
        rooms.quad([(1, 0, 0), (4, 0, 0), (4, 3, 0), (1, 3, 0)], 0),
    ]
    floor = rooms.quad([(-4, 0, 0), (-4, 0, 4), (4, 0, 4), (4, 0, 0)], 0)
    house = rooms.house([*wall, floor], [rooms.matte("grey", 0.5)])
    if outside:
        rgb = (0.6, 0.6, 0.6)
        board = rooms.quad([(-9, -9, -5), (9, -9, -5), (9, 9, -5), (-9, 9, -5)], 1)
        item = Item("outside_board", "", ItemKind.GROUND, "0", (board,), tags=(OUTSIDE,))
        house = replace(house, items=(*house.items, item), materials=(*house.materials, Material(outside, diffuse=rgb)))  # fmt: skip
    return house, rooms.camera((0, 1.5, 3), (0, 1.0, 0), 32, 24)


def light_of(outside: str) -> LightResult:
    house, camera = home(outside=outside)
    return LightScene.load(house, {}, RECIPE, uniform_sky(SKY)).render(camera, "0_0", FIELDS, 1)


def lit_board(camera: Camera, albedo: float, sky: tuple[float, float, float]) -> F64:
    """(H, W, 3) radiance of home()'s board: under an even sky its albedo times the sky; haze has the sky's radiance."""
    street = np.array(STREET_RGB) / (np.array(STREET_RGB) @ LUMINANCE) * STREET_LX / 179 / np.pi
    _eyes, ways = camera.rays()
    away = 8.0 / np.abs(ways / np.linalg.norm(ways, axis=-1, keepdims=True))[..., 2:]
    clear = np.exp(-((away / HAZE_M) ** 2))
    return np.asarray(clear * albedo * (np.array(sky) + street) + (1 - clear) * np.array(sky))


def test_a_board_outside_has_the_skys_radiance_times_its_colour_and_fades_with_distance() -> None:
    plain, boarded = light_of(""), light_of("board")
    hole = (plain.outdoor == np.array(SKY, np.float32)).all(-1)  # pixels of the hole only
    assert 0.05 < hole.mean() < 0.5
    expected = lit_board(home()[1], BOARD, SKY)
    np.testing.assert_allclose(boarded.outdoor[hole], expected[hole], rtol=3e-3)
    # The denoiser gets its colour as guide.
    np.testing.assert_allclose(boarded.albedo[hole], BOARD, rtol=2e-3)


def test_a_gloss_outside_mirrors_the_sky() -> None:
    house, camera = home(outside="board")
    glossy = replace(house.materials[-1], specular=(0.5, 0.5, 0.5), shininess=2000.0)
    polished = replace(house, materials=(*house.materials[:-1], glossy))
    fields = FIELDS.model_copy(update={"spp": 4})
    matte, gloss = (
        LightScene.load(h, {}, RECIPE, uniform_sky(SKY)).render(camera, "0_0", fields, 1).outdoor
        for h in (house, polished)
    )
    # A downward ray is mirrored down by the board: a street is darker than the sky.
    _eyes, ways = camera.rays()
    ways = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
    t = 1 - np.abs(ways[..., 2:])
    coat = 0.04 + 0.96 * t**5
    clear = np.exp(-((8.0 / np.abs(ways[..., 2:]) / HAZE_M) ** 2))
    low = (light_of("").outdoor == np.array(SKY, np.float32)).all(-1) & (ways[..., 1] < -0.02)
    assert low.sum() > 50
    unhazed = lit_board(camera, BOARD, SKY) - (1 - clear) * np.array(SKY)
    gained = coat * (clear * 0.3 * np.array(SKY) - unhazed)
    np.testing.assert_allclose((gloss - matte)[low], gained[low], rtol=0.02, atol=2e-4)


def enclosed(board: str, sky: Sky) -> tuple[float, float]:
    """Mean radiance of a room whose window is filled by a board, and by the sky."""
    bare, _camera = rooms.window_room(0.5)
    camera = rooms.camera((2.0, 1.5, 1.0), (2.0, 0.5, 3.9))
    x0, x1, y0, y1, z = -400.0, 400.0, -400.0, 400.0, -3.0
    sheet = rooms.quad([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], len(bare.materials))
    item = Item("outside_board", "", ItemKind.GROUND, "0", (sheet,), tags=(OUTSIDE,))
    material = Material(board, diffuse=(0.6, 0.6, 0.6))
    house = replace(bare, items=(*bare.items, item), materials=(*bare.materials, material))
    fields = FIELDS.model_copy(update={"spp": 256})
    with_board, open_sky = (
        float(LightScene.load(h, {}, RECIPE, sky).render(camera, "0_0", fields, 1).outdoor.mean())
        for h in (house, bare)
    )
    return with_board, open_sky


def test_a_room_is_lit_by_its_view_outside() -> None:
    with_board, open_sky = enclosed("board", uniform_sky((1.0, 1.0, 1.0)))
    # The board is three metres away, farther for grazing rays: haze adds a little.
    assert BOARD * 0.98 < with_board / open_sky < BOARD * 1.15


def test_an_object_before_the_sun_shades_it() -> None:
    sun = np.array([0.0, 0.4, -1.0]) / np.hypot(0.4, 1.0)  # into the window
    sky = replace(uniform_sky((0.0, 0.0, 0.0)), sun_direction=sun, sun_irradiance=np.full(3, 100.0))
    with_board, open_sky = enclosed("board", sky)
    # Only street lamps remain, which the sky hides by day.
    street = STREET_LX / 179 * BOARD
    assert open_sky > 0.5
    assert with_board < street


def test_windows_across_the_street_shine_by_themselves() -> None:
    dim, bright = light_of("board"), light_of(f"{LIT} 0")
    gained = (bright.outdoor - dim.outdoor).reshape(-1, 3).max(0)
    np.testing.assert_allclose(gained, 45.0 / 179.0, rtol=0.02)


def test_leaves_outside_are_seen_through_between_them() -> None:
    house, camera = home(outside="board")
    alpha = np.full((8, 8, 4), 255, np.uint8)
    alpha[:, :4, 3] = 0
    leaf = Material("leaf", texture_id="leaf", alpha_cutout=True, diffuse=(0, 0, 0))
    corners = [(-9, -9), (9, -9), (9, 9), (-9, 9)]
    sheets = tuple(rooms.quad([(x, y, -1 - 0.1 * k) for x, y in corners], 2) for k in range(24))
    tree = Item("outside_tree", "", ItemKind.PLANT, "0", sheets, tags=(OUTSIDE,))
    green = replace(house, items=(*house.items, tree), materials=(*house.materials, leaf))
    scene = LightScene.load(green, {"leaf": alpha}, RECIPE, uniform_sky(SKY))
    leafy, boarded = scene.render(camera, "0_0", FIELDS, 1), light_of("board")
    hole = (light_of("").outdoor == np.array(SKY, np.float32)).all(-1)
    left_half = hole & (np.arange(32) < 14)
    right = hole & (np.arange(32) >= 18)
    assert min(left_half.sum(), right.sum()) > 10
    # The left half of every sheet is a hole: the board is visible behind all 24, without their
    # shadow.
    np.testing.assert_allclose(leafy.outdoor[left_half], boarded.outdoor[left_half], rtol=1e-4)
    assert (leafy.outdoor[right] < 0.01 * np.array(SKY)).all()  # leaves are black except for haze
