"""A Habitat scene: stage, objects, regions, and refused files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs.habitat_files import written
from tests.read.gltf.gltf_scenes import Scene, item, two_rooms
from tests.read.habitat.habitat_sets import dataset


def house(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def test_an_instance_places_an_object_upright_and_in_metres(tmp_path: Path) -> None:
    sofa = item(house(dataset(tmp_path)), "couch")
    assert sofa.bounds == pytest.approx(np.array([[1.6, 0, 0.5], [2.4, 0.6, 2.5]]), abs=1e-6)
    assert sofa.nyu40 == 6


def test_regions_are_the_rooms(tmp_path: Path) -> None:
    regions_house = house(dataset(tmp_path))
    assert [(r.types, r.ceiling_y) for r in regions_house.rooms] == [
        (("kitchen",), 2.6),
        (("bedroom",), 2.6),
    ]


def test_a_repaired_scene_leaks_nothing_and_loses_no_wall(tmp_path: Path) -> None:
    _house, report = repaired_house(resolve(str(dataset(tmp_path))), Recipe())
    assert not report.is_leaking
    assert report.structure.walls_lost == ()
    assert report.structure.n_walls_thickened > 0


def test_a_changed_model_or_lighting_changes_the_source(tmp_path: Path) -> None:
    path = dataset(tmp_path)
    before = resolve(str(path)).fingerprint
    (tmp_path / "objects/ab12.glb").write_bytes(two_rooms().glb())
    changed = resolve(str(path)).fingerprint
    written(tmp_path / "lighting/day.lighting_config.json", {"lights": {}})
    assert len({before, changed, resolve(str(path)).fingerprint}) == 3


def lit(folder: Path, lights: object) -> House:
    written(folder / "lighting/day.lighting_config.json", {"lights": lights})
    return house(dataset(folder, default_lighting="lighting/day"))


def test_point_lights_become_lamps_of_one_bulb_and_others_are_noted(tmp_path: Path) -> None:
    rows = {
        "0": {"type": "point", "position": [1, 2.3, 1], "intensity": 1.0, "color": [1, 0.5, 0.25]},
        "1": {"type": "point", "position": [5, 2.3, 1], "intensity": 3.0, "color": [1, 1, 1]},
        "2": {"type": "point", "position": [2, 2.3, 1], "intensity": -1.0},
        "3": {"type": "directional", "direction": [0, -1, 0], "intensity": 2.0},
        "4": {"type": "point", "position": [0, 0, 0], "position_model": "camera"},
    }
    lamps = lit(tmp_path, rows)
    first, second = (light for thing in lamps.items for light in thing.lights)
    assert (first.power, second.power) == (800, 800)
    assert first.position == pytest.approx((1, 2.3, 1))
    assert first.rgb_linear == pytest.approx((1, 0.5, 0.25))
    assert [n.text for n in lamps.notes if "lights" in n.place] == [
        "3 are directional, dark or not of the room; left out"
    ]


@pytest.mark.parametrize("lights", [[1], {"0": 3}, {"0": {"intensity": "x"}}])
def test_damaged_lights_are_refused_in_one_line(tmp_path: Path, lights: object) -> None:
    with pytest.raises(BadHouse, match="lights"):
        lit(tmp_path, lights)


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ({"stage_instance": {"template_name": "Baked_sc0"}}, "cannot be relit"),
        ({"stage_instance": {"template_name": "gone"}}, "no stage_config"),
        ({"stage_instance": {"template_name": "../../flat"}}, "leads out"),
        ({"object_instances": [{"template_name": "gone"}]}, "have no model"),
        (
            {"object_instances": [{"template_name": "ab12", "translation": [1, None, 2]}]},
            "translation",
        ),
        ({"object_instances": [{"template_name": "ab12", "rotation": [0, 0, 0, 0]}]}, "quaternion"),
        ({"object_instances": "many"}, "expected a list"),
    ],
)
def test_a_damaged_scene_is_refused_with_its_place(tmp_path: Path, scene: dict, said: str) -> None:
    with pytest.raises(BadHouse, match=said):
        house(dataset(tmp_path, **scene))


def test_a_scene_outside_its_data_set_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "one.scene_instance.json", {"stage_instance": {"template_name": "a"}})
    with pytest.raises(BadHouse, match="scene_dataset_config"):
        house(path)


def test_templates_within_the_configuration_of_the_data_set_are_found(tmp_path: Path) -> None:
    sofas = [
        {"template_name": name, "translation": [x, 0.3, 1.5], "translation_origin": "COM"}
        for x, name in ((1, "long_sofa"), (2, "new_sofa"), (5, "objects/plain"))
    ]
    path = dataset(
        tmp_path,
        stage_instance={"template_name": "own_stage"},
        object_instances=sofas,
        default_lighting="own_lights",
    )
    plain = Scene()
    plain.node("mesh 3", mesh=plain.box([0, 0, 0], [1, 1, 1]))
    written(tmp_path / "objects/plain.glb", plain.glb())
    upright = {"up": [0, 0, 1], "front": [0, -1, 0], "units_to_meters": 0.01}
    lights = {"0": {"type": "point", "position": [1, 2.3, 1], "intensity": 1.0}}
    written(
        tmp_path / "x.scene_dataset_config.json",
        {
            "stages": {
                "configs": [
                    {
                        "template_handle": "own_stage",
                        "attributes": {"render_asset": "stages/flat.glb"},
                    }
                ]
            },
            "objects": {
                "default_attributes": {"scale": [0.5, 0.5, 0.5]},
                "paths": {".json": ["objects"], ".glb": ["objects"]},
                "configs": [
                    {"template_handle": "unusable"},
                    {
                        "original_file": "objects/ab12.object_config.json",
                        "template_handle": "long_sofa",
                        "attributes": {"scale": [1.5, 1, 1]},
                    },
                    {
                        "template_handle": "new_sofa",
                        "attributes": {"render_asset": "objects/ab12.glb"} | upright,
                    },
                ],
            },
            "light_setups": {
                "configs": [{"template_handle": "own_lights", "attributes": {"lights": lights}}]
            },
        },
    )
    found = house(path)
    assert not [n for n in found.notes if n.kind == "missing-model"]
    sizes = {
        name: np.ptp(next(i for i in found.items if i.name == name).bounds, axis=0).tolist()
        for name in ("long_sofa", "new_sofa", "plain")
    }
    assert sizes["long_sofa"] == pytest.approx([3.0, 0.6, 0.8])
    assert sizes["new_sofa"] == pytest.approx([1.0, 0.3, 0.4])
    assert sizes["plain"] == pytest.approx([0.5, 0.5, 0.5])
    assert len([i for i in found.items if i.lights]) == 1
    before = resolve(str(path)).fingerprint
    (tmp_path / "objects/plain.glb").write_bytes(two_rooms().glb())
    assert resolve(str(path)).fingerprint != before


def test_a_part_of_the_name_of_a_template_is_enough(tmp_path: Path) -> None:
    row = {"template_name": "b1", "translation": [2, 0.3, 1.5], "translation_origin": "COM"}
    path = dataset(tmp_path, object_instances=[row])
    found = house(path)
    assert not [n for n in found.notes if n.kind == "missing-model"]
    whole = house(dataset(tmp_path, object_instances=[row | {"template_name": "ab12"}]))
    assert [i.bounds.tolist() for i in found.items] == [i.bounds.tolist() for i in whole.items]


def test_one_damaged_object_is_left_out_with_a_note(tmp_path: Path) -> None:
    good = {"template_name": "ab12", "translation": [2, 0.3, 1.5], "translation_origin": "COM"}
    damaged = [{"template_name": "broken"}, good | {"translation": [1, None, 2]}]
    rows = [good, damaged[0], good, good, damaged[1], good, good]
    written(tmp_path / "objects/broken.glb", b"glTF, but not much of it")
    found = house(dataset(tmp_path, object_instances=rows))
    assert len([i for i in found.items if i.name == "couch"]) == 5
    lost = [n for n in found.notes if n.kind == "unreadable-model"]
    assert [n.place for n in lost] == ["object_instances[1]", "object_instances[4]"]
