"""Diffuse light of first surfaces is the incident light, for any surface; shading and residual sum to light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import MachineFailed, RenderFailed
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.develop.mode_pictures import LinearAovs
from pbrs_farm.transport.diffuse_images import ALBEDO, intrinsic_parts, shading_by_group
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import Sky, dark_sky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

RECIPE: Recipe = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(
    update={"filter": "box", "pilot_spp": 0, "spp": 256, "max_depth": 4}
)
SKY = (1.0, 2.0, 3.0)
MIRROR = Material("mirror", MaterialKind.MIRROR)
GLASS = Material("glass", MaterialKind.GLASS, opacity=0.1)


def ground(material: Material, *above: Material) -> House:
    """A sheet below the sky, and others above it."""
    sheets = [
        rooms.quad([(-9, y, 9), (9, y, 9), (9, y, -9), (-9, y, -9)], k)
        for k, y in enumerate((0.0, 0.5)[: 1 + len(above)])
    ]
    return rooms.house(sheets, [material, *above])


def split(house: House, camera: Camera, sky: Sky, fields: LightFields) -> LightResult:
    scene = LightScene.load(house, {}, RECIPE, sky)
    return scene.render(camera, "0_0", fields, 1, splits_diffuse=True)


def shading(result: LightResult) -> dict[Group, np.ndarray]:
    aovs = LinearAovs(result.outdoor, result.indoor, result.albedo, result.normal)
    return shading_by_group(aovs, result.diffuse, denoise=False)


LOOK_DOWN = rooms.camera((0, 2, 2), (0, 0, 0), 4, 4, 0.1)

pytestmark = pytest.mark.skipif(choose_variant().startswith("scalar"), reason="no kernels")


@pytest.mark.parametrize(
    "material",
    [
        rooms.matte("grey", 0.5),
        rooms.matte("red", 0.6, 0.0, 0.0),
        rooms.matte("black", 0.0),
        replace(rooms.matte("varnish", 0.3), specular=(0.7,) * 3, roughness=0.2),
        Material("metal", diffuse=(0.0,) * 3, specular=(0.9, 0.8, 0.5), roughness=0.4),
    ],
    ids=lambda m: m.name,
)
def test_open_ground_of_any_material_has_the_skys_light_as_its_shading(material):
    result = split(ground(material), LOOK_DOWN, uniform_sky(SKY), FIELDS)
    # A white sky's irradiance over pi is its radiance.
    shade = shading(result)
    np.testing.assert_allclose(shade[Group.OUTDOOR].mean((0, 1)), SKY, rtol=0.03)
    assert not shade[Group.INDOOR].any()


def test_the_furnaces_residual_is_its_emission_and_its_shading_the_series():
    house, camera = rooms.furnace(0.5)
    result = split(house, camera, dark_sky(), FIELDS.model_copy(update={"max_depth": 6}))
    shade = shading(result)[Group.INDOOR]
    # Light of up to 5 segments arrives: 1 + 1/2 + ... + 1/16.
    assert (shade @ LUMINANCE).mean() == pytest.approx(1.9375, rel=0.01)
    emission = result.indoor - np.float32(0.5) * shade
    np.testing.assert_allclose(emission @ LUMINANCE, 1.0, rtol=1e-3)


@pytest.mark.parametrize("first", [MIRROR, GLASS], ids=lambda m: m.name)
def test_mirrors_and_glass_and_surfaces_behind_them_have_no_shading(first):
    sheet = ground(rooms.matte("grey", 0.5), first)
    result = split(sheet, LOOK_DOWN, uniform_sky(SKY), FIELDS)
    assert result.outdoor.min() > 0.1
    assert not any(image.any() for image in result.diffuse.values())


@pytest.mark.parametrize("first", [MIRROR, GLASS], ids=lambda m: m.name)
def test_pixels_at_the_edge_of_glass_have_no_shading(first):
    # The sheet ends within the pixels of the middle column, beyond their centres.
    below = rooms.quad([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)], 0)
    above = rooms.quad([(-9, 0.5, 9), (0.05, 0.5, 9), (0.05, 0.5, -9), (-9, 0.5, -9)], 1)
    sheets = rooms.house([below, above], [rooms.matte("grey", 0.5), first])
    camera = rooms.camera((0, 2, 2), (0, 0, 0), 5, 5, 0.8)
    diffuse = split(sheets, camera, uniform_sky(SKY), FIELDS).diffuse[ALBEDO].max(-1)
    assert not diffuse[:, :3].any()
    assert (diffuse[:, 3:] > 0.4).all()


def test_light_is_the_same_as_without_and_is_kept_by_lamp():
    house, camera = rooms.window_room(lumen=800.0)
    fields = FIELDS.model_copy(update={"spp": 8, "groups": "lamps"})
    scene = LightScene.load(house, {}, RECIPE, uniform_sky(SKY))
    plain = scene.render(camera, "0_0", fields, 1)
    split = scene.render(camera, "0_0", fields, 1, splits_diffuse=True)
    assert not plain.diffuse
    # All surfaces are matte and light except the black bulb: paths equal those of the plain render,
    # all light is diffuse.
    for group in ("outdoor", "indoor"):
        np.testing.assert_allclose(getattr(split, group), getattr(plain, group), rtol=2e-3)
    is_matte = (split.diffuse[ALBEDO] > 0.699).all(-1)
    np.testing.assert_allclose(
        split.diffuse["diffuse_indoor"][is_matte], split.indoor[is_matte], rtol=1e-4, atol=1e-6
    )
    (lamp,) = split.lamps
    np.testing.assert_allclose(
        split.diffuse[f"diffuse_lamp{lamp}"], split.diffuse["diffuse_indoor"], rtol=1e-5, atol=1e-7
    )
    assert is_matte.mean() > 0.9


def test_shading_is_refused_if_there_is_none():
    house, camera = rooms.furnace(0.5)
    metropolis = FIELDS.model_copy(update={"integrator": "metropolis"})
    with pytest.raises(RenderFailed, match="shading and residual need `path`"):
        split(house, camera, dark_sky(), metropolis)
    scalar = LightScene.load(house, {}, RECIPE, dark_sky(), variant="scalar_rgb")
    with pytest.raises(MachineFailed, match="shading needs LLVM or CUDA"):
        scalar.render(camera, "0_0", FIELDS, 1, splits_diffuse=True)


def test_albedo_times_shading_plus_residual_is_radiance_within_half_floats():
    rng = np.random.default_rng(3)
    radiance = rng.lognormal(0, 2, (64, 64, 3)).astype(np.float32)
    albedo = rng.random((64, 64, 3)).astype(np.float32)
    light = rng.lognormal(0, 2, (64, 64, 3)).astype(np.float32)
    stored, residual = intrinsic_parts(radiance, albedo, light)
    assert stored.dtype == residual.dtype == np.float16
    again = albedo * stored.astype(np.float64) + residual
    rounding = 1e-6 * (radiance + albedo * stored)  # of float32
    step = np.maximum(np.abs(residual.astype(np.float64)), 2.0**-14) * 2.0**-11
    assert (np.abs(again - radiance) <= step * 1.01 + rounding).all()
