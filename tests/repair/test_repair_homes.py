"""The nine example homes: closed spaces are tight, shells closed. Skipped if not fetched."""

from __future__ import annotations

import pytest

from pbrs_farm.assets import homes_package
from pbrs_farm.core.house import House, ItemKind, MaterialKind
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import RepairReport, repair
from tests.example_homes import example_homes
from tests.repair.embree import EmbreeOccluder
from tests.repair.shells import unpaired_edges

NAMES = [h.name for h in homes_package.example_homes()]
QUICK = "Studio"


def _repaired(name: str, *, hidden_levels: bool = False) -> tuple[House, RepairReport]:
    package = example_homes()
    data, file = package.home(name)
    fields = ReadFields(hidden_levels=hidden_levels)
    house = read_home(data, file, resources=package.resources(), fields=fields)
    return repair(house, RepairFields(), occluder_from=EmbreeOccluder)


def _check(house: House, report: RepairReport) -> None:
    assert report.leaks is not None
    assert report.leaks.n_rays > 300_000
    assert report.leaks.n_blind < 1e-3 * report.leaks.n_rays
    assert [s.rooms for s in report.leaks.spaces if s.n_sky] == []
    assert report.structure.left_as_is == ()
    assert report.structure.n_openings_cut == report.structure.n_openings

    assert len(unpaired_edges(house)) == 0
    assert not any(i.kind in (ItemKind.PERSON, ItemKind.PLANT) for i in house.items)
    for item in house.items:
        glows = [house.materials[s.material].kind is MaterialKind.BULB for s in item.surfaces]
        assert any(glows) <= bool(item.lights)
    for source in report.sources:
        assert source.escape is not None
        assert source.escape > 0.15


@pytest.mark.homes
def test_the_studio_is_tight_after_repair() -> None:
    house, report = _repaired(QUICK)
    _check(house, report)
    assert [(r.room_id, r.enclosure) for r in report.rooms if r.enclosure == "open"] == [("0_4", "open")]  # fmt: skip


@pytest.mark.homes
@pytest.mark.slow
@pytest.mark.parametrize("hidden_levels", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_every_closed_space_of_a_home_is_tight(name: str, hidden_levels: bool) -> None:
    _check(*_repaired(name, hidden_levels=hidden_levels))
