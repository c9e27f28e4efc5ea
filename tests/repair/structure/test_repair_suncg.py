"""Released SUNCG walls: already solid and cut, and coinciding where two rooms meet."""

from __future__ import annotations

import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from pbrs_farm.repair import RepairReport, repair
from tests.read.suncg.suncg_root import write_root
from tests.repair.embree import EmbreeOccluder
from tests.repair.shells import coinciding_share, seen_from

Repaired = tuple[House, RepairReport]


@pytest.fixture(scope="module")
def suncg(tmp_path_factory: pytest.TempPathFactory) -> Repaired:
    root = tmp_path_factory.mktemp("suncg")
    house = read_suncg(root, write_root(root), ReadFields())
    return repair(house, RepairFields(), occluder_from=EmbreeOccluder)


def test_released_walls_are_not_thickened_again(suncg: Repaired) -> None:
    house, report = suncg
    assert report.structure.n_walls_thickened == 0
    assert report.structure.left_as_is == ()
    wall = next(i for i in house.items if i.id == "0_0w0")
    low, high = wall.bounds
    assert high[0] - low[0] == pytest.approx(0.095, abs=1e-4)


def test_each_room_sees_its_side_where_walls_coincide(suncg: Repaired) -> None:
    for origin, room, x in (((2.0, 1.3, 1.5), "0_0", "3"), ((5.0, 1.3, 0.8), "0_1", "0")):
        n_hits = seen_from(suncg[0], origin)
        # Outside faces belong to the neighbour; only reveals of its slabs are visible, in the
        # doorway.
        assert not [key for key in n_hits if key[1].endswith(" out")]
        assert n_hits[f"{room}w{x}", f"WallInside#{room}_{x} in"] > 500
        assert coinciding_share(suncg[0], origin) < 1e-3


def test_windows_that_are_cut_already_stay_open_and_are_plugged_for_the_meter(
    suncg: Repaired,
) -> None:
    house, report = suncg
    # The window of room 0_0 is open to the sky, yet the meter counts no leak.
    assert seen_from(house, (2.0, 1.3, 1.5))["", ""] > 500
    assert report.leaks is not None
    assert [s.rooms for s in report.leaks.spaces] == [("0_0",)]
    assert report.leaks.n_rays > 50_000
    assert report.leaks.n_sky == 0


def test_a_hidden_ceiling_makes_a_room_open(suncg: Repaired) -> None:
    room = suncg[0].room("0_1")
    assert room.enclosure_reason.endswith("m2 of it have no ceiling")
    assert "fallback" not in room.lit_by
