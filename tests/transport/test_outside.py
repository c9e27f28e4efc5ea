"""What lies before the windows is seen as the sky lights it, and lights or darkens nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import LIT, OUTSIDE, House, Item, ItemKind, Material
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.kernels.outside import STREET_LX, STREET_RGB
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

pytestmark = pytest.mark.skipif(
    not choose_variant().startswith("llvm"), reason="the outside needs LLVM"
)

RECIPE: Recipe = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(
    update={"filter": "box", "pilot_spp": 0, "spp": 16, "max_depth": 3}
)
SKY = (1.0, 2.0, 3.0)


def home(*, outside: str = "") -> tuple[House, Camera]:
    """A grey wall with a hole, a floor before it; outside: the name of a board's material behind it."""
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


def test_a_board_outside_has_the_skys_radiance_times_its_colour_and_rooms_keep_their_light() -> (
    None
):
    plain, boarded = light_of(""), light_of("board")
    seen = (plain.outdoor == np.array(SKY, np.float32)).all(-1)  # pixels of the hole alone
    assert 0.05 < seen.mean() < 0.5
    # A matte surface in the middle of an even sky is as bright as that, times its colour.
    albedo = ((0.6 + 0.055) / 1.055) ** 2.4
    street = np.array(STREET_RGB) / (np.array(STREET_RGB) @ LUMINANCE) * STREET_LX / 179 / np.pi
    np.testing.assert_allclose(boarded.outdoor[seen], np.tile(albedo * (np.array(SKY) + street), (int(seen.sum()), 1)), rtol=2e-3)  # fmt: skip
    # The denoiser is told its colour. Wall and floor have the same bits as without it.
    np.testing.assert_allclose(boarded.albedo[seen], albedo, rtol=2e-3)
    inside = ~seen & (np.abs(plain.albedo - plain.albedo[0, 0]).max(-1) < 1e-6)
    assert inside.sum() > 100
    assert (boarded.outdoor[inside] == plain.outdoor[inside]).all()


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
    found, boarded = scene.render(camera, "0_0", FIELDS, 1), light_of("board")
    seen = (light_of("").outdoor == np.array(SKY, np.float32)).all(-1)
    left = seen & (np.arange(32) < 14)
    right = seen & (np.arange(32) >= 18)
    assert min(left.sum(), right.sum()) > 10
    # The left half of every sheet is a hole: the board is there behind all 24, and no shadow of them.
    np.testing.assert_allclose(found.outdoor[left], boarded.outdoor[left], rtol=1e-4)
    assert (found.outdoor[right] < 1e-6).all()
