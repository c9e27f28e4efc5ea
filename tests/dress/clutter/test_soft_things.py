"""Pillows on beds and cushions on sofas touch their support, and nothing reaches into them."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import House, Item
from pbrs_farm.core.mesh import triangle_corners
from pbrs_farm.dress.clutter import add_clutter
from pbrs_farm.dress.clutter.beds import lying_place
from pbrs_farm.dress.clutter.cushions import find_seat
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from tests.dress.furniture import boards, house, room, solid

_PILLOW = 18


def _bed() -> Item:
    # A bed whose headboard is at the wall x = 0; the mattress is 0.5 m high.
    parts = [([0.0, 0.0, 0.5], [0.05, 0.9, 2.1]), ([0.05, 0.0, 0.5], [2.05, 0.5, 2.1])]
    return boards("Bed", parts, 4)


def _sofa() -> Item:
    # A sofa with two arms whose back is at the wall z = 0; the seat is 0.42 m high.
    parts = [
        ([1.0, 0.0, 0.0], [3.0, 0.85, 0.2]), ([1.0, 0.0, 0.2], [1.15, 0.6, 0.9]),
        ([2.85, 0.0, 0.2], [3.0, 0.6, 0.9]), ([1.15, 0.0, 0.2], [2.85, 0.42, 0.9]),
    ]  # fmt: skip
    return boards("Sofa", parts, 6)


def _pillows(home: House, seed: int) -> list[Item]:
    mutable = MutableHouse(home, seed)
    add_clutter(mutable, EMPTY, style_for(np.random.default_rng(seed), "nordic"), 1.0)
    return [i for i in mutable.items[len(home.items) :] if i.nyu40 == _PILLOW]


def _points(item: Item) -> F64:
    return np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)


def _corners(item: Item) -> F64:
    return np.concatenate([triangle_corners(s.positions, s.faces) for s in item.surfaces])


def test_the_head_of_a_bed_is_at_its_board() -> None:
    bed = lying_place(SceneTriangles([_bed()]), 0, room())
    assert bed is not None
    assert bed.level == pytest.approx(0.5, abs=1e-6)
    assert bed.width == pytest.approx(1.6, abs=0.05)
    head = bed.grid.plan_of(bed.columns[0], bed.rows[0])
    assert head[0] == pytest.approx(0.05, abs=0.05)


def test_two_pillows_lie_at_the_head_of_a_double_bed() -> None:
    pillows = max((_pillows(house(_bed()), seed) for seed in range(3)), key=len)
    at_head = [p for p in pillows if p.bounds[1, 0] < 0.8]
    assert len(at_head) == 2
    for pillow in at_head:
        assert pillow.bounds[0, 0] > 0.05
        assert pillow.bounds[0, 1] == pytest.approx(0.5, abs=0.0005)
    first, two = (p.bounds for p in at_head)
    assert first[1, 2] < two[0, 2] or two[1, 2] < first[0, 2], "side by side"


def test_a_bed_with_pillows_gets_no_others_at_its_head() -> None:
    parts = [
        ([0.0, 0.0, 0.5], [2.05, 0.5, 2.1]), ([0.1, 0.5, 0.6], [0.5, 0.6, 1.25]),
        ([0.1, 0.5, 1.35], [0.5, 0.6, 2.0]),
    ]  # fmt: skip
    for seed in range(3):
        assert all(p.bounds[0, 0] > 0.5 for p in _pillows(house(boards("Bed", parts, 4)), seed))


def test_a_sofas_seat_begins_before_its_back() -> None:
    seat = find_seat(SceneTriangles([_sofa()]), 0, 0.0)
    assert seat is not None
    assert seat.level == pytest.approx(0.42, abs=1e-6)
    columns = np.flatnonzero(np.isfinite(seat.back_row))
    place = seat.grid.plan_of(columns.mean(), seat.back_row[columns[0]])
    assert place == pytest.approx([2.0, 0.2], abs=0.03)


def test_cushions_rest_on_the_seat_and_lean_on_the_back() -> None:
    sofa = _sofa()
    cushions = [c for seed in range(4) for c in _pillows(house(sofa), seed)]
    assert len(cushions) >= 4
    for cushion in cushions:
        points = _points(cushion)
        ground = highest_below(points[:, [0, 2]], _corners(sofa), 0.6)
        # It sinks in by 1.2 mm, so that more than its lowest edge touches.
        assert (points[:, 1] - ground).min() == pytest.approx(-0.0012, abs=0.0002)
        # It is at the backrest, which is 20 cm deep, and between the arms.
        assert 0.1995 < points[points[:, 1] < 0.85][:, 2].min() < 0.23
        assert points[:, 0].min() > 1.15
        assert points[:, 0].max() < 2.85


def test_nothing_is_laid_on_other_items() -> None:
    case = solid("Case", [0.1, 0.5, 0.5], [2.0, 0.7, 2.1], 37)
    assert not _pillows(house(_bed(), case), 1)


def test_highest_below_points_are_those_of_the_triangles() -> None:
    slope = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]])
    points = np.array([[0.25, 0.25], [0.5, 0.1], [0.9, 0.9]])
    assert highest_below(points, slope) == pytest.approx([0.25, 0.5, -np.inf])
    assert highest_below(points, slope, 0.3) == pytest.approx([0.25, -np.inf, -np.inf])
