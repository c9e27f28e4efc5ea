"""Scans of RoomPlan: attics below a roof, whole homes in one scan."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.house import Enclosure, House, ItemKind, geometry_from_house
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.generate.plans.plan_files import plan_from_file
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.repair import repair
from tests.inputs import plan_files

Place = tuple[float, float]
KNEE_M, RIDGE_M = 1.2, 3.0
FLOOR: list[Place] = [(-2, -1.5), (2, -1.5), (2, 1.5), (-2, 1.5)]


def surface(
    kind: str, a: Place, b: Place, low: float, high: float, corners: Sequence[Place] = ()
) -> dict[str, Any]:
    """A surface from a to b of the plan; corners: its outline in its local frame, y from its middle."""
    fields = plan_files.surface(kind, a, b, math.dist(a, b), low, high)
    return fields | {"polygonCorners": [[*c, 0] for c in corners], "story": 0}


def floor(ring: Sequence[Place]) -> dict[str, Any]:
    return {
        "category": {"floor": {}}, "dimensions": [1, 1, 0], "story": 0,
        "transform": [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1],
        "polygonCorners": [[x, z, 0] for x, z in ring],
    }  # fmt: skip


def scan(folder: Path, **surfaces: list[dict[str, Any]]) -> Path:
    value: dict[str, Any] = {k: [] for k in ("walls", "doors", "windows", "openings", "objects")}
    path = folder / "room.json"
    path.write_text(json.dumps(value | surfaces))
    return path


def gable(a: Place, b: Place) -> dict[str, Any]:
    """A wall that rises from the height of the knee walls to the ridge in its middle."""
    half, up = math.dist(a, b) / 2, RIDGE_M / 2
    outline = [(-half, KNEE_M - up), (0, up), (half, KNEE_M - up), (half, -up), (-half, -up)]
    return surface("wall", a, b, 0, RIDGE_M, outline)


def attic(folder: Path) -> Path:
    """4 m by 3 m below a roof; a door in one gable, a window in the other."""
    nw, ne, se, sw = FLOOR
    walls = [surface("wall", nw, ne, 0, KNEE_M), surface("wall", se, sw, 0, KNEE_M),
             gable(ne, se), gable(sw, nw)]  # fmt: skip
    return scan(
        folder, walls=walls, floors=[floor(FLOOR)],
        doors=[surface("door", (2, -0.4), (2, 0.4), 0, 2)],
        windows=[surface("window", (-2, -0.45), (-2, 0.45), 1.15, 2.05)],
    )  # fmt: skip


def house_of(path: Path) -> House:
    return read_house(resolve(str(path)), ReadFields())


def test_an_attic_has_a_ceiling_from_its_knee_walls_to_the_ridge(tmp_path: Path) -> None:
    house = house_of(attic(tmp_path))
    (ceiling,) = (i.surfaces[0] for i in house.items if i.kind is ItemKind.CEILING)
    away = np.abs(ceiling.positions[:, 2] - 1.5)
    np.testing.assert_allclose(
        ceiling.positions[:, 1], RIDGE_M - away / 1.5 * (RIDGE_M - KNEE_M), atol=1e-3
    )
    assert np.ptp(ceiling.positions[:, 1]) == pytest.approx(RIDGE_M - KNEE_M, abs=1e-3)
    assert house.rooms[0].ceiling_y == pytest.approx(RIDGE_M, abs=1e-3)
    assert not house.notes


def test_an_attic_keeps_its_window_and_door_and_no_light_leaks_in(tmp_path: Path) -> None:
    house = house_of(attic(tmp_path))
    heights = sorted((float(o.quad[:, 1].min()), float(o.quad[:, 1].max())) for o in house.openings)
    np.testing.assert_allclose(heights, [(0, 2), (1.15, 2.05)], atol=2e-3)
    repaired, report = repair(
        house, Recipe().repair, occluder_from=lambda some: Caster(geometry_from_house(some))
    )
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert [r.enclosure for r in repaired.rooms] == [Enclosure.CLOSED]


def test_an_opening_ends_below_the_slope_over_it(tmp_path: Path) -> None:
    path = attic(tmp_path)
    value = json.loads(path.read_text())
    # At its start, 1.2 m from the ridge, the gable is 1.56 m high.
    value["windows"] = [surface("window", (-2, 0.4), (-2, 1.2), 0.9, 2.0)]
    path.write_text(json.dumps(value))
    (window,) = (o for o in plan_from_file(path).plan.openings if o.kind.value == "window")
    assert window.sill + window.height == pytest.approx(1.56 - 0.03, abs=2e-3)


def test_a_flat_top_between_two_slopes_is_level(tmp_path: Path) -> None:
    path = attic(tmp_path)
    value = json.loads(path.read_text())
    outline = [(-1.5, -0.3), (-0.5, 1.5), (0.5, 1.5), (1.5, -0.3), (1.5, -1.5), (-1.5, -1.5)]
    for wall in value["walls"][2:]:
        wall["polygonCorners"] = [[*c, 0] for c in outline]
    path.write_text(json.dumps(value))
    house = house_of(path)
    (ceiling,) = (i.surfaces[0] for i in house.items if i.kind is ItemKind.CEILING)
    under_ridge = np.abs(ceiling.positions[:, 2] - 1.5) < 0.5 + 1e-3
    np.testing.assert_allclose(ceiling.positions[under_ridge, 1], RIDGE_M, atol=1e-3)
    assert under_ridge.sum() >= 4


def test_walls_of_two_heights_without_a_slope_are_a_note(tmp_path: Path) -> None:
    path = attic(tmp_path)
    value = json.loads(path.read_text())
    for wall in value["walls"]:
        wall["polygonCorners"] = None
    path.write_text(json.dumps(value))
    (note,) = plan_from_file(path).left_out
    assert note.startswith("walls of 1.20 to 3.00 m have one ceiling, at 2.10 m")


def test_an_outline_without_area_is_the_walls_rectangle(tmp_path: Path) -> None:
    path = attic(tmp_path)
    value = json.loads(path.read_text())
    for row in (*value["walls"], *value["doors"]):
        row["polygonCorners"] = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    # A self-intersecting floor has no rooms.
    value["floors"][0]["polygonCorners"] = [[-2, -1.5, 0], [2, 1.5, 0], [2, -1.5, 0], [-2, 1.6, 0]]
    path.write_text(json.dumps(value))
    assert not any(w.tops for w in plan_from_file(path).plan.walls)


def test_a_floor_of_three_corners_is_a_room(tmp_path: Path) -> None:
    ring: list[Place] = [(-2, -1.5), (2, -1.5), (-2, 1.5)]
    sides = zip(ring, [*ring[1:], ring[0]], strict=True)
    walls = [surface("wall", a, b, 0, 2.5) for a, b in sides]
    plan = plan_from_file(scan(tmp_path, walls=walls, floors=[floor(ring)])).plan
    assert len(plan.walls) == 3
    (room,) = plan.rooms
    assert room.area == pytest.approx(6, rel=0.1)


def test_slopes_below_another_storey_are_a_note(tmp_path: Path) -> None:
    path = attic(tmp_path)
    value = json.loads(path.read_text())
    upper = [surface("wall", a, b, 3.3, 5.8) | {"story": 1}
             for a, b in zip(FLOOR, [*FLOOR[1:], FLOOR[0]], strict=True)]  # fmt: skip
    value["walls"] += upper
    path.write_text(json.dumps(value))
    file = plan_from_file(path)
    assert file.left_out == ("walls rise to a roof below another storey: its ceilings are level",)
    assert not any(w.tops for s in file.storeys for w in s.plan.walls)


def whole_home(folder: Path) -> Path:
    """A home of 8 m by 6 m in one scan with a single floor: a living room, a hall, a bathroom.

    The wall between is scanned from both sides and ends at a doorway; the bathroom's has a door.
    """
    ring: list[Place] = [(0, 0), (8, 0), (8, 6), (0, 6)]
    lines = [*zip(ring, [*ring[1:], ring[0]], strict=True),
             ((4.95, 0.05), (4.95, 2.6)), ((5.05, 2.6), (5.05, 0.05)), ((4.95, 3.5), (4.95, 5.95)),
             ((5.05, 5.95), (5.05, 3.5)), ((5.1, 4), (7.95, 4))]  # fmt: skip
    toilet = {"category": {"toilet": {}}, "dimensions": [0.4, 0.8, 0.7],
              "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 6, 0.4, 5.6, 1]}  # fmt: skip
    return scan(
        folder, walls=[surface("wall", a, b, 0, 2.5) for a, b in lines], floors=[floor(ring)],
        doors=[surface("door", (6, 4), (6.8, 4), 0, 2)], objects=[toilet],
    )  # fmt: skip


def test_a_home_in_one_scan_has_its_rooms(tmp_path: Path) -> None:
    file = plan_from_file(whole_home(tmp_path))
    assert file.left_out == ()
    rooms = file.plan.rooms
    areas = {r.type.value: r.area for r in rooms}
    assert areas == {
        "living": pytest.approx(4.95 * 6, rel=0.03),
        "bathroom": pytest.approx(2.95 * 2, rel=0.08),
        "hall": pytest.approx(2.95 * 4, rel=0.08),
    }


def test_the_doorway_between_two_walls_stays_open(tmp_path: Path) -> None:
    house = house_of(whole_home(tmp_path))
    middle = np.array([5.0, 1.0, 3.05])
    near = [o for o in house.openings if np.abs(o.quad.mean(0) - middle)[[0, 2]].max() < 0.2]
    assert len(near) == 1
    assert near[0].quad[:, 1].max() > 1.9


@pytest.mark.parametrize("has_floor", [True, False])
def test_a_wide_opening_between_two_walls_closes_its_rooms(tmp_path: Path, has_floor: bool) -> None:
    ring: list[Place] = [(0, 0), (8, 0), (8, 6), (0, 6)]
    lines = [
        *zip(ring, [*ring[1:], ring[0]], strict=True),
        ((5, 0.05), (5, 2)),
        ((5, 4), (5, 5.95)),
    ]
    path = scan(
        tmp_path, walls=[surface("wall", a, b, 0, 2.5) for a, b in lines],
        floors=[floor(ring)] if has_floor else [], openings=[surface("opening", (5, 2), (5, 4), 0, 2.2)],
    )  # fmt: skip
    plan = plan_from_file(path).plan
    assert sorted(r.area for r in plan.rooms) == pytest.approx([18, 30], rel=0.04)
    (passage,) = plan.openings
    assert (passage.kind.value, passage.width) == ("passage", pytest.approx(2.0))
