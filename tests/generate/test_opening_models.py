"""Generated doors: the view through a shut one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pbrs_farm.core.mesh import triangle_corners
from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening, RoomType
from pbrs_farm.generate.opening_models import (
    HANDLES,
    LEAVES,
    LIGHTS,
    MOULDINGS,
    SASHES,
    OpeningDesign,
    opening_model,
)

WIDTH, HEIGHT = 0.9, 2.1


@pytest.mark.parametrize("leaf", [*LEAVES, *LIGHTS])
@pytest.mark.parametrize(
    ("kind", "gap_m"), [(OpeningKind.ENTRANCE, 0.0), (OpeningKind.DOOR, 0.006)]
)
def test_no_light_comes_round_a_shut_leaf(leaf: str, kind: OpeningKind, gap_m: float) -> None:
    door = PlanOpening(kind, 0, 1.0, WIDTH, HEIGHT, 0.0, 0)
    lights = leaf if leaf in LIGHTS else ""
    design = OpeningDesign(leaf=leaf, entrance=leaf, lights=lights)
    shape = opening_model(door, 0.26, design, (RoomType.LIVING,))
    corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in shape.surfaces])
    # Along the wall's normal: inner doors have a gap above the floor, others none.
    covered = shapely.union_all(shapely.polygons(corners[:, :, :2].astype(np.float64)))
    open_part = shapely.box(-WIDTH / 2, 0.0, WIDTH / 2, HEIGHT).difference(covered.buffer(1e-5))
    assert open_part.area == pytest.approx(gap_m * WIDTH, rel=0.2, abs=1e-4)
    assert open_part.is_empty or open_part.bounds[3] <= gap_m + 1e-4


@pytest.mark.parametrize("moulding", MOULDINGS)
@pytest.mark.parametrize("wall_m", [0.05, 0.1, 0.26, 0.5])
def test_a_leaf_hangs_at_the_face_to_which_it_opens(moulding: str, wall_m: float) -> None:
    for kind in LEAVES:
        for at_start in (False, True):
            door = PlanOpening(OpeningKind.DOOR, 0, 1.0, WIDTH, HEIGHT, 0.0, 0, None, at_start)
            shape = opening_model(door, wall_m, OpeningDesign(leaf=kind, moulding=moulding))
            (leaf,) = (s for s in shape.surfaces if s.name == "leaf")
            ahead = leaf.positions[:, 2].max() - shape.joints[0].point[2]
            assert -0.004 <= ahead <= 0.0095, kind


@pytest.mark.parametrize("sash", SASHES)
def test_a_larger_window_has_as_many_panes_or_more(sash: str) -> None:
    shown = []
    for width, height, sill in ((0.7, 0.9, 1.0), (0.7, 1.5, 0.6), (1.6, 1.5, 0.6)):
        window = PlanOpening(OpeningKind.WINDOW, 0, 1.0, width, height, sill, 0)
        shape = opening_model(window, 0.26, OpeningDesign(sash=sash))
        shown.append(sum(len(s.faces) for s in shape.surfaces if s.name == "pane"))
    assert shown == sorted(shown)
    if sash in ("grid", "lattice"):
        assert shown[0] < shown[1] < shown[2]


def test_some_french_windows_have_a_panel_of_wood_below() -> None:
    lowest = {}
    for sash in SASHES:
        door = PlanOpening(OpeningKind.FRENCH_WINDOW, 0, 1.0, 1.6, 2.2, 0.0, 0)
        shape = opening_model(door, 0.26, OpeningDesign(sash=sash))
        lowest[sash] = min(s.positions[:, 1].min() for s in shape.surfaces if s.name == "pane")
    assert lowest["grid"] > 0.4 > lowest["plain"]


def test_doors_of_a_home_differ_by_their_rooms_and_handles() -> None:
    door = PlanOpening(OpeningKind.DOOR, 0, 1.0, WIDTH, HEIGHT, 0.0, 0)
    built = {
        (handle, room): np.concatenate([s.positions for s in shape.surfaces]).tobytes()
        for handle in HANDLES
        for room in (RoomType.BEDROOM, RoomType.BATHROOM, RoomType.LIVING)
        for shape in [
            opening_model(door, 0.1, OpeningDesign(handle=handle, lights="half"), (room,))
        ]
    }
    assert len(set(built.values())) == len(built)
