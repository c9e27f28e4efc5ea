"""A home as a Habitat data set reads back equal."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.geometry.opened import moved_surface
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.export.homes import differences, repaired_home, stored


@pytest.mark.long
def test_a_home_reads_back_equal_from_its_data_set(tmp_path: Path) -> None:
    house = repaired_home()
    root = stored(tmp_path / "root", house)
    assert main(["export", str(root), "--to", "habitat", "--out", str(tmp_path / "out")]) == 0
    (path,) = (tmp_path / "out").glob("*/scenes/*.json")
    source = resolve(str(path))
    got = read_house(source, ReadFields())
    assert got.id == source.house_id, "the home can be run"
    differing = [d for d in differences(house, got) if not d.startswith("room ")]
    assert differing == []
    assert [(r.name, len(r.polygon)) for r in got.rooms] == [
        (r.name, len(r.polygon)) for r in house.rooms
    ]
    for row in json.loads(path.read_text())["object_instances"]:
        config = path.parents[1] / "objects" / f"{row['template_name']}.object_config.json"
        assert (config.parent / json.loads(config.read_text())["collision_asset"]).is_file()


def test_opening_parts_read_back_with_their_joints(tmp_path: Path) -> None:
    house = repaired_home()
    doors = {item.id: item for item in house.items if item.joints}
    assert doors
    # One of them is open.
    item = next(iter(doors.values()))
    joint = item.joints[0]
    surfaces = tuple(
        moved_surface(s, joint.motion(0.6)) if s.part == joint.part else s for s in item.surfaces
    )
    opened = replace(item, surfaces=surfaces, joints=(replace(joint, value=0.6), *item.joints[1:]))
    items = tuple(opened if i.id == item.id else i for i in house.items)
    root = stored(tmp_path / "root", replace(house, items=items))
    assert main(["export", str(root), "--to", "habitat", "--out", str(tmp_path / "out")]) == 0
    (path,) = (tmp_path / "out").glob("*/scenes/*.json")
    rows = json.loads(path.read_text())["articulated_object_instances"]
    assert len(rows) == len(doors)
    got = {i.id: i for i in read_house(resolve(str(path)), ReadFields()).items if i.joints}
    assert got.keys() == doors.keys()
    for key, opening_item in (doors | {item.id: opened}).items():
        for a, b in zip(opening_item.joints, got[key].joints, strict=True):
            assert a.kind is b.kind
            assert b.point == pytest.approx(a.point, abs=1e-5)
            assert b.axis == pytest.approx(a.axis, abs=1e-5)
            assert (b.lower, b.upper, b.value) == pytest.approx(
                (a.lower, a.upper, a.value), abs=1e-6
            )
            before = np.concatenate(
                [s.positions for s in opening_item.surfaces if s.part == a.part]
            )
            after = np.concatenate([s.positions for s in got[key].surfaces if s.part == b.part])
            assert after.min(0) == pytest.approx(before.min(0), abs=1e-4)
            assert after.max(0) == pytest.approx(before.max(0), abs=1e-4)
