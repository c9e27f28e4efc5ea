"""Homes of two storeys: one outline, stairs in the same place, a hole in the upper floor."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from functools import cache
from typing import Any

import numpy as np
import pytest
from shapely.geometry import Polygon, box
from shapely.ops import unary_union

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, ItemKind, geometry_from_house
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, RoomType, Storey
from pbrs_farm.generate.home_file import home_contents
from pbrs_farm.generate.openings import plan_faults
from pbrs_farm.generate.programme import Wishes
from pbrs_farm.generate.staircase import SLAB_M, Stair, n_risers, staircase
from pbrs_farm.generate.two_storeys import drawn_storeys
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import repair

SEEDS = range(4)


@cache
def home(seed: int) -> tuple[tuple[Plan, Plan], Stair]:
    return drawn_storeys(np.random.default_rng(seed), Wishes(storeys=2))


@cache
def house(seed: int) -> House:
    plans, stair = home(seed)
    storeys = [Storey(plan, ()) for plan in plans]
    contents = home_contents(storeys, EMPTY, np.random.default_rng(seed), stair)
    return read_home(contents.archive(), "home.sh3d")


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_both_storeys_have_one_outline(seed: int) -> None:
    grounds: list[Any] = [
        unary_union([Polygon(w.corners()) for w in p.walls]) for p in home(seed)[0]
    ]
    outlines = [Polygon(max(g.geoms, key=lambda x: x.area).exterior if hasattr(g, "geoms") else g.exterior) for g in grounds]  # fmt: skip
    assert outlines[0].symmetric_difference(outlines[1]).area < 1e-6


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_room_is_reached_and_has_daylight(seed: int) -> None:
    lower, upper = home(seed)[0]
    assert plan_faults(lower) == plan_faults(upper) == []
    kinds = [[o.kind for o in plan.openings] for plan in (lower, upper)]
    assert kinds[0].count(OpeningKind.ENTRANCE) == 1
    assert OpeningKind.ENTRANCE not in kinds[1]


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_stairs_lie_free_in_both_storeys_and_before_them_the_hall(seed: int) -> None:
    plans, stair = home(seed)
    assert min(stair.size) > 1.85
    (x, z), (w, d), (fx, fz) = stair.middle, stair.size, stair.front
    before = [(x + u * fz + v * fx, z + u * fx + v * fz) for u in (-w / 2.1, w / 2.1) for v in (d / 2 + 0.05, d / 2 + 0.9)]  # fmt: skip
    for plan in plans:
        well = next(r for r in plan.rooms if r.type is RoomType.STAIRS)
        assert Polygon(well.polygon).buffer(1e-6).contains(box(*stair.rect))
        hall = next(r for r in plan.rooms if r.type is RoomType.HALL)
        assert all(hall.contains(point) for point in before)


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_upper_floor_has_a_hole_only_over_the_stairs(seed: int) -> None:
    assert not house(seed).notes
    (stairs,) = [i for i in house(seed).items if i.kind is ItemKind.STAIRS]
    levels = sorted({room.floor_y for room in house(seed).rooms})
    assert levels[1] == pytest.approx(home(seed)[0][0].height + SLAB_M)
    assert stairs.bounds[1][1] > levels[1]
    # Floors above, ceilings below: all of the rooms except the stairs.
    for kind, level in ((ItemKind.FLOOR, levels[1]), (ItemKind.CEILING, levels[0])):
        rooms = [r for r in house(seed).rooms if r.floor_y == level]
        whole = sum(Polygon(r.polygon).area for r in rooms if r.name != "Stairs")
        assert [r.name for r in rooms if not (r.has_floor and r.has_ceiling)] == ["Stairs"]
        ids = {r.id for r in rooms}
        items = [i for i in house(seed).items if i.kind is kind and i.room_id in ids]
        area = sum(_area(s.positions[s.faces]) for i in items for s in i.surfaces)
        assert area == pytest.approx(whole, abs=0.02)


def _area(triangles: np.ndarray) -> float:
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return float(np.linalg.norm(np.cross(a, b), axis=1).sum() / 2)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS[:1])
def test_repair_finds_no_leak_between_the_storeys(seed: int) -> None:
    _repaired, report = repair(
        house(seed), Recipe().repair,
        occluder_from=lambda some: Caster(geometry_from_house(some)),
    )  # fmt: skip
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert report.leaks.n_rays > 0


def test_steps_are_equal_and_low_and_end_at_the_upper_floor() -> None:
    stair = Stair((0.0, 0.0, 2.0, 2.75), (0.0, 1.0), SLAB_M, foot_is_right=True)
    rise = 2.76
    shape = staircase(stair, rise, (0.9, 0.9, 0.9))
    treads = next(s for s in shape.surfaces if s.name == "treads")
    tops = np.unique(treads.positions.reshape(-1, 4, 3)[..., 1].min(1).round(4))
    n = n_risers(rise)
    heights = rise / n * np.arange(1, n)
    assert n % 2 == 0
    assert rise / n <= 0.185
    assert all(np.abs(tops - y).min() < 1e-3 for y in heights)
    assert tops.max() == pytest.approx(rise - rise / n, abs=1e-3)
    # The flight fills its ground, and its railing is on the upper floor.
    assert shape.bounds[0] == pytest.approx((-1.0, 0.0, -1.375), abs=1e-6)
    assert shape.bounds[1] == pytest.approx((1.0, rise + 0.95, 1.375), abs=1e-6)


def test_two_storeys_without_enough_bedrooms_are_refused_with_the_nearest() -> None:
    with pytest.raises(BadInput, match="2 to 4 bedrooms"):
        Wishes(bedrooms=(0, 1), storeys=2)


@pytest.mark.slow
def test_a_small_area_leaves_fewer_bedrooms_rather_than_no_plan() -> None:
    # Seeds that draw four bedrooms, which need 96 m2.
    for seed in (4, 5, 9):
        plans, _stair = drawn_storeys(np.random.default_rng(seed), Wishes(area=(84, 92), storeys=2))
        n = sum(room.type is RoomType.BEDROOM for plan in plans for room in plan.rooms)
        assert n in (2, 3)


def test_the_file_names_the_storey_that_the_program_shows_first() -> None:
    plans, stair = home(0)
    rng = np.random.default_rng(0)
    data = home_contents([Storey(plan, ()) for plan in plans], EMPTY, rng, stair).archive()
    xml = ET.fromstring(zipfile.ZipFile(io.BytesIO(data)).read("Home.xml"))
    assert xml.get("selectedLevel") == xml.findall("level")[0].get("id")
