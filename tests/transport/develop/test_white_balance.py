"""The white balance of views filled by one colour, or by a sky of one level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrs_farm.check import developing
from pbrs_farm.core.recipe import ToneFields
from pbrs_farm.transport.develop.white_balance import white_balance

PINK = np.array([0.9, 0.11, 0.32])


def view(albedo: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    level = np.random.default_rng(0).uniform(0.5, 1.5, (24, 32, 1))
    picture = np.broadcast_to(albedo, (24, 32, 3)).astype(np.float32)
    return (picture * light * level).astype(np.float32), picture


def test_a_room_of_one_strong_colour_leaves_the_sky_its_hue() -> None:
    radiance, albedo = view(PINK, PINK / PINK.max())  # light interreflected by the walls
    gains = white_balance(radiance, albedo, ToneFields(white_balance=0.7))
    sky = np.array([0.8, 0.95, 1.1]) * gains
    assert sky[1] < 1.05 * max(sky[0], sky[2])  # green does not dominate
    assert gains.max() / gains.min() < 3


@pytest.mark.parametrize("albedo", [np.array([0.7, 0.68, 0.65]), PINK])
def test_the_light_of_lamps_is_balanced_as_before(albedo: np.ndarray) -> None:
    warm = np.array([1.0, 0.65, 0.33])  # about 2,700 K
    radiance, picture = view(albedo, warm)
    expected = (warm / (warm @ [0.2126, 0.7152, 0.0722])) ** -0.7
    gains = white_balance(radiance, picture, ToneFields(white_balance=0.7))
    np.testing.assert_allclose(gains / gains[1], expected / expected[1], rtol=1e-2)


def test_colours_of_many_hues_fill_no_view() -> None:
    rng = np.random.default_rng(1)
    albedo = rng.uniform(0.05, 0.9, (24, 32, 3)).astype(np.float32)
    green = np.array([0.3, 1.0, 0.3], np.float32)
    gains = white_balance(albedo * green, albedo, ToneFields(white_balance=1.0))
    np.testing.assert_allclose(gains / gains[1], [1 / 0.3, 1, 1 / 0.3], rtol=1e-3)


@pytest.mark.parametrize("gains_of", [white_balance, developing.white_balance])
def test_the_last_bits_of_a_sky_do_not_change_the_colours(
    gains_of: Callable[..., np.ndarray],
) -> None:
    light = np.full((24, 32, 3), (3.9, 4.1, 4.6), np.float32)
    light[16:] = np.random.default_rng(2).uniform(5, 9, (8, 32, 1)) * (1.3, 1, 0.5)
    albedo = np.ones_like(light)
    bits = np.random.default_rng(3).integers(-2, 3, (16, 32, 3))
    noisy = light.copy()
    noisy[:16] = (light[:16].view(np.int32) + bits.astype(np.int32)).view(np.float32)
    fields = ToneFields(white_balance=0.7)
    np.testing.assert_allclose(
        gains_of(noisy, albedo, fields), gains_of(light, albedo, fields), atol=2e-6
    )
