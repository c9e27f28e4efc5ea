"""Rules that every furnished plan satisfies."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.generated_home import drawn_home, furnish_report
from tests.generate.furnish.shelves import plain_catalogue

SEEDS = (1, 2, 3, 7)


@cache
def home(seed: int) -> tuple[Plan, tuple[PlacedPiece, ...]]:
    drawn = drawn_home(np.random.default_rng(seed), plain_catalogue())
    return drawn.plan, drawn.pieces


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_furnished_home_breaks_no_gate(seed: int) -> None:
    plan, pieces = home(seed)
    report = furnish_report(plan, pieces, plain_catalogue())
    assert report.broken == ()
    assert report.walkable >= 0.4
    assert 0.4 <= report.pieces_per_m2 <= 0.75


def test_the_same_seed_gives_the_same_furniture() -> None:
    plan, _ = home(2)
    first, second = (furnished(plan, plain_catalogue(), np.random.default_rng(2)) for _ in range(2))
    assert first == second


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_television_looks_at_the_sofa_from_two_to_three_and_a_half_metres(seed: int) -> None:
    _, pieces = home(seed)
    screens = [p for p in pieces if p.piece.group == "tv"]
    assert screens
    for tv in screens:
        sofa = next(p for p in pieces if p.piece.group == "sofa" and p.room == tv.room)
        assert np.dot(tv.front, sofa.front) == pytest.approx(-1)
        ahead = np.dot((sofa.x - tv.x, sofa.z - tv.z), tv.front) - sofa.depth / 2
        assert 1.9 <= ahead <= 3.8


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_wall_cabinets_hang_at_145_cm_and_lamps_from_the_ceiling(seed: int) -> None:
    plan, pieces = home(seed)
    assert all(p.elevation == 1.45 for p in pieces if p.piece.group == "upper_cabinet")
    lamps = [p for p in pieces if p.piece.group == "ceiling_lamp"]
    assert all(p.elevation + p.height == pytest.approx(plan.height, abs=1e-3) for p in lamps)


def test_an_empty_catalogue_leaves_the_rooms_empty() -> None:
    plan, _ = home(1)
    assert furnished(plan, EMPTY, np.random.default_rng(1)) == ()


def test_an_unknown_style_is_refused() -> None:
    plan, _ = home(1)
    with pytest.raises(BadInput, match="no such style"):
        furnished(plan, EMPTY, np.random.default_rng(1), "baroque")


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_every_cooker_has_its_hood_above(seed: int) -> None:
    _, pieces = home(seed)
    cookers = [p for p in pieces if p.piece.group == "cooker"]
    assert cookers
    for cooker in cookers:
        hood = next(p for p in pieces if p.piece.group == "hood" and p.room == cooker.room)
        assert np.hypot(hood.x - cooker.x, hood.z - cooker.z) < 0.2


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_units_of_a_kitchen_have_their_backs_at_walls(seed: int) -> None:
    plan, pieces = home(seed)
    for unit in (p for p in pieces if p.piece.group in ("cooker", "sink", "base_cabinet")):
        back = Point(*(np.mean(unit.corners[:2], axis=0)))
        outline = Polygon(plan.rooms[unit.room].polygon).exterior
        assert outline.distance(back) < 0.02
