"""Frames coplanar with their walls are moved half a millimetre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.house import Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.solids import box
from pbrs_farm.repair import repair, summary_of_report
from pbrs_farm.repair.structure.frames_apart import (
    MOVED_M,
    most_shared_m2,
    with_frames_apart,
    with_parts_apart,
)
from tests.inputs.windowed_room import RECT, with_window
from tests.repair.wall_rooms import WALL, covers, house, room, walls_around


def test_a_frame_as_thick_as_its_wall_is_moved_out_on_both_sides() -> None:
    after, report = repair(with_window(0.2), RepairFields())
    low, high = next(i for i in after.items if i.id == "window").bounds
    assert high[2] == pytest.approx(MOVED_M, abs=1e-6)
    assert low[2] == pytest.approx(-0.2 - MOVED_M, abs=1e-6)
    assert (high - low)[:2] == pytest.approx([1.2, 1.2], abs=1e-6)
    assert report.structure.n_frames_moved == 1
    assert "1 piece coincided with faces of walls" in summary_of_report(report)


@pytest.mark.parametrize("depth_m", [0.1, 0.1996, 0.21])
def test_a_frame_inside_or_before_its_wall_stays(depth_m: float) -> None:
    source = with_window(depth_m)
    after, report = repair(source, RepairFields())
    window = next(i for i in after.items if i.id == "window")
    assert window.surfaces[0].positions.tolist() == source.items[-1].surfaces[0].positions.tolist()
    assert report.structure.n_frames_moved == 0


def test_a_frame_that_fills_its_hole_shares_no_face_with_the_wall() -> None:
    _, report = repair(with_window(0.2, hole_m=0.6), RepairFields())
    assert report.structure.n_frames_moved == 0


def test_moving_apart_twice_is_moving_once() -> None:
    once, n = with_frames_apart(with_window(0.2))
    assert n == 1
    assert with_frames_apart(once)[1] == 0


@pytest.mark.parametrize(("centre", "half", "axis", "moved_to"), [
    ([1.0, 1.4, 0.0], [0.3, 0.4, 0.0], 2, MOVED_M),  # a picture drawn on the wall below z = 0
    ([2.0, 0.0, 1.5], [0.6, 0.0, 0.4], 1, MOVED_M),  # a rug drawn on the floor
])  # fmt: skip
def test_an_item_coplanar_with_a_wall_or_floor_is_moved_out_of_it(
    centre: list[float], half: list[float], axis: int, moved_to: float
) -> None:
    r = room("0_0", RECT)
    sheet = box("sheet", np.array(centre), np.maximum(half, 1e-9), WALL)
    facing = area_vectors(corners_of_surfaces([sheet]))[:, axis] > 1e-6
    thing = Item("sheet", "sheet", ItemKind.OBJECT, "0", (replace(sheet, faces=sheet.faces[facing]),), nyu40=11)  # fmt: skip
    after, report = repair(house([*walls_around(RECT), *covers(r), thing], [r]), RepairFields())
    low, high = next(i for i in after.items if i.id == "sheet").bounds
    assert low[axis] == pytest.approx(moved_to, abs=1e-6)
    assert high[axis] == pytest.approx(moved_to, abs=1e-6)
    assert report.structure.n_frames_moved == 1


def _oven(pane_depth_m: float, pane_half_m: float = 0.2) -> Item:
    """An oven with its front at z = 0.5, and a pane in it whose face is at z = pane_depth_m."""
    body = box("body", np.array([1.0, 0.4, 0.2]), np.array([0.3, 0.4, 0.3]), 0)
    half = np.array([pane_half_m, pane_half_m, 0.02])
    pane = box("pane", np.array([1.0, 0.4, pane_depth_m - 0.02]), half, 1)
    return Item("oven", "oven", ItemKind.OBJECT, "0", (body, pane), nyu40=24)


def _front(item: Item, material: int) -> float:
    return float(max(s.positions[:, 2].max() for s in item.surfaces if s.material == material))


def test_a_pane_in_the_plane_of_its_door_is_moved_out_of_it() -> None:
    after, n = with_parts_apart(house([_oven(0.5)], [room("0_0", RECT)]))
    assert n == 1
    assert _front(after.items[0], 0) == pytest.approx(0.5, abs=1e-6)
    assert _front(after.items[0], 1) == pytest.approx(0.5 + MOVED_M, abs=1e-6)
    assert with_parts_apart(after)[1] == 0


@pytest.mark.parametrize(("depth_m", "half_m"), [(0.501, 0.2), (0.49, 0.2), (0.5, 0.01)])
def test_a_part_that_shares_no_face_to_be_seen_stays(depth_m: float, half_m: float) -> None:
    source = house([_oven(depth_m, half_m)], [room("0_0", RECT)])
    assert with_parts_apart(source) == (source, 0)


def test_three_coplanar_pieces_are_all_moved_apart() -> None:
    pieces = [replace(_oven(0.3), id=name, name=name) for name in ("a", "b", "c")]
    after, n = with_parts_apart(house(pieces, [room("0_0", RECT)]))
    fronts = sorted(_front(item, 0) for item in after.items)
    assert n > 0
    assert np.diff(fronts).min() > 0.9 * MOVED_M


def test_a_home_without_furniture_is_unchanged() -> None:
    source = house([*walls_around(RECT), *covers(room("0_0", RECT))], [room("0_0", RECT)])
    assert with_parts_apart(source) == (source, 0)


def test_two_parts_share_no_more_than_the_early_exit_says() -> None:
    dice = np.random.default_rng(5)
    axes = np.eye(3)[:2]
    n_shared = 0
    for _ in range(300):
        # Triangles of a plane, from slivers to wide ones, in parts of one to eight.
        parts = []
        for n in dice.integers(1, 9, 2):
            centre, angle = dice.uniform(-0.1, 0.1, (n, 1, 2)), dice.uniform(0, np.pi, n)
            flat = dice.uniform(-1, 1, (n, 3, 2)) * 10 ** dice.uniform(
                [-1, -4], [0, -0.5], (n, 1, 2)
            )
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            plan = centre + np.einsum("ijn,nkj->nki", turn, flat)
            parts.append(np.concatenate([plan, np.zeros((n, 3, 1))], 2))
        outlines = (
            shapely.union_all(shapely.polygons(part @ axes.T), grid_size=1e-6) for part in parts
        )
        shared = shapely.area(shapely.intersection(*outlines))
        assert most_shared_m2(parts[0], parts[1], axes) >= 0.9 * shared
        n_shared += shared > 1e-3
    assert 50 < n_shared < 250
