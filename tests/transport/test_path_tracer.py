"""Path tracing: closed forms, exact facts, and comparison with Mitsuba's integrator."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.cutouts import CutOut
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.house import NOTHING_LEFT, House, Material, MaterialKind, geometry_from_house
from pbrs_farm.core.lighting import Group, Mode
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.raycast.variant import choose_variant, mitsuba
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scalar_scene import ScalarScene
from pbrs_farm.transport.scene_tables.material_rows import FIRST_TEXEL, material_rows
from pbrs_farm.transport.scene_tables.sky import dark_sky, sunsky, uniform_sky
from pbrs_farm.transport.scene_tables.texture_atlas import texture_atlas
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from pbrs_farm.transport.validation.known_rooms import furnace
from pbrs_farm.truth.surface_layers import albedo_label
from tests.inputs.rendered_rooms import FIELDS, RECIPE, rendered

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)


@pytest.mark.parametrize("albedo", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("depth", [1, 2, 5, 12])
def test_a_furnace_room_has_the_radiance_of_the_geometric_series(albedo: float, depth: int) -> None:
    house, camera = furnace(albedo)
    result = rendered(house, camera, dark_sky(), spp=256, max_depth=depth)
    expected = sum(albedo**k for k in range(depth))
    luminance = result.indoor @ LUMINANCE
    error = max(float(luminance.std()) / math.sqrt(luminance.size), 1e-6)
    assert abs(float(luminance.mean()) - expected) < 4 * error
    assert not result.outdoor.any()
    assert result.n_nonfinite == 0


def test_a_floor_under_a_uniform_sky_reflects_its_albedo() -> None:
    floor = rooms.quad([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], 0)
    house = rooms.house([floor], [rooms.matte("floor", 0.2, 0.5, 0.8)])
    result = rendered(house, rooms.camera((0, 1, 3), (0, 0, 0)), uniform_sky((1, 2, 3)), spp=256)
    np.testing.assert_allclose(result.outdoor[14:].mean((0, 1)), [0.2, 1.0, 2.4], rtol=2e-3)
    np.testing.assert_allclose(result.outdoor[0, 0], [1, 2, 3], rtol=1e-5)


@pytest.mark.parametrize("x", [0.0, 1.0, 2.0])
def test_a_bulb_lights_a_floor_by_its_flux_and_the_cube_of_the_cosine(x: float) -> None:
    floor = rooms.quad([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], 0)
    house = rooms.house(
        [floor], [rooms.matte("floor", 0.5), rooms.BULB], lamps=[rooms.bulb((0, 1, 0), 1, 1000.0)]
    )
    camera = rooms.camera((x + 0.5, 0.3, 0), (x, 0, 0), 8, 8, 0.01)
    luminance = rendered(house, camera, dark_sky(), spp=1024).indoor @ LUMINANCE
    lux = 1000.0 / (4 * math.pi) / (1 + x * x) ** 1.5
    assert float(luminance.mean()) == pytest.approx(0.5 / math.pi * lux / 179, rel=0.01)


def test_a_bulb_a_hand_from_the_ceiling_does_not_shadow_itself() -> None:
    # The shadow ray starts off its surface; it must still end before the bulb.
    ceiling = rooms.quad([(-9, 1, -9), (-9, 1, 9), (9, 1, 9), (9, 1, -9)], 0)
    bulb = rooms.bulb((0, 0.7, 0), 1, 1000.0)
    house = rooms.house([ceiling], [rooms.matte("ceiling", 0.5), rooms.BULB], lamps=[bulb])
    camera = rooms.camera((0.3, 0.5, 0.6), (0, 1, 0.6), 8, 8, 0.01)
    luminance = rendered(house, camera, dark_sky(), spp=2048).indoor @ LUMINANCE
    d2 = 0.3**2 + 0.6**2
    lux = 1000.0 / (4 * math.pi * d2) * 0.3 / math.sqrt(d2)
    assert float(luminance.mean()) == pytest.approx(0.5 / math.pi * lux / 179, rel=0.01)


def test_a_sealed_room_under_a_bright_sky_is_exactly_black() -> None:
    house = rooms.house(rooms.shell((4, 2.5, 4), 0), [rooms.matte("wall", 0.9)])
    sky = sunsky(RECIPE, elevation_rad=0.8, azimuth_rad=0.4)
    result = rendered(house, rooms.camera((0.5, 1.5, 0.5), (3.9, 0.2, 3.9)), sky, spp=64)
    assert not result.outdoor.any()
    assert not result.indoor.any()
    assert result.noise == {"outdoor": 0.0, "indoor": 0.0, "sum": 0.0}


def test_a_pane_that_is_not_seen_changes_neither_radiance_nor_noise() -> None:
    sky = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.3)
    house, _camera = rooms.window_room()
    glazed, _camera = rooms.window_room(pane=True)
    camera = rooms.camera((2.0, 1.5, 1.0), (2.0, 0.5, 3.9))
    a, b = rendered(house, camera, sky, spp=16), rendered(glazed, camera, sky, spp=16)
    np.testing.assert_array_equal(a.outdoor, b.outdoor)
    assert a.noise == b.noise


def test_the_same_seed_gives_the_same_bits_and_another_does_not() -> None:
    house, camera = rooms.window_room(lumen=800)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    a, b, c = (scene.render(camera, "0_0", RECIPE.light, seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(a.outdoor, b.outdoor)
    np.testing.assert_array_equal(a.indoor, b.indoor)
    assert (a.indoor != c.indoor).any()


def test_modes_are_exact_sums_of_groups() -> None:
    house, camera = rooms.window_room(lumen=800)
    result = rendered(house, camera, uniform_sky((1, 1, 1)), spp=4)
    np.testing.assert_array_equal(result.mode(Mode.MLT_OL), result.outdoor)
    np.testing.assert_array_equal(result.mode(Mode.MLT_IL_OL), result.outdoor + result.indoor)


def test_twice_the_emitters_give_twice_the_radiance() -> None:
    house, camera = rooms.window_room(lumen=800)
    bright, _camera = rooms.window_room(lumen=1600)
    a = rendered(house, camera, uniform_sky((1, 1, 1)), spp=8)
    b = rendered(bright, camera, uniform_sky((2, 2, 2)), spp=8)
    np.testing.assert_allclose(b.outdoor, 2 * a.outdoor, rtol=1e-5)
    np.testing.assert_allclose(b.indoor, 2 * a.indoor, rtol=1e-5)


def test_each_group_holds_only_its_light() -> None:
    house, camera = rooms.window_room(lumen=800)
    together = rendered(house, camera, uniform_sky((1, 1, 1)), spp=8)
    lamps = rendered(house, camera, dark_sky(), spp=8)
    dark, _camera = rooms.window_room()
    day = rendered(dark, camera, uniform_sky((1, 1, 1)), spp=8)
    assert not lamps.outdoor.any()
    assert not day.indoor.any()
    # The bulb's body blocks some daylight, so only the lamps' group has equal bits.
    np.testing.assert_array_equal(lamps.indoor, together.indoor)


@pytest.mark.parametrize("group", list(Group))
def test_pictures_agree_with_mitsubas_path_integrator(group: Group) -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    house, camera = rooms.window_room(0.6, lumen=800)
    sky = sunsky(RECIPE, elevation_rad=0.7, azimuth_rad=2.0)
    scene = LightScene.load(house, {}, RECIPE, replace(sky, sun_irradiance=np.zeros(3)))
    scalar = ScalarScene(scene.tables, scene.sky, scene.variant)
    fields = FIELDS.model_copy(update={"spp": 128, "pilot_spp": 4})
    ours = [blocks(scene.render(camera, "0_0", fields, k).group(group)) for k in range(4)]
    theirs = [blocks(scalar.render(camera, group, fields, 100 + k)) for k in range(4)]
    assert np.abs(z_scores(ours, theirs)).max() < 4.5
    assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=0.03)


def test_weights_of_the_pilot_keep_the_mean_and_reduce_the_noise() -> None:
    # Twelve lamps close behind a wall and one in the room: without the pilot, by place or not, most
    # shadow rays end at the wall.
    house, camera = rooms.window_room(lumen=800)
    far = [rooms.bulb((0.9 + 0.2 * k, 2.2, 4.3), 1, 800.0) for k in range(12)]
    house = house.with_items([*house.items, *far])
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    means = {}
    noise = {}
    for pilot_spp in (0, 4):
        fields = FIELDS.model_copy(update={"spp": 32, "pilot_spp": pilot_spp})
        results = [scene.render(camera, "0_0", fields, 10 + k) for k in range(4)]
        means[pilot_spp] = [blocks(r.indoor) for r in results]
        noise[pilot_spp] = float(np.mean([r.noise["indoor"] for r in results]))
    assert np.abs(z_scores(means[0], means[4])).max() < 4.5
    # Half the variance: choosing lamps by place already reduced it.
    assert noise[4] ** 2 < 0.6 * noise[0] ** 2


def test_thin_glass_dims_a_bulb_by_its_reflectance() -> None:
    glass = Material("glass", kind=MaterialKind.GLASS, opacity=0.1)
    floor = rooms.quad([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], 0)
    sheet = rooms.quad([(-9, 0.5, -9), (-9, 0.5, 9), (9, 0.5, 9), (9, 0.5, -9)], 2)
    materials = [rooms.matte("floor", 0.5), rooms.BULB, glass]
    lamps = [rooms.bulb((0, 1, 0), 1, 1000.0)]
    camera = rooms.camera((0.1, 0.3, 0), (0, 0, 0), 64, 64, 0.01)
    clear = rendered(
        rooms.house([floor], materials, lamps=lamps), camera, dark_sky(), spp=128, max_depth=2
    )
    glazed = rendered(
        rooms.house([floor, sheet], materials, lamps=lamps),
        camera,
        dark_sky(),
        spp=128,
        max_depth=2,
    )
    # A pane of index 1.5 passes 92 % straight on (both faces, all inner reflections).
    assert glazed.indoor.mean() / clear.indoor.mean() == pytest.approx(0.923, rel=0.01)


@pytest.mark.long
def test_a_cut_out_leaf_lets_light_through_its_holes() -> None:
    half = np.full((8, 8, 4), 255, np.uint8)
    half[:, :4, 3] = 0
    leaf = Material("leaf", texture_id="leaf", alpha_cutout=True, diffuse=(0, 0, 0))
    floor = rooms.quad([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], 0)
    sheet = rooms.quad([(-1, 0.5, -1), (1, 0.5, -1), (1, 0.5, 1), (-1, 0.5, 1)], 2)
    materials = [rooms.matte("floor", 0.5), rooms.BULB, leaf]
    house = rooms.house([floor, sheet], materials, lamps=[rooms.bulb((0, 2, 0), 1, 1000.0)])
    scene = LightScene.load(house, {"leaf": half}, RECIPE, dark_sky())
    lit = {}
    for x in (-0.8, 0.8):
        camera = rooms.camera((x, 0.3, 0.1), (x, 0, 0), 4, 4, 0.01)
        fields = FIELDS.model_copy(update={"spp": 64, "max_depth": 2})
        lit[x] = float(scene.render(camera, "0_0", fields, 1).indoor.mean())
    assert lit[0.8] == 0
    assert lit[-0.8] > 1e-3


def leaf_room(leaf: Material) -> House:
    floor = rooms.quad([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], 0)
    sheet = rooms.quad([(-1, 0.5, -1), (1, 0.5, -1), (1, 0.5, 1), (-1, 0.5, 1)], 2)
    materials = [rooms.matte("floor", 0.5), rooms.BULB, leaf]
    return rooms.house([floor, sheet], materials, lamps=[rooms.bulb((0, 2, 0), 1, 1000.0)])


@pytest.mark.parametrize(
    ("cutoff", "alpha", "is_lit"),
    [(0.2, 90, False), (0.5, 90, True), (0.9, 200, True), (NOTHING_LEFT, None, True)],
)
def test_light_passes_through_alpha_below_the_cutoff(
    cutoff: float, alpha: int | None, is_lit: bool
) -> None:
    textures = {} if alpha is None else {"leaf": np.full((8, 8, 4), alpha, np.uint8)}
    leaf = Material(
        "leaf", diffuse=(0, 0, 0), texture_id=None if alpha is None else "leaf",
        alpha_cutout=True, alpha_cutoff=cutoff,
    )  # fmt: skip
    scene = LightScene.load(leaf_room(leaf), textures, RECIPE, dark_sky())
    camera = rooms.camera((0.1, 0.3, 0.1), (0.1, 0, 0), 4, 4, 0.01)
    fields = FIELDS.model_copy(update={"spp": 64, "max_depth": 2})
    assert (float(scene.render(camera, "0_0", fields, 1).indoor.mean()) > 1e-3) is is_lit


def test_light_and_labels_cut_the_same_holes() -> None:
    import drjit as dr

    rng = np.random.default_rng(4)
    picture = rng.integers(0, 256, (5, 7, 4)).astype(np.uint8)
    leaf = Material("leaf", texture_id="leaf", alpha_cutout=True, alpha_cutoff=0.37)
    house = leaf_room(leaf)
    atlas = texture_atlas(house, {"leaf": picture})
    rows, _notes = material_rows(house, atlas, RECIPE)
    uv = rng.uniform(-2, 2, (20_000, 2)).astype(np.float32)
    mi = mitsuba(choose_variant())
    from pbrs_farm.transport.kernels.surface_textures import is_hole_at

    slot = dr.gather(mi.Vector4f, mi.Float(rows[2]), mi.UInt32(FIRST_TEXEL // 4))
    is_hole = is_hole_at(mi.UInt32(atlas.texels), slot, mi.Point2f(uv.T), mi.Bool(True)).numpy()
    expected = CutOut(picture[..., 3:], 0.37).is_hole(uv)
    assert 0.1 < expected.mean() < 0.5
    assert (is_hole == expected).mean() > 0.9995


def test_another_camera_compiles_nothing() -> None:
    import drjit as dr

    house, camera = rooms.window_room(lumen=800)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    scene.render(camera, "0_0", RECIPE.light, 1)
    second_camera = rooms.camera((2.0, 1.2, 3.0), (1.0, 0.5, 0.5))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        scene.render(second_camera, "0_0", RECIPE.light, 2)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert kernels
    assert all(k["cache_hit"] for k in kernels)


def test_more_passes_are_made_until_the_noise_is_reached() -> None:
    house, camera = rooms.window_room(lumen=800)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    fields = FIELDS.model_copy(update={"spp": 8})
    once = scene.render(camera, "0_0", fields, 1)
    target = once.noise["sum"] / 3
    result = scene.render(camera, "0_0", fields.model_copy(update={"noise": target}), 1)
    assert result.noise["sum"] <= target
    assert result.spp > 8
    capped = fields.model_copy(update={"noise": 1e-6, "max_spp": 32})
    assert scene.render(camera, "0_0", capped, 1).spp == 32


def test_a_time_budget_takes_the_samples_that_fit_and_at_least_some() -> None:
    house, camera = rooms.window_room(lumen=800)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    fields = FIELDS.model_copy(update={"spp": 1, "max_spp": 100_000})
    scene.render(camera, "0_0", fields, 1)
    few = scene.render(camera, "0_0", fields.model_copy(update={"time_budget_s": 1e-6}), 1)
    more = scene.render(camera, "0_0", fields.model_copy(update={"time_budget_s": 0.3}), 1)
    assert few.spp == 4
    assert 4 < more.spp < 100_000
    # The same number of samples without a clock gives the same bits.
    same = scene.render(camera, "0_0", fields.model_copy(update={"spp": few.spp}), 1)
    np.testing.assert_array_equal(few.indoor, same.indoor)
    capped = fields.model_copy(update={"time_budget_s": 60.0, "max_spp": 8})
    assert scene.render(camera, "0_0", capped, 1).spp == 8


def test_a_noise_ends_a_time_budget_early() -> None:
    house, camera = rooms.window_room(lumen=800)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    fields = FIELDS.model_copy(update={"spp": 8, "time_budget_s": 60.0})
    target = scene.render(camera, "0_0", FIELDS.model_copy(update={"spp": 8}), 1).noise["sum"] / 2
    result = scene.render(camera, "0_0", fields.model_copy(update={"noise": target}), 1)
    assert result.noise["sum"] <= target
    assert result.spp < 200


@pytest.mark.parametrize(("texel", "most"), [(225, 0.9), (255, 0.9), (255, 1.0)])
def test_a_textured_floor_is_lit_by_the_albedo_of_its_label(texel: int, most: float) -> None:
    # Kd times the texture is limited, rather than Kd alone.
    recipe = recipe_from_name("released") if most == 1.0 else RECIPE
    floor = rooms.quad([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], 0)
    house = rooms.house([floor], [Material("floor", diffuse=(1, 1, 1), texture_id="t")])
    pixels = np.full((2, 2, 3), texel, np.uint8)
    camera = rooms.camera((0, 1, 3), (0, 0, 0))
    scene = LightScene.load(house, {"t": pixels}, recipe, uniform_sky((1, 1, 1)))
    result = scene.render(camera, "0_0", FIELDS.model_copy(update={"spp": 256}), 1)
    geometry = geometry_from_house(house)
    hit = Caster(geometry).hit_record(camera)
    label = albedo_label(hit, house, geometry, {"t": pixels}, most)[14:]
    linear = linear_from_srgb(label / 255.0)
    np.testing.assert_allclose(result.albedo[14:], linear, atol=1 / 255)
    np.testing.assert_allclose(result.outdoor[14:].mean((0, 1)), linear.mean((0, 1)), rtol=4e-3)
