"""Oblique sides and bays: they add floor, and everything else keeps its place."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from pbrs_farm.core.made_home import PLANS
from pbrs_farm.generate.drawn_plan import drawn_plan, with_slants
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, PlanWall
from pbrs_farm.generate.openings import plan_faults
from pbrs_farm.generate.plan_families import plan_families

_PLAIN = plan_families()["flat"].model_copy(update={"slanted": 0.0, "bay": 0.0})


@cache
def plain(seed: int) -> Plan:
    """The first plan without slants among the seeds from this one."""
    return next(
        p
        for k in range(8)
        if not any(map(tilt_deg, (p := drawn_plan(np.random.default_rng(100 * k + seed))).walls))
    )


def slanted(seed: int, **shares: float) -> Plan:
    family = _PLAIN.model_copy(update=shares)
    return with_slants(plain(seed), family, np.random.default_rng(seed))


def tilt_deg(wall: PlanWall) -> int:
    """Angle of a wall off the axes, degrees: 0 to 45."""
    (x0, z0), (x1, z1) = wall.start, wall.end
    short, long = sorted((abs(x1 - x0), abs(z1 - z0)))
    return round(math.degrees(math.atan2(short, long)))


def assert_whole(new: Plan, old: Plan) -> None:
    """Check that nothing is lost: floor, walls, openings in their walls and beside their rooms."""
    assert plan_faults(new) == []
    for room, before in zip(new.rooms, old.rooms, strict=True):
        polygon = Polygon(room.polygon)
        assert polygon.is_valid
        assert polygon.buffer(1e-3).contains(Polygon(before.polygon))
    for opening in new.openings:
        wall, polygon = new.walls[opening.wall], Polygon(new.rooms[opening.room].polygon)
        assert opening.width / 2 < opening.along < wall.length - opening.width / 2
        face = polygon.distance(Point(wall.at(opening.along)))
        assert face == pytest.approx(wall.thickness / 2, abs=2e-3)


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_slanted_side_is_one_straight_line_and_every_room_reaches_it(seed: int) -> None:
    old, new = plain(seed), slanted(seed, slanted=1.0)
    tilts = {tilt_deg(w) for w in new.walls} - {0}
    assert len(tilts) == 1, "one side"
    assert 2 <= tilts.pop() <= 13
    assert_whole(new, old)
    assert len(new.walls) == len(old.walls)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_bay_has_three_walls_and_its_windows_look_out(seed: int) -> None:
    old, new = plain(seed), slanted(seed, bay=1.0)
    assert len(new.walls) == len(old.walls) + 4
    assert sum(tilt_deg(w) > 15 for w in new.walls) == 2
    assert_whole(new, old)
    glass = [
        sum(o.width * o.height for o in p.openings if o.kind is not OpeningKind.DOOR)
        for p in (old, new)
    ]
    assert glass[1] >= glass[0] - 1e-9


def test_homes_without_slants_or_space_for_a_bay_are_unchanged() -> None:
    assert slanted(0) is plain(0)
    assert slanted(2, bay=1.0) is plain(2)


@pytest.mark.long
def test_a_fifth_of_homes_and_more_have_a_wall_that_is_not_at_right_angles() -> None:
    families = [plan_families()[name] for name in PLANS]
    shares = [f.weight * (1 - (1 - f.slanted) * (1 - f.bay)) for f in families]
    assert sum(shares) > 0.35
    drawn = [drawn_plan(np.random.default_rng(seed)) for seed in range(12)]
    assert sum(any(map(tilt_deg, p.walls)) for p in drawn) >= 3
