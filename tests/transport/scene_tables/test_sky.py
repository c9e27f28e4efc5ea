from __future__ import annotations

import math

import numpy as np
import pytest

from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.transport.scene_tables.sky import (
    choose_panorama,
    drawn_time,
    horizontal_irradiance,
    sky_for_house,
    sky_from_panorama,
    sun_of_hour,
    uniform_sky,
)

FAST = recipe_from_name("fast")


def clear(elevation_deg: float, *, overcast: bool = False) -> Recipe:
    """A recipe with an unclouded sun at that height."""
    words = {"sky.sun_elevation_deg": str(elevation_deg), "sky.overcast": str(overcast).lower()}
    return recipe_from_name("fast", words)


def panorama(sun: float = 20_000.0) -> np.ndarray:
    picture = np.full((64, 128, 3), 0.7, np.float32)
    picture[32:] = 0.2
    picture[20, 40] = sun
    return picture


@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
def test_a_panorama_of_any_scale_gives_one_sky_level_and_a_limited_sun(factor: float) -> None:
    sky = sky_from_panorama("p", panorama() * factor, FAST, rotation_rad=1.0)
    assert sky.sky_lx == pytest.approx(10_000, rel=1e-3)
    assert 0 < sky.sun_lx <= 103_000
    assert sky.dome.max() < 100 * sky.dome.mean()


def test_a_turned_panorama_puts_the_sun_at_its_brightest_texel() -> None:
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


def test_a_third_of_houses_is_lit_by_lamps_and_paper_never() -> None:
    names = [f"home-{k}" for k in range(900)]
    times = [drawn_time(name, 0)[0] for name in names]
    assert 0.28 < np.mean([t != "day" for t in times]) < 0.39
    assert set(times) == {"day", "dusk", "night"}
    by_night = next(n for n, t in zip(names, times, strict=True) if t == "night")
    assert sky_for_house(FAST, by_night).sky_lx < 1
    assert sky_for_house(recipe_from_name("fast", {"sky.time": "day"}), by_night).sky_lx > 5_000
    for name in ("paper", "released"):
        assert recipe_from_name(name).sky.time == "day"


def test_a_sun_of_the_recipe_is_not_drawn() -> None:
    for name in ("home-1", "home-2", "home-3", "home-4", "home-5", "home-6"):
        set_sun = recipe_from_name("fast", {"sky.sun_elevation_deg": "30"})
        assert sky_for_house(set_sun, name).facts()["sun_elevation_deg"] == pytest.approx(
            30, abs=1e-3
        )


@pytest.mark.parametrize(
    ("hour", "latitude", "day", "elevation", "azimuth"),
    [
        (12, 0, 80, 90, None),  # overhead at the equator's equinox
        (12, 48, 80, 42, 180),  # in the south at noon
        (12, -35, 80, 55, 0),  # in the north, south of the equator
        (18, 48, 80, 0, -90),  # sets in the west
        (6, 48, 80, 0, 90),
        (12, 48, 172, 65.45, 180),
        (0, 48, 80, -42, 0),
    ],
)
def test_the_sun_of_an_hour_agrees_with_spherical_trigonometry(
    hour: float, latitude: float, day: int, elevation: float, azimuth: float | None
) -> None:
    angles = np.degrees(sun_of_hour(hour, latitude, day))
    assert angles[0] == pytest.approx(elevation, abs=0.6)
    if azimuth is not None:
        turn = (angles[1] - azimuth + 180) % 360 - 180
        assert turn == pytest.approx(0, abs=1.5)


def test_the_lower_the_sun_below_the_horizon_the_darker_and_bluer_the_sky() -> None:
    def dusk(degrees: float):
        recipe = recipe_from_name(
            "paper", {"sky.kind": "sunsky", "sky.sun_elevation_deg": str(degrees)}
        )
        return sky_for_house(recipe, "h")

    skies = [dusk(d) for d in (-0.5, -3, -6, -12, -40)]
    lux = [s.sky_lx for s in skies]
    assert lux == sorted(lux, reverse=True)
    assert 300 < lux[0] < 600
    assert 0.2 < lux[-1] < 0.5
    assert [s.name for s in skies] == ["dusk", "dusk", "dusk", "night", "night"]
    assert not any(s.sun_irradiance.any() for s in skies)
    blue = [float(e[2] / e[0]) for e in (horizontal_irradiance(s.dome) for s in skies[:3])]
    assert blue == sorted(blue)


@pytest.mark.parametrize(
    ("elevation_deg", "lux"),
    [(60, 100e3), (30, 50e3), (10, 11e3), (2, 1.5e3), (0, 600), (-3, 40), (-6, 3.4), (-12, 0.31)],
)
def test_open_ground_has_the_lux_of_the_tables_by_clear_sky_sun_and_town(
    elevation_deg: float, lux: float
) -> None:
    sky = sky_for_house(clear(elevation_deg), "h")
    assert abs(math.log10((sky.sky_lx + sky.sun_lx) / lux)) < 0.06
    assert sky.facts()["sun_elevation_deg"] == pytest.approx(elevation_deg, abs=1e-3)


def test_the_sky_has_no_step_at_the_horizon() -> None:
    above, level, below = (sky_for_house(clear(d), "h") for d in (0.05, 0.0, -0.05))
    assert above.sky_lx == pytest.approx(level.sky_lx, rel=0.03)
    assert below.sky_lx == pytest.approx(level.sky_lx, rel=0.06)
    assert level.sun_lx == 0
    np.testing.assert_allclose(below.dome[100], level.dome[100], rtol=0.1)


def test_an_overcast_sky_is_three_times_as_bright_at_the_zenith_and_has_no_sun() -> None:
    sky = sky_for_house(clear(30, overcast=True), "h")
    assert sky.sky_lx == pytest.approx(10_800, rel=1e-3)
    assert not sky.sun_irradiance.any()
    assert sky.facts()["sun_elevation_deg"] == pytest.approx(30, abs=1e-3)
    zenith, horizon = sky.dome[0, 0, 1], sky.dome[127, 0, 1]
    assert zenith / horizon == pytest.approx(3, rel=0.02)
    levels = [sky_for_house(clear(d, overcast=True), "h").sky_lx for d in (60, 10, 0, -1, -6, -20)]
    assert levels == sorted(levels, reverse=True)
    assert 250 < levels[2] < 350


def test_the_hour_is_in_the_digest_of_a_sky() -> None:
    paper = recipe_from_name("paper")
    assert paper.digest("sky") != recipe_from_name("paper", {"sky.time": "night"}).digest("sky")


def test_an_edited_home_keeps_the_weather_of_the_home() -> None:
    skies = [sky_for_house(Recipe(), house_id) for house_id in ("flat-1234", "flat-1234-e0123abcd")]
    neighbour_sky = sky_for_house(Recipe(), "flat-1235")
    assert np.array_equal(skies[0].sun_direction, skies[1].sun_direction)
    assert not np.array_equal(skies[0].sun_direction, neighbour_sky.sun_direction)
