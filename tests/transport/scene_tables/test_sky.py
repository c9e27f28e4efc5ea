from __future__ import annotations

import math

import numpy as np
import pytest

from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.transport.scene_tables.sky import (
    choose_panorama,
    horizontal_irradiance,
    sky_for_house,
    sky_from_panorama,
    uniform_sky,
)

FAST = recipe_from_name("fast")


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
