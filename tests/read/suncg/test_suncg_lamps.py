from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.house import House, MaterialKind
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE, item, material_of


def test_lamps_have_lights_in_the_world_with_one_bulb_each(house: House) -> None:
    lamp = item(house, "0_4")
    point, spot = lamp.lights
    assert np.allclose(point.position, [0.3, 1.6, 2.5])
    assert (point.power, point.unit, point.share) == (60.0, PowerUnit.WATT, 1.0)
    assert spot.form is LightForm.SPOT
    assert (spot.cutoff_rad, spot.dropoff) == (1.57, 2.0)
    assert np.allclose(spot.direction, np.array([0, -1, 0.5]) / np.sqrt(1.25))
    for light in lamp.lights:
        (bulb,) = light.emitting
        surface = lamp.surfaces[bulb]
        assert house.materials[surface.material].kind is MaterialKind.BULB
        centre = (surface.positions.min(0) + surface.positions.max(0)) / 2
        assert np.allclose(centre, light.position, atol=1e-5)
        assert light.radius_m == pytest.approx((0.06 + 0.1 + 0.06) / 6, rel=1e-4)
    assert material_of(house, "0_4", "material_2").kind is MaterialKind.SHADE


def test_a_bulb_index_beyond_the_models_materials_leaves_the_bulb_to_repair(house: House) -> None:
    (light,) = item(house, "0_5").lights
    assert light.emitting == ()
    assert light.form is LightForm.LINE
    assert light.position_end is not None
    assert np.allclose([light.position, light.position_end], [[3.4, 0.65, 2.5], [3.6, 0.65, 2.5]])


@pytest.mark.parametrize(
    "row",
    ["lamp 1 material_1 1 material_2", "lamp 1 1 1 2", "\ufefflamp 1 material_1 1 material_2\r"],
)
def test_rows_of_the_lamp_table_name_materials_or_count_them(tmp_path: Path, row: str) -> None:
    suncg_root.write_root(tmp_path)
    table = tmp_path / "metadata/light_geometry_compact.txt"
    table.write_text(f"{row}\nbare_lamp 2 material_1 material_0 0\n", newline="")
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert material_of(house, "0_4", "material_1_0").kind is MaterialKind.BULB
    assert material_of(house, "0_4", "material_2").kind is MaterialKind.SHADE
    assert material_of(house, "0_5", "material_0").kind is MaterialKind.BULB


def test_lights_turn_with_their_mirrored_lamp(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"][4]["transform"] = suncg_root.placement(1, 0, 1, turn=1, mirror=True)
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    point, spot = item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_4").lights
    # (-0.2, 1.55, 0) mirrored in x, then a quarter turn: x goes to -z.
    assert np.allclose(point.position, [1.0, 1.55, 0.8])
    assert np.allclose(spot.direction, np.array([0.5, -1, 0]) / np.sqrt(1.25))


def test_a_lamp_with_bulbs_but_no_light_entry_gets_an_assumed_power(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    (tmp_path / "metadata/suncgModelLights.json").write_text("{}")
    lights = item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_4").lights
    assert [(x.emitting, x.power, x.share) for x in lights] == [
        ((1,), 60.0, 0.5),
        ((2,), 60.0, 0.5),
    ]
