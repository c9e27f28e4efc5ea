from __future__ import annotations

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.recipe import ToneFields, recipe_from_name
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, denoise_aovs, wanted_exposures
from pbrs_farm.transport.develop.tone_mapping import (
    add_glare,
    encode_tone,
    exposure_of,
    roll_off,
    tone,
)


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


def test_the_curve_is_straight_below_its_shoulder_and_goes_on_without_a_step() -> None:
    rng = np.random.default_rng(0)
    dim = rng.uniform(0, 0.6, (16, 16, 3))
    np.testing.assert_array_equal(roll_off(dim, 64.0), dim)
    colour = np.array([1.0, 0.5, 0.25])
    below, above = (roll_off((level * colour)[None, None], 64.0) for level in (0.6, 0.6 + 1e-6))
    np.testing.assert_allclose(above, below, atol=2e-6)


def test_a_window_keeps_its_steps_up_to_the_white_of_the_recipe() -> None:
    sky = np.geomspace(4, 60, 12).reshape(1, -1, 1).repeat(3, -1)
    steps = tone(sky.astype(np.float32), ToneFields(white=64), exposure=1.0)[0, :, 0].astype(int)
    assert (np.diff(steps) >= 1).all()
    assert tone(grey(64.0), ToneFields(white=64), exposure=1.0)[0, 0, 0] == 255
    assert tone(grey(4.0), ToneFields(white=4), exposure=1.0)[0, 0, 0] == 255
    assert tone(grey(0.99), ToneFields(white=1), exposure=1.0)[0, 0, 0] < 255


def test_contrast_keeps_black_middle_and_white_and_is_its_slope_there() -> None:
    ramp = (np.arange(256) / 255)[None, :, None].repeat(3, -1)
    linear = np.where(ramp > 0.04045, ((ramp + 0.055) / 1.055) ** 2.4, ramp / 12.92)
    values = encode_tone(linear, ToneFields(contrast=2.0))[0, :, 0].astype(int)
    assert (values[0], values[255]) == (0, 255)
    assert abs(values[128] - 128) <= 1
    assert abs((values[144] - values[112]) / 32 - 2.0) < 0.05
    assert (np.diff(values) >= 0).all()


def test_what_is_below_the_black_level_is_black_and_white_stays() -> None:
    ramp = (np.arange(256) / 255)[None, :, None].repeat(3, -1)
    linear = np.where(ramp > 0.04045, ((ramp + 0.055) / 1.055) ** 2.4, ramp / 12.92)
    values = encode_tone(linear, ToneFields(black=0.2))[0, :, 0]
    assert (values[:51] == 0).all()
    assert values[53] > 0
    assert values[255] == 255


def test_contrast_keeps_the_hue_and_saturates_no_shadow() -> None:
    dim = np.array([[[0.15, 0.075, 0.0375]]])
    before, after = (
        encode_tone(dim, ToneFields(contrast=c))[0, 0].astype(float) for c in (1.0, 2.0)
    )
    assert after.max() < before.max()
    np.testing.assert_allclose(after / after.max(), before / before.max(), atol=0.05)


def test_a_spread_draws_one_tone_a_view_and_none_without_it() -> None:
    plain, spread = ToneFields(), ToneFields(spread=1.0)
    assert plain.drawn(1) is plain
    assert spread.drawn(1) == spread.drawn(1) != spread.drawn(2)
    assert spread.drawn(1).spread == 0
    half = ToneFields(spread=0.5).drawn(1)
    assert abs(half.exposure_ev - spread.drawn(1).exposure_ev / 2) < 1e-3


def test_frames_of_a_clip_and_both_eyes_have_one_tone() -> None:
    recipe = recipe_from_name("fast")
    frames = {recipe.tone_of("h", keys.frame_id(k)) for k in range(9)}
    assert len(frames) == 1
    assert recipe.tone_of("h", "0_1_2") == recipe.tone_of("h", keys.right_id("0_1_2"))
    assert recipe.tone_of("h", "0_1_2") != recipe.tone_of("h", "0_1_3")
    assert recipe.tone_of("h", "0_1_2") != recipe.tone_of("g", "0_1_2")


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
        found = denoise_aovs(LinearAovs(rolled, rolled * 0, white, normal), wraps=wraps)
        return np.roll(found.outdoor, -shift, axis=1)

    def seam(wraps: bool) -> float:
        cut, whole = cleaned(0, wraps=wraps), cleaned(64, wraps=wraps)
        return float(np.abs(cut - whole)[:, [0, 127]].mean())

    assert seam(True) < 0.5 * seam(False)


def test_noise_does_not_brighten_the_exposure_that_earlier_frames_ask_for() -> None:
    rng = np.random.default_rng(0)
    noisy = rng.gamma(0.3, 1 / 0.3, (24, 32, 1)).repeat(3, -1).astype(np.float32)
    normal = np.zeros((24, 32, 3), np.float32)
    normal[..., 2] = 1
    asked = {
        (name, denoise): wanted_exposures(
            LinearAovs(light, light * 0, normal * 0 + 0.5, normal), ToneFields(), denoise=denoise
        )["mlt_ol"]
        for name, light in (("noisy", noisy), ("clean", noisy * 0 + 1))
        for denoise in (True, False)
    }
    assert abs(asked["noisy", True] / asked["clean", False] - 1) < 0.2
    assert asked["noisy", False] / asked["clean", False] > 1.3
