"""A Habitat scene: stage, objects, regions, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.inputs.habitat_files import written
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.read.source import read_house, resolve
from pbrs_farm.run.steps import repaired_house
from tests.read.gltf.gltf_scenes import item, two_rooms
from tests.read.habitat.habitat_sets import dataset


def house(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def test_an_object_stands_where_its_instance_says_upright_and_in_metres(tmp_path: Path) -> None:
    sofa = item(house(dataset(tmp_path)), "couch")
    assert sofa.bounds == pytest.approx(np.array([[1.6, 0, 0.5], [2.4, 0.6, 2.5]]), abs=1e-6)
    assert sofa.nyu40 == 6


def test_regions_are_the_rooms(tmp_path: Path) -> None:
    found = house(dataset(tmp_path))
    assert [(r.types, r.ceiling_y) for r in found.rooms] == [
        (("kitchen",), 2.6),
        (("bedroom",), 2.6),
    ]


def test_a_repaired_scene_leaks_nothing_and_loses_no_wall(tmp_path: Path) -> None:
    _house, report = repaired_house(resolve(str(dataset(tmp_path))), Recipe())
    assert not report.is_leaking
    assert report.structure.walls_lost == ()
    assert report.structure.n_walls_thickened > 0


def test_a_changed_model_changes_the_source(tmp_path: Path) -> None:
    path = dataset(tmp_path)
    before = resolve(str(path)).fingerprint
    (tmp_path / "objects/ab12.glb").write_bytes(two_rooms().glb())
    assert resolve(str(path)).fingerprint != before


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ({"stage_instance": {"template_name": "Baked_sc0"}}, "cannot be lit anew"),
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
def test_a_damaged_scene_is_one_line_with_its_place(tmp_path: Path, scene: dict, said: str) -> None:
    with pytest.raises(BadHouse, match=said):
        house(dataset(tmp_path, **scene))


def test_a_scene_outside_its_data_set_is_told_so(tmp_path: Path) -> None:
    path = written(tmp_path / "one.scene_instance.json", {"stage_instance": {"template_name": "a"}})
    with pytest.raises(BadHouse, match="scene_dataset_config"):
        house(path)
