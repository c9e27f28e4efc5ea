"""Items of clear glass: the foot is as bright as its support, the outline dark."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Material, MaterialKind, Surface
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.dress.thing_materials import CLEAR
from pbrs_farm.geometry.bodies import revolve
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

pytestmark = pytest.mark.skipif(
    not choose_variant().startswith("llvm"), reason="OptiX takes one scene in a kernel"
)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(
    update={"filter": "box", "pilot_spp": 0, "spp": 256, "max_depth": 4}
)
FOOT_M, WHITE = 0.02, 0.7
COLOURLESS = Material("glass", MaterialKind.GLASS, opacity=0.0)


def moved(surface: Surface, by: tuple[float, float, float]) -> Surface:
    """The surface shifted, with the second material."""
    positions = (np.asarray(surface.positions) + by).astype(np.float32)
    return replace(surface, positions=positions, material=1)


def foot_and_table(glass: Material, gap_m: float, at: float) -> tuple[float, float]:
    """(mean radiance of a disc of glass on a white table, of the table beside it), under a white sky.

    gap_m: between disc and table; at: x and z of the disc.
    """
    table = rooms.box((at - 1, -0.1, at - 1), (at + 1, 0.0, at + 1), 0)
    disc = revolve([(0, 0), (FOOT_M, 0), (FOOT_M, 0.003), (0, 0.003)], n=24)
    home = rooms.house([table, moved(disc, (at, gap_m, at))], [rooms.matte("white", WHITE), glass])
    camera = rooms.camera((at, 1.0, at + 1e-3), (at, 0, at), 20, 20, 0.06)
    scene = LightScene.load(home, {}, RECIPE, uniform_sky((1.0, 1.0, 1.0)))
    picture = scene.render(camera, "0_0", FIELDS, 1).outdoor.mean(-1)
    # The picture is 6 cm wide.
    from_middle = np.hypot(*np.meshgrid(*[(np.arange(20) - 9.5) * 0.003] * 2))
    return float(picture[from_middle < 0.012].mean()), float(picture[from_middle > 0.028].mean())


@pytest.mark.parametrize("gap_m", [0.0, 1e-5, 2e-4])
@pytest.mark.parametrize("at", [0.0, 6.0])
def test_a_foot_of_colourless_glass_is_as_bright_as_its_table(gap_m: float, at: float) -> None:
    # It mirrors the equally bright sky with the rest; only light trapped below it is lost.
    foot, table = foot_and_table(COLOURLESS, gap_m, at)
    assert table == pytest.approx(WHITE, rel=0.02)
    assert 0.92 * table < foot < 1.02 * table


def test_a_foot_of_clear_glass_loses_less_than_a_tenth() -> None:
    foot, table = foot_and_table(CLEAR, 0.0, 0.0)
    assert foot > 0.9 * table


def fresnel(cos: F64) -> F64:
    """Reflectance of both faces of a wall of index 1.5."""
    cos_t = np.sqrt(1 - (1 - cos**2) / 2.25)
    s = ((cos - 1.5 * cos_t) / (cos + 1.5 * cos_t)) ** 2
    p = ((1.5 * cos - cos_t) / (1.5 * cos + cos_t)) ** 2
    r = (s + p) / 2
    return np.asarray(2 * r / (1 + r))


@pytest.mark.long
def test_the_outline_of_a_jar_is_darker_than_its_middle_and_both_than_the_wall() -> None:
    # A ball with one thin wall, between a wall and a sky of radiance L: reflected and hidden light
    # are equally bright, so only the colour of the two walls passed is lost.
    ball = rooms.sphere((0, 0, 0), 0.05, 0, n=48)
    home = rooms.house([ball], [CLEAR])
    camera = rooms.camera((0, 0, 2.0), (0, 0, 0), 64, 64, 0.06)
    scene = LightScene.load(home, {}, RECIPE, uniform_sky((1.0, 1.0, 1.0)))
    picture = scene.render(camera, "0_0", FIELDS, 1).outdoor
    kd = ((np.array(CLEAR.diffuse) + 0.055) / 1.055) ** 2.4
    tau = 1 - CLEAR.opacity * (1 - kd)
    pixel_m = 2 * 2.0 * np.tan(0.03) / 64
    offset = np.hypot(*np.meshgrid(*[(np.arange(64) - 31.5) * pixel_m] * 2))
    for low, high in ((0.0, 0.01), (0.03, 0.04), (0.045, 0.048)):
        ring = (offset >= low) & (offset < high)
        cos = np.sqrt(1 - (offset[ring, None] / 0.05) ** 2)
        r = fresnel(cos)
        np.testing.assert_allclose(
            picture[ring].mean(0), (r + (1 - r) * tau ** (2 / cos)).mean(0), rtol=0.02
        )
    middle, outline = (
        picture[offset < 0.01].mean(),
        picture[(offset > 0.045) & (offset < 0.048)].mean(),
    )
    assert outline < 0.95 * middle
    assert middle < 0.97 < picture[offset > 0.053].mean()
