"""A sensor counts electrons, has limits, and gives equal bits for equal seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrs_farm.core.recipe import SensorFields, ToneFields, recipe_from_name
from pbrs_farm.transport.develop.camera_sensor import (
    Exposure,
    apply_lens,
    choose_exposure,
    compress_as_jpeg,
    demosaic,
    electrons_read,
    lag_exposure,
    mosaic,
    take_by_sensor,
)

PLAIN = SensorFields(is_on=True)
PLAIN_TONE = ToneFields(contrast=1.0, flare=0.0)  # measures noise in the linear part
ONES = np.ones(3, np.float32)


def grey(level: float, size: int = 64) -> np.ndarray:
    return np.full((size, size, 3), level, np.float32)


def test_a_mosaic_of_a_grey_ramp_comes_back_as_it_was() -> None:
    ramp = np.repeat(np.linspace(0.1, 0.9, 32)[None, :, None], 32, axis=0)
    rgb = np.repeat(ramp, 3, axis=2)
    restored = demosaic(mosaic(rgb))
    assert np.abs(restored - rgb)[4:-4, 4:-4].max() < 1e-9


def test_a_flat_colour_survives_the_mosaic() -> None:
    rgb = np.broadcast_to([0.7, 0.4, 0.1], (16, 16, 3))
    assert np.abs(demosaic(mosaic(rgb)) - rgb)[3:-3, 3:-3].max() < 0.02


@pytest.mark.parametrize("iso", [100.0, 1600.0])
def test_noise_is_that_of_the_electrons(iso: float) -> None:
    # Without a mosaic and at many bits the values are electrons over the well.
    fields = PLAIN.model_copy(update={"mosaic": False, "bits": 16, "headroom": 1.0})
    picture = take_by_sensor(
        grey(0.25, 256), ONES, Exposure(0.01, iso, 1.0), fields, PLAIN_TONE, seed=1
    )
    back = (picture / 255.0).astype(float)
    well = fields.full_well_e * 100 / iso
    electrons = 0.25 * well
    expected = math.sqrt(electrons + fields.read_noise_e**2) / well
    # sRGB and the curve's end stretch differences: compare with a small known step.
    step = 0.02
    low, high = (
        take_by_sensor(grey(v, 256), ONES, Exposure(0.01, 1.0, 1.0),
               fields.model_copy(update={"full_well_e": 1e7, "read_noise_e": 0.0}), PLAIN_TONE, seed=1)
        for v in (0.25 - step, 0.25 + step)
    )  # fmt: skip
    slope = (high.mean() - low.mean()) / 255 / (2 * step)
    assert back.std() / slope == pytest.approx(expected, rel=0.1)


def test_the_shutter_opens_first_and_then_the_speed_rises_up_to_its_limit() -> None:
    bright, dim, dark = (choose_exposure(w, PLAIN) for w in (0.02, 30.0, 1e6))
    assert bright.iso == PLAIN.iso_min
    assert bright.shutter_s < PLAIN.shutter_max_s
    assert dim.shutter_s == PLAIN.shutter_max_s
    assert PLAIN.iso_min < dim.iso < PLAIN.iso_max
    assert dim.factor == pytest.approx(30.0)
    # Beyond both limits the picture stays dark.
    assert dark.iso == PLAIN.iso_max
    assert dark.factor < 1e6


def test_a_stop_more_doubles_the_exposure_and_a_smaller_pupil_needs_more_time() -> None:
    more = PLAIN.model_copy(update={"compensation_ev": 1.0})
    assert choose_exposure(0.05, more).factor == pytest.approx(0.1)
    narrow = PLAIN.model_copy(update={"f_number": 4.0})
    wide = choose_exposure(0.05, PLAIN)
    assert choose_exposure(0.05, narrow).shutter_s == pytest.approx(4 * wide.shutter_s)


def test_automatic_exposure_makes_up_63_percent_of_a_step_after_its_lag() -> None:
    times = np.linspace(0, 0.5, 51)
    levels = [1.0, *[math.e] * 50]
    assert math.log(lag_exposure(levels, times.tolist(), 0.5)) == pytest.approx(1 - 1 / math.e)
    assert lag_exposure(levels, times.tolist(), 0.0) == math.e
    assert lag_exposure([2.0], [0.0], 0.5) == pytest.approx(2.0)


def test_saturated_light_is_white_for_any_gains() -> None:
    gains = np.array([0.7, 1.0, 1.8], np.float32)
    picture = take_by_sensor(grey(1e4), gains, Exposure(0.01, 100, 1.0), PLAIN, PLAIN_TONE, seed=3)
    assert (picture[4:-4, 4:-4] >= 254).all()


def test_corners_are_darker_by_the_vignetting_and_the_middle_is_not() -> None:
    vignetted = apply_lens(np.ones((101, 101, 3)), PLAIN.model_copy(update={"vignetting": 0.4}))
    assert vignetted[50, 50, 0] == pytest.approx(1, abs=1e-3)
    assert vignetted[0, 0, 0] == pytest.approx(0.6, abs=0.01)


def test_aberration_parts_red_from_blue_at_the_edge_and_not_in_the_middle() -> None:
    light = np.zeros((65, 640, 3))
    light[:, 320:328] = light[:, 600:608] = 1.0
    shifted = apply_lens(light, PLAIN.model_copy(update={"aberration_px": 2.0}))
    columns = np.arange(640)

    def centre(channel: int, at: slice) -> float:
        row = shifted[32, at, channel]
        return float((row * columns[at]).sum() / row.sum())

    edge, middle = slice(580, 640), slice(300, 350)
    assert centre(0, edge) - centre(2, edge) == pytest.approx(2.0 * 284 / 322, abs=0.15)
    assert abs(centre(0, middle) - centre(2, middle)) < 0.1


def test_equal_seeds_give_equal_bits_and_other_seeds_other_noise() -> None:
    shot = Exposure(0.02, 800, 1.0)
    fields = SensorFields(preset="phone")
    a, b, c = (take_by_sensor(grey(0.2), ONES, shot, fields, PLAIN_TONE, seed=s) for s in (5, 5, 6))
    assert (a == b).all()
    assert (a != c).any()


def test_jpeg_loses_more_at_lower_quality() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    errors = [np.abs(compress_as_jpeg(noise, q).astype(int) - noise).mean() for q in (95, 30)]
    assert errors[0] < errors[1]


def test_a_sensor_changes_develop() -> None:
    plain, phone = recipe_from_name("fast"), recipe_from_name("fast", {"sensor.preset": "phone"})
    assert phone.digest("tone", "light", "sensor") != plain.digest("tone", "light", "sensor")
    assert phone.sensor.is_on


def test_dark_pixels_are_right_in_the_mean_above_a_black_level() -> None:
    # Two electrons of light below twelve of read noise.
    fields = PLAIN.model_copy(update={"read_noise_e": 12.0, "full_well_e": 1000.0, "headroom": 1.0})
    light = np.full((256, 256), 2 / 1000)
    with_offset, cut = (
        electrons_read(
            light, 100.0, fields.model_copy(update={"black_level": b}), np.random.default_rng(1)
        )
        for b in (1 / 16, 0.0)
    )
    assert with_offset.mean() == pytest.approx(2 / 1000, abs=2e-4)
    assert cut.mean() > 5 / 1000
    assert with_offset.min() < 0
