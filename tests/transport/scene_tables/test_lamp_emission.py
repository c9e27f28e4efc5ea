from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.transport.scene_tables.area_emitters import area_emitters_of_house, rgb_from_kelvin
from pbrs_farm.transport.validation import known_rooms as rooms

FAST = recipe_from_name("fast")


@pytest.mark.parametrize(("kelvin", "red_over_blue"), [(2700, 10.5), (6500, 1.0)])
def test_black_bodies_have_luminance_1_and_the_known_tint(
    kelvin: float, red_over_blue: float
) -> None:
    rgb = rgb_from_kelvin(kelvin)
    assert float(rgb @ LUMINANCE) == pytest.approx(1)
    assert rgb[0] / rgb[2] == pytest.approx(red_over_blue, rel=0.2)


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
