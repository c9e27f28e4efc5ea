"""Homes from other formats than Sweet Home 3D: a glTF scene of two rooms, and a SUNCG house."""

from __future__ import annotations

from functools import cache

import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import House, ItemKind
from pbrs_farm.core.recipe import DressFields, ReadFields, RepairFields
from pbrs_farm.dress.dressing import dress
from pbrs_farm.dress.report import DressReport
from pbrs_farm.read.suncg.suncg_house import read_suncg
from pbrs_farm.repair import repair
from tests.read.gltf.gltf_scenes import read, two_rooms
from tests.read.suncg import suncg_root


@cache
def _scene() -> House:
    s = two_rooms()
    s.node("Window", mesh=s.box([1, 1, -0.05], [2, 2, 0.05]))
    s.node("Door", mesh=s.box([3.97, 0, 1], [4.03, 2, 2]))
    s.node("Dining table", mesh=s.box([1.2, 0, 1.2], [2.6, 0.75, 2.0]))
    return read(s)


@pytest.fixture(scope="module")
def suncg(tmp_path_factory: pytest.TempPathFactory) -> House:
    root = tmp_path_factory.mktemp("suncg")
    return read_suncg(root, suncg_root.write_root(root), ReadFields())


def _dressed(house: House) -> tuple[House, DressReport]:
    return dress(house, EMPTY, DressFields(), 1)


def _assert_lived_in(source: House, house: House, report: DressReport) -> None:
    n_source = len(source.items)
    assert report.is_sound
    assert report.changed["surfaces"] >= 2
    assert any(key.startswith("clutter") for key in report.added), report.added
    assert any(key.startswith("walls") for key in report.added), report.added
    assert [i.id for i in house.items[:n_source]] == [i.id for i in source.items]


def test_a_scene_of_planar_walls_is_dressed_and_repaired() -> None:
    source = _scene()
    house, report = _dressed(source)
    _assert_lived_in(source, house, report)
    floors = [i for i in house.items if i.kind is ItemKind.FLOOR]
    assert all(house.materials[s.material].texture_id for i in floors for s in i.surfaces)
    _repaired, repairs = repair(house, RepairFields())
    assert [r.enclosure for r in repairs.rooms] == ["closed", "closed"]


@pytest.mark.long
def test_a_suncg_house_is_dressed_and_repaired(suncg: House) -> None:
    house, report = _dressed(suncg)
    _assert_lived_in(suncg, house, report)
    bare, _report = repair(suncg, RepairFields())
    repaired, _report = repair(house, RepairFields())
    assert len(repaired.items) > len(bare.items)
