from __future__ import annotations

import numpy as np

from pbrs_farm.core.optics_fields import SENSOR_PRESETS
from pbrs_farm.core.picture_cameras import CAMERAS, ERRING
from pbrs_farm.core.recipe import ToneFields, recipe_from_name
from pbrs_farm.core.shot import Shot
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, denoise_aovs, wanted_exposures
from pbrs_farm.transport.develop.tone_mapping import (
    add_glare,
    encode_tone,
    exposure_of,
    flatten_light,
    roll_off,
    tone,
)

STRAIGHT = ToneFields(contrast=1.0, flare=0.0, white=64.0)


def grey(level: float) -> np.ndarray:
    return np.full((32, 32, 3), level, np.float32)


def test_exposure_brings_any_level_to_the_same_grey() -> None:
    pictures = [tone(grey(x), STRAIGHT) for x in (1e-4, 1.0, 1e4)]
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


def test_the_curve_is_straight_below_its_shoulder_and_continuous() -> None:
    rng = np.random.default_rng(0)
    dim = rng.uniform(0, 0.6, (16, 16, 3))
    np.testing.assert_array_equal(roll_off(dim, 64.0), dim)
    colour = np.array([1.0, 0.5, 0.25])
    below, above = (roll_off((level * colour)[None, None], 64.0) for level in (0.6, 0.6 + 1e-6))
    np.testing.assert_allclose(above, below, atol=2e-6)


def test_a_bright_red_stays_red_and_a_bright_garden_pales() -> None:
    red, garden = roll_off(np.array([[[2.0, 0.05, 0.05], [6.0, 9.0, 4.0]]]), 10.0)[0]
    assert red[1] < 0.05
    assert garden.min() > 0.85


def test_a_window_keeps_its_steps_up_to_the_white_of_the_recipe() -> None:
    sky = np.geomspace(4, 60, 12).reshape(1, -1, 1).repeat(3, -1)

    def toned(light: np.ndarray, white: float) -> np.ndarray:
        fields = STRAIGHT.model_copy(update={"white": white})
        return tone(light.astype(np.float32), fields, exposure=1.0)[0, :, 0].astype(int)

    assert (np.diff(toned(sky, 64)) >= 1).all()
    assert toned(grey(64.0), 64)[0] == toned(grey(4.0), 4)[0] == 255
    assert toned(grey(0.99), 1)[0] < 255


def test_contrast_keeps_black_middle_and_white_and_is_its_slope_there() -> None:
    ramp = (np.arange(256) / 255)[None, :, None].repeat(3, -1)
    # Above the shoulder the ramp is rolled off: compare below it.
    linear = np.where(ramp > 0.04045, ((ramp + 0.055) / 1.055) ** 2.4, ramp / 12.92)
    values = encode_tone(linear, ToneFields(contrast=2.0), 1.0)[0, :, 0].astype(int)
    assert (values[0], values[255]) == (0, 255)
    assert abs(values[128] - 128) <= 1
    assert abs((values[144] - values[112]) / 32 - 2.0) < 0.05
    assert (np.diff(values) >= 0).all()


def test_the_veil_lifts_black_but_one_bulb_does_not_fill_the_room() -> None:
    room = grey(1.0)
    room[:8] = 1e-6
    bulb = room.copy()
    bulb[20, 20] = 1e5
    dim, veiled, with_bulb = (
        tone(light, ToneFields(flare=flare), exposure=1.0)[0, 0, 0]
        for light, flare in ((room, 0.0), (room, 0.01), (bulb, 0.01))
    )
    assert dim == 0
    assert 3 <= veiled <= with_bulb <= veiled + 12


def test_local_contrast_brings_shade_and_sun_together_keeps_detail_and_makes_no_halo() -> None:
    detail = 1 + 0.1 * np.sin(np.arange(96))
    light = np.broadcast_to(detail[None, :, None], (64, 96, 3)).copy()
    light[:, 48:] *= 8
    flat = flatten_light(light, ToneFields(local_contrast=0.5))
    sides = flat[:, :40].mean(), flat[:, 56:].mean()
    assert 2 < sides[1] / sides[0] < 4  # 8 before
    ripple = (flat / light)[32, 10:30, 0]
    assert ripple.max() / ripple.min() < 1.1  # detail is unchanged
    # Next to the edge no pixel is brighter or darker than its side by more than its detail.
    assert flat[:, 40:48].min() > 0.8 * flat[:, :40].min()
    assert flat[:, 48:56].max() < 1.2 * flat[:, 56:].max()


def test_sharpening_changes_only_edges() -> None:
    light = np.full((16, 16, 3), 0.1)
    light[:, 8:] = 0.3
    plain, sharp = (
        encode_tone(light, ToneFields(sharpening=s), 10.0).astype(int)[8, :, 0] for s in (0.0, 1.0)
    )
    assert (plain[:4] == sharp[:4]).all()
    assert (plain[-4:] == sharp[-4:]).all()
    assert sharp[7] < plain[7] - 5
    assert sharp[8] > plain[8] + 5


def test_contrast_keeps_the_hue_and_saturates_no_shadow() -> None:
    dim = np.array([[[0.15, 0.075, 0.0375]]])
    before, after = (
        encode_tone(dim, ToneFields(contrast=c), 10.0)[0, 0].astype(float) for c in (1.0, 2.0)
    )
    assert after.max() < before.max()
    np.testing.assert_allclose(after / after.max(), before / before.max(), atol=0.05)


def test_the_neutral_camera_is_the_same_for_each_view_and_others_err() -> None:
    neutral = recipe_from_name("fast")
    assert {neutral.camera_of("h", f"0_0_{k}") for k in range(5)} == {
        ("neutral", neutral.tone, neutral.sensor)
    }
    phone = recipe_from_name("fast", {"tone.camera": "phone"})
    cameras = [phone.camera_of("h", f"0_0_{k}") for k in range(5)]
    assert len({c.tone.warmth_ev for c in cameras}) == 5
    assert {c.sensor.preset for c in cameras} == {"phone"}
    assert all(c.tone.local_contrast == 0.4 for c in cameras)


def test_values_of_the_recipe_are_used_for_every_camera() -> None:
    words = {"tone.camera": "phone", "tone.sharpening": "0.1", "sensor.preset": "webcam"}
    camera = recipe_from_name("fast", words).camera_of("h", "0_0_1")
    assert (camera.tone.sharpening, camera.sensor.preset) == (0.1, "webcam")
    words = {"tone.camera": "phone", "sensor.jpeg_quality": "50", "sensor.lag_s": "0.3"}
    fixed, phone = (
        recipe_from_name("fast", words).camera_of("h", "0_0_1").sensor,
        SENSOR_PRESETS["phone"],
    )
    assert (fixed.jpeg_quality, fixed.lag_s) == (50, 0.3)
    assert fixed.is_on
    assert fixed.full_well_e == phone["full_well_e"]


def test_snapshots_err_in_exposure_one_in_eight_is_dim_and_none_has_a_sensor() -> None:
    recipe = recipe_from_name("fast", {"tone.camera": "snapshot"})
    cameras = [recipe.camera_of("h", f"0_0_{k}") for k in range(400)]
    stops = np.array([c.tone.exposure_ev for c in cameras])
    assert not any(c.sensor.is_on for c in cameras)
    assert -0.65 < stops.mean() < -0.35
    assert 0.08 < (stops < -1.2).mean() < 0.2
    # The recipe's own exposure is added, to dim views too.
    brighter = recipe_from_name("fast", {"tone.camera": "snapshot", "tone.exposure_ev": "1"})
    added = [brighter.camera_of("h", f"0_0_{k}").tone.exposure_ev for k in range(400)]
    assert 1.0 < np.mean(added) - stops.mean() < 1.35


def test_drawn_cameras_are_of_all_kinds_and_of_a_variant_another_each() -> None:
    recipe = recipe_from_name("fast", {"tone.camera": "drawn"})
    names = [recipe.camera_of("h", f"0_0_{k}").name for k in range(200)]
    assert set(names) == set(ERRING) == set(CAMERAS) - {"neutral", "snapshot"}
    assert min(names.count(name) for name in ERRING) > 20
    plain = recipe_from_name("fast")
    assert plain.camera_of("h", "0_0_1").name == "neutral"
    assert len({plain.camera_of("h", "0_0_1", n).tone for n in range(1, 9)}) > 4


def test_frames_of_a_clip_and_all_cameras_of_a_rig_have_one_camera() -> None:
    recipe = recipe_from_name("fast", {"tone.camera": "drawn"})
    frames = {recipe.camera_of("h", Shot.of_frame(k).id) for k in range(9)}
    assert len(frames) == 1
    pair = recipe_from_name("fast", {"tone.camera": "drawn", "cameras.stereo_m": "0.1"})
    assert recipe.camera_of("h", "0_1_2") == pair.camera_of("h", "0_1_2_right")
    rig = '{"cameras": [{"name": "front"}, {"name": "back"}, {"name": "far_back"}]}'
    three = recipe_from_name("fast", {"tone.camera": "drawn", "rig": rig})
    for first in ("0_1_2", "frame_00004"):
        of_rig = {three.camera_of("h", f"{first}{eye}") for eye in ("", "_back", "_far_back")}
        assert of_rig == {recipe.camera_of("h", first)}
    rig_cameras = {
        recipe.camera_of(h, v) for h in "gh" for v in ("0_1_2", "0_1_3", "0_1_4", "0_1_5")
    }
    assert len(rig_cameras) > 4


def test_glare_spreads_light_and_neither_adds_nor_takes_any() -> None:
    dark = grey(0.0)
    dark[16, 16] = 100.0
    spread = add_glare(dark, 0.1)
    assert spread[16, 16, 0] < 95
    assert spread[16, 19, 0] > spread[16, 24, 0] > 0
    np.testing.assert_allclose(spread.sum(), dark.sum(), rtol=1e-3)
    np.testing.assert_allclose(add_glare(grey(2.0), 0.1), 2.0, rtol=1e-5)
    assert add_glare(dark, 0.0) is dark


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


def test_a_panorama_denoises_alike_wherever_it_is_cut() -> None:
    rng = np.random.default_rng(0)
    light = (0.5 + 0.4 * np.sin(np.arange(128) / 128 * 2 * np.pi))[None, :, None]
    noisy = (light * rng.gamma(4, 0.25, (64, 128, 3))).astype(np.float32)
    white, normal = np.ones_like(noisy), np.zeros_like(noisy)

    def cleaned(shift: int, *, wraps: bool) -> np.ndarray:
        rolled = np.roll(noisy, shift, axis=1)
        clean = denoise_aovs(LinearAovs(rolled, rolled * 0, white, normal), wraps=wraps)
        return np.roll(clean.outdoor, -shift, axis=1)

    def seam(wraps: bool) -> float:
        cut, whole = cleaned(0, wraps=wraps), cleaned(64, wraps=wraps)
        return float(np.abs(cut - whole)[:, [0, 127]].mean())

    assert seam(True) < 0.5 * seam(False)


def test_noise_does_not_brighten_the_exposure_that_earlier_frames_ask_for() -> None:
    rng = np.random.default_rng(0)
    noisy = rng.gamma(0.3, 1 / 0.3, (24, 32, 1)).repeat(3, -1).astype(np.float32)
    normal = np.zeros((24, 32, 3), np.float32)
    normal[..., 2] = 1
    exposures = {
        (name, denoise): wanted_exposures(
            LinearAovs(light, light * 0, normal * 0 + 0.5, normal), ToneFields(), denoise=denoise
        )["mlt_ol"]
        for name, light in (("noisy", noisy), ("clean", noisy * 0 + 1))
        for denoise in (True, False)
    }
    assert abs(exposures["noisy", True] / exposures["clean", False] - 1) < 0.2
    assert exposures["noisy", False] / exposures["clean", False] > 1.3
