"""Skies, materials, lamps, tone and noise: the numbers before and after the kernels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import House, Material, MaterialKind, geometry_from_house
from pbrs_farm.core.recipe import Recipe, ToneFields, recipe_from_name
from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.develop.tone_mapping import exposure_of, tone
from pbrs_farm.transport.light_result import relative_noise
from pbrs_farm.transport.scene_tables.blackbody import rgb_from_kelvin
from pbrs_farm.transport.scene_tables.lamp_emission import area_emitters_of_house
from pbrs_farm.transport.scene_tables.material_rows import (
    MAX_ALBEDO,
    TextureAtlas,
    material_rows,
    texture_atlas,
)
from pbrs_farm.transport.scene_tables.portals import MAX_PORTALS, nearest_portals, portals_of_house
from pbrs_farm.transport.scene_tables.sky import (
    choose_panorama,
    horizontal_irradiance,
    sky_for_house,
    sky_from_panorama,
    uniform_sky,
)
from tests.transport import rooms

FAST = recipe_from_name("fast")
EMPTY = TextureAtlas(np.zeros(1, np.uint32), {})


def panorama(sun: float = 20_000.0) -> np.ndarray:
    picture = np.full((64, 128, 3), 0.7, np.float32)
    picture[32:] = 0.2
    picture[20, 40] = sun
    return picture


@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
def test_a_panorama_of_any_scale_gives_one_sky_level_and_no_more_sun_than_allowed(
    factor: float,
) -> None:
    sky = sky_from_panorama("p", panorama() * factor, FAST, rotation_rad=1.0)
    assert sky.sky_lx == pytest.approx(10_000, rel=1e-3)
    assert 0 < sky.sun_lx <= 60_000 * 1.001
    assert sky.dome.max() < 100 * sky.dome.mean()


def test_the_sun_of_a_panorama_lies_where_its_brightest_texel_was_turned_to() -> None:
    sky = sky_from_panorama("p", panorama(), FAST, rotation_rad=0.0)
    theta, phi = (20 + 0.5) / 64 * math.pi, (40 + 0.5) / 128 * 2 * math.pi
    expected = [math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi)]
    np.testing.assert_allclose(sky.sun_direction, expected, atol=1e-3)


def test_an_overcast_panorama_has_no_sun() -> None:
    assert not sky_from_panorama("p", panorama(0.7), FAST, rotation_rad=0.0).sun_irradiance.any()


def test_the_released_preset_takes_a_panorama_times_75_unturned() -> None:
    released = recipe_from_name("released")
    sky = sky_from_panorama("p", panorama(), released, rotation_rad=2.0)
    np.testing.assert_allclose(sky.dome, panorama() * 75, rtol=1e-6)


def test_a_house_sees_the_same_sky_at_every_run_and_houses_differ() -> None:
    a, b, c = (sky_for_house(FAST, name).facts() for name in ("one", "one", "two"))
    assert a == b
    assert a != c


def test_rooms_and_studios_are_no_skies() -> None:
    assert choose_panorama(["interior.exr", "city.exr", "studio.exr"], "h", 0) == "city.exr"
    with pytest.raises(BadRecipe, match="no outdoor panorama"):
        choose_panorama(["interior.exr"], "h", 0)


def test_a_uniform_sky_of_radiance_1_has_the_irradiance_pi() -> None:
    np.testing.assert_allclose(
        horizontal_irradiance(uniform_sky((1, 1, 1)).dome), math.pi, rtol=5e-3
    )


@pytest.mark.parametrize(("kelvin", "red_over_blue"), [(2700, 10.5), (6500, 1.0)])
def test_black_bodies_have_luminance_1_and_the_known_tint(
    kelvin: float, red_over_blue: float
) -> None:
    rgb = rgb_from_kelvin(kelvin)
    assert float(rgb @ LUMINANCE) == pytest.approx(1)
    assert rgb[0] / rgb[2] == pytest.approx(red_over_blue, rel=0.2)


def one(material: Material, recipe: Recipe = FAST) -> tuple[np.ndarray, list[str]]:
    rows, notes = material_rows(rooms.house([], [material]), EMPTY, recipe)
    return rows[0], notes


def test_whites_stop_at_the_albedo_of_paint() -> None:
    row, _notes = one(Material("white"))
    np.testing.assert_allclose(row[:3], MAX_ALBEDO)


def test_kd_and_ks_above_one_are_scaled_and_reported() -> None:
    bright = Material("bright", diffuse=(1, 1, 1), specular=(1, 1, 1), shininess=50)
    row, notes = one(bright)
    assert row[4] == pytest.approx(0.08)
    assert any("'bright'" in n and "scaled" in n for n in notes)
    metal, _notes = one(Material("m", diffuse=(0.2, 0.2, 0.2), specular=(1, 1, 1), shininess=50))
    assert metal[0] + metal[4] <= 1 + 1e-6


def test_the_released_preset_reads_kd_as_linear_and_glass_as_nothing() -> None:
    released = recipe_from_name("released")
    grey, _notes = one(
        Material("grey", diffuse=(0.5, 0.5, 0.5), specular=(1, 1, 1), shininess=9), released
    )
    assert grey[0] == 0.5
    assert grey[7] == 0
    glass, _notes = one(Material("glass", opacity=0.5), released)
    assert glass[11] == 3


def test_texels_keep_every_8_bit_value() -> None:
    ramp = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, -1)
    house = rooms.house([], [Material("t", texture_id="ramp")])
    packed = texture_atlas(house, {"ramp": ramp})
    root = (packed.texels[1:] & 1023) / 1023
    v = np.arange(256) / 255
    linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(root**2, linear, atol=1.2e-3)
    assert packed.slots["ramp"] == (1, 16, 16)


def lamp_house(**changes: object) -> House:
    bulb = rooms.bulb((0, 1, 0), 0, 800.0)
    bulb = replace(bulb, lights=(replace(bulb.lights[0], **changes),))
    return rooms.house([], [rooms.BULB], lamps=[bulb])


def flux_of(house: House) -> float:
    geometry = geometry_from_house(house)
    (lamp,) = area_emitters_of_house(house, geometry, np.ones(len(geometry.faces), bool), FAST)
    return float(np.array(lamp.radiance) @ LUMINANCE * LM_PER_W * math.pi * lamp.area_m2)


def test_a_bulb_sends_out_the_flux_of_its_source() -> None:
    assert flux_of(lamp_house()) == pytest.approx(800, rel=1e-5)


def test_a_bulb_deep_in_its_shade_shines_stronger_so_that_the_lamp_gives_its_flux() -> None:
    assert flux_of(lamp_house(escape=0.5)) == pytest.approx(1600, rel=1e-5)
    assert flux_of(lamp_house(escape=0.01)) == pytest.approx(3200, rel=1e-5)


def test_only_windows_and_glazed_doors_are_portals_and_the_widest_are_kept() -> None:
    house, view = rooms.window_room()
    assert portals_of_house(house).shape == (1, 4, 3)
    many = np.concatenate([portals_of_house(house) + np.array([0, 0, 5.0 * k]) for k in range(9)])
    assert len(nearest_portals(many, view.eye)) == MAX_PORTALS
    assert any((p == many[0]).all() for p in nearest_portals(many, view.eye))


def test_pane_materials_make_a_door_a_portal() -> None:
    house, _view = rooms.window_room(pane=True)
    door = replace(house.openings[0], is_window=False, item_id="walls")
    assert len(portals_of_house(replace(house, openings=(door,)))) == 1
    solid, _view = rooms.window_room()
    assert len(portals_of_house(replace(solid, openings=(door,)))) == 0
    assert house.materials[2].kind is MaterialKind.PANE


def grey(level: float) -> np.ndarray:
    return np.full((32, 32, 3), level, np.float32)


def test_exposure_brings_any_level_to_the_same_grey() -> None:
    pictures = [tone(grey(x), ToneFields()) for x in (1e-4, 1.0, 1e4)]
    assert len({int(p[0, 0, 0]) for p in pictures}) == 1
    expected = round(255 * (1.055 * 0.18 ** (1 / 2.4) - 0.055))
    assert abs(int(pictures[0][0, 0, 0]) - expected) <= 1


def test_a_window_does_not_darken_the_room() -> None:
    room = grey(1.0)
    with_window = room.copy()
    with_window[:8, :8] = 500.0
    dark, lit = tone(with_window, ToneFields()), tone(room, ToneFields())
    assert int(dark[20, 20, 0]) > 0.6 * int(lit[20, 20, 0])
    assert dark[0, 0, 0] >= 250


def test_tone_rises_with_radiance_and_never_wraps() -> None:
    ramp = np.geomspace(1e-3, 1e4, 1024).astype(np.float32).reshape(1, -1, 1).repeat(3, -1)
    for preset in ("photo", "released"):
        values = tone(ramp, ToneFields(preset=preset))[0, :, 0].astype(int)
        assert (np.diff(values) >= 0).all()
        assert values[-1] >= 250


def test_black_stays_black_and_bad_numbers_count_as_black() -> None:
    bad = grey(0.0)
    bad[0, 0] = np.nan
    bad[1, 1] = np.inf
    for preset in ("photo", "released"):
        assert not tone(bad, ToneFields(preset=preset)).any()
    assert exposure_of(grey(0.0), ToneFields()) == 1.0


def test_the_released_tone_is_reinhards_formula() -> None:
    rng = np.random.default_rng(0)
    rgb = rng.lognormal(0, 1, (16, 16, 3)).astype(np.float32)
    w = np.array([0.212671, 0.715160, 0.072169])
    y = rgb.astype(np.float64) @ w
    scaled = y * 0.8 / np.exp(np.log(y + 1e-3).mean())
    white = scaled.max() * 0.8**2
    mapped = scaled * (1 + scaled / white**2) / (1 + scaled)
    linear = np.clip(rgb * (mapped / y)[..., None], 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    ours = tone(rgb, ToneFields(preset="released", key=0.8)).astype(int)
    assert np.abs(ours - np.round(255 * srgb)).max() <= 1


def test_noise_is_the_relative_error_of_the_mean_of_two_halves() -> None:
    rng = np.random.default_rng(1)
    half = [1 + 0.2 * rng.standard_normal((200, 200, 1)).repeat(3, -1) for _ in range(2)]
    # Each half has 20 %, their mean 14 %; a tenth of the level in the divisor makes it 12.9 %.
    assert relative_noise(half[0], half[1]) == pytest.approx(0.2 / math.sqrt(2) / 1.1, rel=0.05)
    assert relative_noise(np.zeros((4, 4, 3)), np.zeros((4, 4, 3))) == 0


def test_the_denoiser_removes_noise_and_keeps_black_pictures() -> None:
    pytest.importorskip("pyoidn")
    rng = np.random.default_rng(2)
    noisy = (1 + 0.5 * rng.standard_normal((64, 64, 3))).clip(0).astype(np.float32)
    flat = grey(0.5).repeat(2, 0).repeat(2, 1)
    up = np.zeros((64, 64, 3), np.float32)
    up[..., 1] = 1
    clean = denoise_radiance(noisy, flat, up)
    assert clean.std() < 0.2 * noisy.std()
    assert clean.mean() == pytest.approx(noisy.mean(), rel=0.05)
    assert not denoise_radiance(np.zeros((8, 8, 3), np.float32), grey(0)[:8, :8], up[:8, :8]).any()


def test_one_denoiser_serves_all_pictures_of_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    pyoidn = pytest.importorskip("pyoidn")
    rng = np.random.default_rng(3)
    noisy = rng.lognormal(0, 1, (48, 64, 3)).astype(np.float32)
    up = np.zeros_like(noisy)
    up[..., 1] = 1
    first = denoise_radiance(noisy, np.full_like(noisy, 0.5), up)

    def refuse(*_words: object, **_named: object) -> None:
        raise AssertionError("another device")

    monkeypatch.setattr(pyoidn.Device, "__init__", refuse)
    other = denoise_radiance(noisy[:32, :32], np.full((32, 32, 3), 0.5, np.float32), up[:32, :32])
    assert other.shape == (32, 32, 3)
    # After a picture of another size the first one is the same bits again.
    np.testing.assert_array_equal(first, denoise_radiance(noisy, np.full_like(noisy, 0.5), up))
