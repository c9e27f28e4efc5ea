"""A home as a Habitat data set: what is written is read back equal."""

from __future__ import annotations

import json
from pathlib import Path

from pbrs_farm.cli import main
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.export.homes import differences, repaired_home, stored


def test_a_home_reads_back_equal_from_its_data_set(tmp_path: Path) -> None:
    house = repaired_home()
    root = stored(tmp_path / "root", house)
    assert main(["export", str(root), "--to", "habitat", "--out", str(tmp_path / "out")]) == 0
    (path,) = (tmp_path / "out").glob("*/scenes/*.json")
    source = resolve(str(path))
    got = read_house(source, ReadFields())
    assert got.id == source.house_id, "the home can be run"
    said = [d for d in differences(house, got) if not d.startswith("room ")]
    assert said == []
    assert [(r.name, len(r.polygon)) for r in got.rooms] == [
        (r.name, len(r.polygon)) for r in house.rooms
    ]
    for row in json.loads(path.read_text())["object_instances"]:
        config = path.parents[1] / "objects" / f"{row['template_name']}.object_config.json"
        assert (config.parent / json.loads(config.read_text())["collision_asset"]).is_file()
