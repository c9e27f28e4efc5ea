from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import House, Item, MaterialKind, geometry_from_house
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


def test_half_the_lamps_are_on_of_every_edit_of_a_home_and_verify_draws_the_same(
    tmp_path: Path,
) -> None:
    bulbs = [replace(rooms.bulb((k, 1, 0), 0, 800.0), id=f"bulb{k}") for k in range(40)]
    bulbs += [two_source_lamp(f"chandelier{k}") for k in range(9)]
    house = replace(rooms.house([], [rooms.BULB], lamps=bulbs), id="home-1")
    geometry = geometry_from_house(house)
    keep = np.ones(len(geometry.faces), bool)
    assert len(area_emitters_of_house(house, geometry, keep, FAST)) == 58
    half = recipe_from_name("fast", {"emission.lamps_on": "0.5"})
    names = [x.name for x in area_emitters_of_house(house, geometry, keep, half)]
    assert 10 < sum(name.startswith("bulb") for name in names) < 30
    # All light sources of a lamp are on or off together.
    sources = [name.partition("/") for name in names if name.startswith("chandelier")]
    lit = {lamp for lamp, _, _ in sources}
    assert 0 < len(lit) < 9
    assert sorted(sources) == sorted((lamp, "/", k) for lamp in lit for k in "01")
    edited = area_emitters_of_house(replace(house, id="home-1-e01234567"), geometry, keep, half)
    assert [x.name for x in edited] == names
    # The check reads the recipe and the items of the output root.
    folder = tmp_path / "houses" / house.id
    folder.mkdir(parents=True)
    (tmp_path / "recipe.json").write_text(half.model_dump_json())
    items = [
        {"instance": k, "id": b.id, "lights": [{}] * len(b.lights)} for k, b in enumerate(bulbs)
    ]
    assert list(StoredHouse(folder, {"items": items}).lamps) == names
    # A recipe with all lamps on keeps its digest: the field is not in it.
    assert "lamps_on" not in FAST.model_dump()["emission"]
    assert half.model_dump()["emission"]["lamps_on"] == 0.5


def two_source_lamp(name: str) -> Item:
    one, two = rooms.bulb((0, 2, 0), 0, 800.0), rooms.bulb((1, 2, 0), 0, 800.0)
    lights = (one.lights[0], replace(two.lights[0], emitting=(1,)))
    return replace(one, id=name, surfaces=one.surfaces + two.surfaces, lights=lights)


def test_shades_of_lamps_that_are_off_do_not_glow_in_the_published_preset() -> None:
    sphere = rooms.bulb((0, 1, 0), 1, 800.0).surfaces[0]
    lamps = [
        replace(bulb, id=f"lamp{k}", surfaces=(*bulb.surfaces, sphere))
        for k, bulb in enumerate([rooms.bulb((0, 1, 0), 0, 800.0)] * 20)
    ]
    shade = replace(rooms.BULB, name="shade", kind=MaterialKind.SHADE)
    house = rooms.house([], [rooms.BULB, shade], lamps=lamps)
    geometry = geometry_from_house(house)
    keep = np.ones(len(geometry.faces), bool)
    half = recipe_from_name("released", {"emission.lamps_on": "0.5"})
    names = [x.name for x in area_emitters_of_house(house, geometry, keep, half)]
    bulbs = [name for name in names if "/" not in name]
    assert 4 < len(bulbs) < 16
    assert [name for name in names if "/" in name] == [f"{name}/shade" for name in bulbs]


def test_a_bulb_sends_out_the_flux_of_its_source() -> None:
    assert flux_of(lamp_house()) == pytest.approx(800, rel=1e-5)


def test_a_bulb_deep_in_its_shade_shines_stronger_so_that_the_lamp_gives_its_flux() -> None:
    assert flux_of(lamp_house(escape=0.5)) == pytest.approx(1600, rel=1e-5)
    assert flux_of(lamp_house(escape=0.01)) == pytest.approx(3200, rel=1e-5)
