"""Roughness and normal maps in the light: closed forms, energy, and Mitsuba's plugins."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.raycast.variant import choose_variant, mitsuba
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scalar_scene import ScalarScene
from pbrs_farm.transport.scene_tables.scene_tables import tables_from_house
from pbrs_farm.transport.scene_tables.sky import Sky, dark_sky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from pbrs_farm.transport.validation.known_rooms import furnace
from tests.inputs.bumpy_coats import Picture, waves, with_material
from tests.inputs.rendered_rooms import FIELDS, METROPOLIS, RECIPE

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

FLAT: Picture = np.full((4, 4, 3), (128, 128, 255), np.uint8)


def one_normal(x: float, y: float) -> Picture:
    """A normal map with the same normal everywhere."""
    normal = np.array([x, y, math.sqrt(1 - x * x - y * y)])
    return np.full((2, 2, 3), np.round((normal + 1) * 127.5), np.uint8)


def floor(
    uvs: np.ndarray | None = None, *, scale: float = 1.0, albedo: float = 0.5
) -> tuple[House, Camera]:
    """A wide floor with a normal map, u along x and v along -z, seen from above."""
    surface = rooms.quad([(-50, 0, 50), (50, 0, 50), (50, 0, -50), (-50, 0, -50)], 0)
    if uvs is not None:
        surface = replace(surface, uvs=uvs.astype(np.float32))
    material = replace(rooms.matte("floor", albedo), normal_texture_id="n", normal_scale=scale)
    return rooms.house([surface], [material]), rooms.camera((0, 2, 0.01), (0, 0, 0), 8, 8, 0.3)


def sun(direction: tuple[float, float, float]) -> Sky:
    """A sky with only a sun of irradiance 1."""
    d = np.array(direction) / np.linalg.norm(direction)
    dark = dark_sky()
    return replace(dark, sun_direction=d, sun_irradiance=np.ones(3))


def mean_outdoor(house: House, camera: Camera, maps: dict[str, Picture], sky: Sky) -> float:
    scene = LightScene.load(house, maps, RECIPE, sky)
    fields = FIELDS.model_copy(update={"spp": 512, "max_depth": 2})
    return float((scene.render(camera, "0_0", fields, 1).outdoor @ LUMINANCE).mean())


UPRIGHT = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
TURNED = np.array([[0, 0], [0, 1], [-1, 1], [-1, 0]])  # u points along world -v
MIRRORED = UPRIGHT * [-1, 1]


@pytest.mark.parametrize(
    ("uvs", "x_axis", "y_axis"),
    [
        (UPRIGHT, (1, 0, 0), (0, 0, -1)),
        (TURNED, (0, 0, 1), (1, 0, 0)),
        (MIRRORED, (-1, 0, 0), (0, 0, -1)),
    ],
)
@pytest.mark.parametrize("bent", [(0.5, 0.0), (0.0, 0.5)])
def test_a_tilted_normal_receives_the_sun_by_its_cosine(
    uvs: np.ndarray, x_axis: tuple[float, ...], y_axis: tuple[float, ...], bent: tuple[float, float]
) -> None:
    house, camera = floor(uvs)
    for towards in ((0.6, 1, 0.2), (-0.3, 1, 0.5)):
        sky = sun(towards)
        x, y = bent
        normal = x * np.array(x_axis) + y * np.array(y_axis)
        normal = normal + math.sqrt(1 - x * x - y * y) * np.array([0, 1, 0])
        expected = 0.5 / math.pi * float(normal @ sky.sun_direction)
        got = mean_outdoor(house, camera, {"n": one_normal(x, y)}, sky)
        assert got == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
def test_a_tilted_normal_under_a_uniform_sky_sees_its_share(degrees: float) -> None:
    # A plane tilted by t sees a share (1 + cos t) / 2 of the sky above the horizon.
    house, camera = floor()
    maps = {"n": one_normal(math.sin(math.radians(degrees)), 0)}
    got = mean_outdoor(house, camera, maps, uniform_sky((1, 1, 1)))
    assert got == pytest.approx(0.5 * (1 + math.cos(math.radians(degrees))) / 2, rel=0.02)


def test_the_scale_flattens_the_map_and_no_texture_coordinates_switch_it_off() -> None:
    sky, maps = sun((0.6, 1, 0.2)), {"n": one_normal(0.5, 0)}
    plain = mean_outdoor(*floor(), {}, sky)
    assert mean_outdoor(*floor(scale=0), maps, sky) == pytest.approx(plain, rel=0.005)
    assert mean_outdoor(*floor(0 * UPRIGHT), maps, sky) == pytest.approx(plain, rel=1e-5)
    assert mean_outdoor(*floor(), maps, sky) > 1.1 * plain


@pytest.mark.quick(1)
@pytest.mark.parametrize("roughness", [None, 0.3, 1.0])
def test_a_furnace_is_unchanged_by_a_flat_map_and_gains_nothing_by_bumps(
    roughness: float | None,
) -> None:
    means = {}
    for name, picture in (("none", None), ("flat", FLAT), ("bumps", waves(0.5))):
        house, camera = furnace(0.8)
        house = with_material(
            house, normal_texture_id="n" if picture is not None else None, roughness=roughness
        )
        scene = LightScene.load(
            house, {} if picture is None else {"n": picture}, RECIPE, dark_sky()
        )
        fields = FIELDS.model_copy(update={"spp": 512, "max_depth": 12})
        luminance = scene.render(camera, "0_0", fields, 1).indoor @ LUMINANCE
        means[name] = float(luminance.mean())
    series = sum(0.8**k for k in range(12))
    if roughness is None:
        assert means["none"] == pytest.approx(series, rel=0.005)
    assert means["flat"] == pytest.approx(means["none"], rel=0.01)
    assert 0.75 * means["none"] < means["bumps"] < 1.002 * means["none"]


def mapped_room(**changes: object) -> tuple[House, Camera]:
    """The window room with a bulb, whose walls and table have maps."""
    house, camera = rooms.window_room(0.6, lumen=800)
    maps = {"normal_texture_id": "n", "roughness_texture_id": "r"} | changes
    return with_material(house, **maps), camera


MAPS = {"n": waves(0.35), "r": np.tile(np.linspace(60, 255, 32).astype(np.uint8)[:, None, None], (1, 32, 3))}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("group", list(Group))
def test_bumpy_matte_walls_agree_with_mitsubas_normalmap(group: Group) -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs. Two segments:
    # below the horizon of a bump Mitsuba sees black, ours its rim (bend_normal).
    house, camera = mapped_room(roughness_texture_id=None)
    camera = rooms.camera((2.0, 2.3, 2.6), (2.0, 0.0, 2.0), 32, 24, 0.8)
    scene = LightScene.load(house, MAPS, RECIPE, uniform_sky((1, 1, 1)))
    scalar = ScalarScene(tables_from_house(house, MAPS, RECIPE), scene.sky, scene.variant)
    fields = FIELDS.model_copy(update={"spp": 256, "pilot_spp": 4, "max_depth": 2})
    ours = [blocks(scene.render(camera, "0_0", fields, k).group(group)) for k in range(4)]
    theirs = [blocks(scalar.render(camera, group, fields, 100 + k)) for k in range(4)]
    assert np.abs(z_scores(ours, theirs)).max() < 4.5
    assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=0.02)
    # The bumps have an effect: without them the picture differs.
    plain = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    flat = [blocks(plain.render(camera, "0_0", fields, k).group(group)) for k in range(4)]
    assert np.abs(z_scores(ours, flat)).max() > 20


@pytest.mark.long
def test_bumpy_metal_of_mapped_roughness_agrees_with_mitsubas_roughconductor() -> None:
    # Mitsuba's shadowing and masking are uncorrelated, ours are correlated: brighter at grazing
    # angles.
    metal = {"diffuse": (0.0, 0.0, 0.0), "specular": (1.0, 1.0, 1.0), "roughness": 0.8}
    house, _camera = mapped_room(**metal)
    camera = rooms.camera((2.0, 2.3, 2.6), (2.0, 0.0, 2.0), 32, 24, 0.8)
    scene = LightScene.load(house, MAPS, RECIPE, uniform_sky((1, 1, 1)))
    scalar = ScalarScene(tables_from_house(house, MAPS, RECIPE), scene.sky, scene.variant)
    fields = FIELDS.model_copy(update={"spp": 512, "pilot_spp": 4, "max_depth": 2})
    ours = np.mean([blocks(scene.render(camera, "0_0", fields, k).indoor) for k in range(4)], 0)
    theirs = np.mean([blocks(scalar.render(camera, Group.INDOOR, fields, k)) for k in range(4)], 0)
    np.testing.assert_allclose(ours, theirs, rtol=0.08)
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.02)


@pytest.mark.parametrize("alpha", [0.1, 0.4, 1.0])
def test_the_metal_lobe_is_mitsubas_roughconductor_but_for_joint_shadowing(alpha: float) -> None:
    mi = mitsuba()
    from pbrs_farm.transport.kernels.bsdf import Bsdf, evaluate_bsdf

    rng = np.random.default_rng(0)
    wi, wo = (rng.normal(size=(3, 512)) for _ in range(2))
    wi, wo = (np.concatenate([w[:2], np.abs(w[2:]) + 0.02]) for w in (wi, wo))
    wi, wo = (w / np.linalg.norm(w, axis=0) for w in (wi, wo))
    bsdf = Bsdf(mi.Color3f(0), mi.Color3f(1), mi.Color3f(0), mi.Float(alpha), mi.UInt32(0))
    ours, _pdf = evaluate_bsdf(bsdf, mi.Vector3f(wi), mi.Vector3f(wo))
    plugin = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(wi)
    theirs = mi.load_dict(plugin).eval(mi.BSDFContext(), si, mi.Vector3f(wo))
    # Ours is G2 = 1 / (1 + a + b), theirs 1 / ((1 + a)(1 + b)) (Heitz 2014, section 5.3).
    a, b = (0.5 * (np.sqrt(1 + alpha**2 * (1 - w[2] ** 2) / w[2] ** 2) - 1) for w in (wi, wo))
    joint = (1 + a) * (1 + b) / (1 + a + b)
    np.testing.assert_allclose(ours[0].numpy(), theirs[0].numpy() * joint, rtol=2e-3, atol=1e-6)


@pytest.mark.slow
def test_metropolis_and_path_have_the_same_mean_on_bumpy_coats() -> None:
    # Significance: 16 blocks of each group, |z| < 5: missed by chance once in 50,000 runs.
    house, camera = mapped_room(roughness=0.8)
    scene = LightScene.load(house, MAPS, RECIPE, uniform_sky((1, 1, 1)))
    camera = camera.with_size(32, 24)
    plain: LightFields = FIELDS.model_copy(update={"spp": 256, "pilot_spp": 4})
    paths = [scene.render(camera, "0_0", plain, 10 + k) for k in range(4)]
    chains = [scene.render(camera, "0_0", METROPOLIS, 50 + k) for k in range(4)]
    for group in Group:
        ours = [blocks(r.group(group)) for r in chains]
        theirs = [blocks(r.group(group)) for r in paths]
        assert np.abs(z_scores(ours, theirs)).max() < 5
        assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=0.05)


def test_all_houses_with_maps_share_their_kernels() -> None:
    import drjit as dr

    first, camera = mapped_room()
    LightScene.load(first, MAPS, RECIPE, uniform_sky((1, 1, 1))).render(
        camera, "0_0", RECIPE.light, 1
    )
    mapped, _camera = mapped_room(roughness=0.5, normal_texture_id=None)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        scene = LightScene.load(mapped, MAPS, RECIPE, uniform_sky((0.5, 1, 1)))
        scene.render(camera, "0_0", RECIPE.light, 2)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert kernels
    assert all(k["cache_hit"] for k in kernels)
    assert len(scene.tables.texels) == 1  # the device alone keeps them
