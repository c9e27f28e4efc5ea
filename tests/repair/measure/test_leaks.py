"""The leak meter finds existing leaks, and repair closes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair
from pbrs_farm.repair.measure.enclosure import Space
from pbrs_farm.repair.measure.leaks import LeakMeter, leaks_of_house
from pbrs_farm.repair.measure.room_interiors import RoomInterior
from pbrs_farm.repair.structure import watertight as structure
from pbrs_farm.repair.structure.prisms import level_plane
from tests.repair.embree import EmbreeOccluder

GAP_M = 0.02


def _home_with_a_gap() -> House:
    """The built-in home with its east wall moved 2 cm away: two open corners, a gap at the floor."""
    home = builtin_home()
    items = [_moved(i, (GAP_M, 0.0, 0.0)) if i.id == "wall_1" else i for i in home.items]
    return home.with_items(items)


def _moved(item: Item, by: tuple[float, float, float]) -> Item:
    step = np.array(by, np.float32)
    moved = tuple(replace(s, positions=s.positions + step) for s in item.surfaces)
    return replace(item, surfaces=moved)


def test_a_wall_that_misses_its_neighbours_is_joined_to_them() -> None:
    _, report = repair(_home_with_a_gap(), RepairFields(), occluder_from=EmbreeOccluder)
    assert report.structure.n_joints_closed == 2
    assert report.leaks is not None
    assert report.leaks.n_sky == 0


def test_without_the_joints_the_meter_counts_and_places_leaks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(structure, "joints_between_walls", lambda *_: ([], 0))
    _, report = repair(_home_with_a_gap(), RepairFields(), occluder_from=EmbreeOccluder)
    assert report.is_leaking
    assert report.leaks is not None
    (tight, leaking) = sorted(report.leaks.spaces, key=lambda s: s.n_sky)
    assert (tight.rooms, tight.n_sky) == (("0_0",), 0)
    assert leaking.rooms == ("0_1",)
    assert leaking.n_sky > 50
    origins = np.array([leak.origin for leak in leaking.leaks])
    at_the_wall = np.abs(origins[:, 0] - 9.0) < 0.1
    assert at_the_wall.mean() > 0.5


def test_the_meter_counts_the_open_share_of_a_box() -> None:
    # A cube without its ceiling: from its middle a sixth of all directions is open.
    home = builtin_home()
    wall = next(i for i in home.items if i.kind is ItemKind.WALL)
    cube = shapely.box(0, 0, 1, 1)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1]]
    faces = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))], np.int32)
    # Faces point into the cube.
    centre = corners[faces].mean(1) - 0.5
    normal = np.cross(
        corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]]
    )
    faces = np.where((centre * normal).sum(1, keepdims=True) > 0, faces[:, [0, 2, 1]], faces)
    surface = replace(wall.surfaces[0], positions=corners, faces=faces, uvs=None)
    house = home.with_items([replace(wall, surfaces=(surface,))])
    air = RoomInterior(
        cube.buffer(-0.49), cube.buffer(-0.49), 0.0, level_plane(0.49), level_plane(0.51)
    )
    meter = LeakMeter(step_m=1.0, per_start=4_000, n_inside=0, n_bounces=0)
    report = leaks_of_house(house, [Space(("0_0",), ())], {"0_0": [air]}, (), EmbreeOccluder, meter)
    share = report.n_sky / report.n_rays
    sigma = np.sqrt(1 / 6 * 5 / 6 / report.n_rays)
    assert abs(share - 1 / 6) < 4 * sigma + 0.004
    assert len(report.spaces[0].leaks) == 50


def test_an_open_room_is_listed_with_its_reason_and_not_measured() -> None:
    home = builtin_home()
    items = [i for i in home.items if i.id != "wall_1"]
    house, report = repair(home.with_items(items), RepairFields(), occluder_from=EmbreeOccluder)
    assert [str(r.enclosure) for r in house.rooms] == ["closed", "open"]
    assert house.rooms[1].enclosure_reason == "3.9 m of its edge have no full-height wall"
    assert report.leaks is not None
    assert [s.rooms for s in report.leaks.spaces] == [("0_0",)]
    assert report.leaks.closed_share == pytest.approx(20.0 / 35.6, abs=1e-3)


def test_a_room_without_a_ceiling_is_open() -> None:
    home = builtin_home()
    items = [i for i in home.items if i.id != "ceiling_0_1"]
    house, _ = repair(home.with_items(items), RepairFields())
    assert house.rooms[1].enclosure_reason == "15.6 m2 of it have no ceiling"


def test_rooms_without_a_wall_between_them_are_one_space() -> None:
    home = builtin_home()
    items = [i for i in home.items if i.id != "wall_4"]
    rooms = (home.rooms[0], replace(home.rooms[1], polygon=home.rooms[1].polygon - [0.1, 0.0]))
    house = replace(home.with_items(items), rooms=rooms)
    _, report = repair(house, RepairFields())
    assert {r.space for r in report.rooms} == {("0_0", "0_1")}
