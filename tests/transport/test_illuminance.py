"""Floor illuminance against closed forms."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.sky_checks import check_illuminance
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.transport import illuminance, path_tracer
from pbrs_farm.transport.illuminance import illuminance_record, photometric_warnings
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky, sunsky
from pbrs_farm.transport.validation import known_rooms as rooms

RECIPE = recipe_from_name("fast")

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)


def test_open_ground_has_the_illuminance_of_the_recipe() -> None:
    ground = rooms.quad([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], 0)
    house = rooms.house([ground], [rooms.matte("ground", 0.2)], size=(2.0, 2.5, 2.0))
    sky = sunsky(RECIPE, elevation_rad=math.radians(30), azimuth_rad=0.5)
    lux = LightScene.load(house, {}, RECIPE, sky).floor_lux(house)["0_0"]
    assert lux["outdoor"] == pytest.approx(sky.sky_lx + sky.sun_lx, rel=0.02)
    assert sky.sky_lx == pytest.approx(10_000, rel=1e-3)
    assert sky.sun_lx == pytest.approx(42_000, rel=0.02)
    assert lux["indoor"] == 0


def test_a_black_room_has_only_the_direct_light_of_its_bulb() -> None:
    surfaces = rooms.shell((4.0, 2.5, 4.0), 0)
    bulb = rooms.bulb((2.0, 2.05, 2.0), 1, 1000.0)
    house = rooms.house(surfaces, [rooms.matte("wall", 0.0), rooms.BULB], lamps=[bulb])
    lux = LightScene.load(house, {}, RECIPE, dark_sky()).floor_lux(house)["0_0"]
    # Flux through a square of half edge 2 m, 2 m below an isotropic source: one face of a cube.
    assert lux["indoor"] == pytest.approx(1000 / 6 / 16, rel=0.03)
    assert lux["outdoor"] == 0


def test_a_vertex_of_a_path_is_recorded_once_for_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    house = builtin_home()
    stored = house.cameras[0]
    camera = Camera.look(Intrinsics.from_hfov(8, 6), stored.eye, stored.towards)
    scene = LightScene.load(house, {}, RECIPE, sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.3))
    scene.floor_lux(house)
    calls = []
    for module in (illuminance, path_tracer):

        def counted(*arguments: Any, advance: Any = module.advance, **by_name: Any) -> Any:
            calls.append(advance)
            return advance(*arguments, **by_name)

        monkeypatch.setattr(module, "advance", counted)
    scene.floor_lux(house)
    assert len(calls) == len(house.rooms)
    calls.clear()
    # The pilot has a kernel, and the picture.
    scene.render(camera, "0_0", RECIPE.light.model_copy(update={"spp": 1}), 1)
    assert len(calls) == 2


def test_rooms_outside_the_range_are_named_and_unlit_groups_are_not() -> None:
    bare = rooms.house([], []).rooms[0]
    day = replace(bare, lit_by=("windows", "lamps"))
    night = replace(bare, id="0_1", lit_by=("lamps",))
    lux = {"0_0": {"outdoor": 3.0, "indoor": 100.0}, "0_1": {"outdoor": 0.0, "indoor": 2000.0}}
    assert "room 0_0: outdoor light gives 3 lx" in photometric_warnings(day, lux["0_0"])[0]
    assert "room 0_1: indoor light gives 2000 lx" in photometric_warnings(night, lux["0_1"])[0]
    house = replace(rooms.house([], []), rooms=(day, night, replace(bare, id="0_2")))
    record = illuminance_record(house, lux)
    assert [(r["room"], len(r["warnings"])) for r in record["rooms"]] == [("0_0", 1), ("0_1", 1)]
    assert record["rooms"][1]["indoor_lx"] == 2000.0


@pytest.mark.parametrize(("lamps_on", "n_warnings"), [(1.0, 1), (0.7, 0)])
def test_a_room_may_lack_lamp_light_if_the_recipe_has_some_off(
    lamps_on: float, n_warnings: int, tmp_path: Path
) -> None:
    room = replace(rooms.house([], []).rooms[0], lit_by=("windows", "lamps"))
    house = replace(rooms.house([], []), rooms=(room,))
    lux = {room.id: {"outdoor": 100.0, "indoor": 0.0}}
    record = illuminance_record(house, lux, some_lamps_off=lamps_on < 1)
    assert len(record["rooms"][0]["warnings"]) == n_warnings
    # The check judges by the recipe of the output root.
    folder = tmp_path / "houses" / house.id
    folder.mkdir(parents=True)
    recipe = recipe_from_name("fast", {"emission.lamps_on": str(lamps_on)})
    (tmp_path / "recipe.json").write_text(recipe.model_dump_json())
    (folder / "illuminance.json").write_text(json.dumps(record))
    row = {"id": room.id, "name": room.name, "lit_by": room.lit_by}
    (folder / "house.json").write_text(json.dumps({"rooms": [row]}))
    tally = Tally()
    case: Any = SimpleNamespace(house=StoredHouse(folder), tally=tally)
    check_illuminance(cast(HouseCase, case))
    assert tally.n_failed == 0
