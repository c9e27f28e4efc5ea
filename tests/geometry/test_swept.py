"""The ground that doors and drawers sweep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import box

from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.joints import JointKind
from pbrs_farm.dress.mutable_house import moved_item
from pbrs_farm.geometry.swept import floor_swept, swept_by_item
from tests.inputs.cupboards import DEEP, WIDE, cupboard


def test_a_drawer_sweeps_its_front_as_far_as_it_comes_out() -> None:
    (swept,) = swept_by_item(cupboard(JointKind.PRISMATIC))
    assert swept.area.bounds == pytest.approx((0.0015, 0.0, WIDE - 0.0015, DEEP + 0.4))
    assert swept.area.area == pytest.approx((WIDE - 0.003) * (DEEP + 0.4))
    assert (swept.low_y, swept.high_y) == pytest.approx((0.002, 0.698))


def test_a_door_sweeps_the_sector_about_its_hinge() -> None:
    (swept,) = swept_by_item(cupboard(JointKind.REVOLUTE))
    radius = np.hypot(WIDE - 0.003, DEEP)
    # From above: 110 degrees about the hinge, plus the door's thickness at its shut end.
    sector = np.radians(110) / 2 * radius**2
    assert swept.area.area == pytest.approx(sector, rel=0.04)
    assert swept.area.bounds[3] == pytest.approx(DEEP + radius, abs=0.01)


def test_a_turned_cupboard_sweeps_the_same_ground_turned() -> None:
    turn = np.array([[np.cos(0.5), 0, np.sin(0.5)], [0, 1, 0], [-np.sin(0.5), 0, np.cos(0.5)]])
    shut = cupboard(JointKind.PRISMATIC)
    (swept,) = swept_by_item(moved_item(shut, np.array([3.0, 0.0, 1.0]), turn))
    assert swept.area.area == pytest.approx((WIDE - 0.003) * (DEEP + 0.4), rel=1e-4)


def test_doorways_and_overhead_fronts_sweep_no_ground() -> None:
    shut = cupboard(JointKind.PRISMATIC)
    assert swept_by_item(replace(shut, kind=ItemKind.DOOR)) == []
    high = moved_item(shut, np.array([0.0, 1.5, 0.0]))
    assert floor_swept([high], 0.0).is_empty
    assert floor_swept([shut, high], 0.0).equals(floor_swept([shut], 0.0))
    assert floor_swept([shut], 0.0).intersects(box(0.2, 0.2, 0.3, 0.3))
