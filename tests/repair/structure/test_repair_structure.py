"""Walls, floors and ceilings of small houses after repair: solid, joined, without coinciding faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pbrs_farm.core.house import Enclosure, House, Item, ItemKind, Opening, Surface
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.solids import box
from pbrs_farm.repair import RepairReport, repair
from pbrs_farm.repair.structure.booleans import TagTable
from pbrs_farm.repair.structure.walls import walls_from_house
from tests.hypothesis_profiles import examples
from tests.repair.embree import EmbreeOccluder
from tests.repair.shells import (
    coinciding_share,
    leaning_area,
    seen_from,
    structure_of,
    unpaired_edges,
)
from tests.repair.wall_rooms import (
    covers,
    house,
    mitred_walls,
    planar_walls,
    room,
    turned,
    wall,
    walls_around,
)

RECT = (0.0, 0.0, 4.0, 3.0)
MIDDLE = (2.0, 1.3, 1.5)


def _repaired(source: House) -> tuple[House, RepairReport]:
    after, report = repair(source, RepairFields(fallback_light=False), occluder_from=EmbreeOccluder)
    assert leaning_area(after) == 0.0
    return after, report


def _sky(report: RepairReport) -> int:
    assert report.leaks is not None
    assert report.leaks.spaces
    assert report.leaks.n_blind < 0.01 * report.leaks.n_rays
    return report.leaks.n_sky


def test_planar_walls_become_solids_of_ten_centimetres_away_from_the_room() -> None:
    r = room("0_0", RECT)
    after, report = _repaired(house([*planar_walls(RECT), *covers(r)], [r]))
    assert report.structure.n_walls_thickened == 4
    assert len(unpaired_edges(after)) == 0
    assert _sky(report) == 0
    assert after.rooms[0].enclosure is Enclosure.CLOSED
    bounds = np.array([i.bounds for i in after.items if i.kind is ItemKind.WALL])
    assert bounds[:, 0].min(0)[[0, 2]] == pytest.approx([-0.1, -0.1], abs=1e-5)
    assert bounds[:, 1].max(0)[[0, 2]] == pytest.approx([4.1, 3.1], abs=1e-5)
    # From outside there is no gap in the corner between two walls.
    outside = seen_from(after, (-1.0, 1.3, -1.0))
    assert "joint" in {name for _, name in outside}
    assert {name for _, name in seen_from(after, MIDDLE)} == {"plane", "floor", "ceiling"}


def test_an_open_wall_is_left_unchanged_with_a_note() -> None:
    r = room("0_0", RECT)
    first, *rest = walls_around(RECT)
    gap = replace(first, surfaces=first.surfaces[:-1])
    after, report = _repaired(house([gap, *rest, *covers(r)], [r]))
    assert [(x.what, x.id) for x in report.structure.left_as_is] == [("wall", "w0")]
    assert after.items[0].surfaces == gap.surfaces


def test_walls_drawn_twice_leave_one_face() -> None:
    r = room("0_0", RECT)
    twice = [*walls_around(RECT), *walls_around(RECT, "again")]
    after, report = _repaired(house([*twice, *covers(r)], [r]))
    assert len(unpaired_edges(after)) == 0
    assert coinciding_share(after, MIDDLE) < 1e-3
    assert _sky(report) == 0


def test_adjacent_slabs_show_each_room_its_floor() -> None:
    a, b = room("0_0", RECT), room("0_1", (4.1, 0.0, 8.0, 3.0))
    walls = [
        *walls_around((0.0, 0.0, 8.0, 3.0)),
        wall("between", (4.05, 0.0), (4.05, 3.0), thickness=0.1),
    ]
    after, report = _repaired(house([*walls, *covers(a), *covers(b)], [a, b]))
    assert len(unpaired_edges(after)) == 0
    assert _sky(report) == 0
    for origin, room_id in ((MIDDLE, "0_0"), ((6.0, 1.3, 1.5), "0_1")):
        lids_seen = {i for i, _ in seen_from(after, origin) if not i.startswith(("w", "between"))}
        assert lids_seen == {f"floor_{room_id}", f"ceiling_{room_id}"}
        assert coinciding_share(after, origin) < 1e-3  # fmt: skip


def test_a_floor_whose_picture_ends_within_it_keeps_its_mapping() -> None:
    """Left of x = 2 the picture repeats each metre, right of it one texel continues, as a clamped wrap does."""
    r = room("0_0", RECT)
    floor, ceiling = covers(r)
    points = np.array([(x, 0.0, z) for x in (0.0, 2.0, 2.0, 4.0) for z in (0.0, 3.0)], np.float32)
    uvs = np.where(np.arange(8)[:, None] < 4, points[:, [0, 2]], 0.25).astype(np.float32)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]], np.int32)
    sheet = replace(
        floor.surfaces[0], positions=points, faces=faces, uvs=uvs,
        normals=np.tile(np.float32([0, 1, 0]), (8, 1)),
    )  # fmt: skip
    drawn = replace(floor, surfaces=(sheet,))
    after, _ = _repaired(house([*walls_around(RECT), drawn, ceiling], [r]))
    assert len(unpaired_edges(after)) == 0
    surfaces = [s for i in after.items if i.id == floor.id for s in i.surfaces if s.name == "floor"]
    area = {"left": 0.0, "right": 0.0}
    for surface in surfaces:
        assert surface.uvs is not None
        for face in surface.faces:
            x, z = surface.positions[face][:, 0], surface.positions[face][:, 2]
            if x.min() < -1e-3 or x.max() > 4 + 1e-3 or z.min() < -1e-3 or z.max() > 3 + 1e-3:
                continue  # under the walls
            side = "left" if x.mean() < 2 else "right"
            expected = np.column_stack([x, z]) if side == "left" else np.full((3, 2), 0.25)
            assert surface.uvs[face] == pytest.approx(expected, abs=1e-4)
            area[side] += 0.5 * abs(
                np.linalg.det([[x[1] - x[0], z[1] - z[0]], [x[2] - x[0], z[2] - z[0]]])
            )
    assert area == pytest.approx({"left": 6.0, "right": 6.0}, rel=1e-3)


def test_a_wall_whose_picture_ends_within_it_keeps_its_mapping() -> None:
    r = room("0_0", RECT)
    walls = planar_walls(RECT)
    drawn = next(w for w in walls if np.ptp(w.bounds[:, 2]) == 0 and w.bounds[0, 2] == 0)
    points = np.array([(x, y, 0.0) for x in (0.0, 2.0, 2.0, 4.0) for y in (0.0, 2.5)], np.float32)
    uvs = np.where(np.arange(8)[:, None] < 4, points[:, [0, 1]], 0.25).astype(np.float32)
    faces = np.array([[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]], np.int32)
    sheet = replace(
        drawn.surfaces[0], positions=points, faces=faces, uvs=uvs,
        normals=np.tile(np.float32([0, 0, 1]), (8, 1)),
    )  # fmt: skip
    walls[walls.index(drawn)] = replace(drawn, surfaces=(sheet,))
    after, report = _repaired(house([*walls, *covers(r)], [r]))
    assert len(unpaired_edges(after)) == 0
    assert _sky(report) == 0
    surfaces = [s for i in after.items if i.id == drawn.id for s in i.surfaces if s.name == "plane"]
    for surface in surfaces:
        assert surface.uvs is not None
        corners, uv = surface.positions[surface.faces], surface.uvs[surface.faces]
        is_left = corners[..., 0].mean(1) < 2
        assert uv[is_left] == pytest.approx(corners[is_left][..., :2], abs=1e-4)
        assert (uv[~is_left] == 0.25).all()
        assert is_left.any()
        assert not is_left.all()
    assert surfaces


def test_a_floor_continues_through_a_doorway() -> None:
    a, b = room("0_0", RECT), room("0_1", (4.3, 0.0, 8.0, 3.0))
    walls = [
        *walls_around((0.0, 0.0, 8.0, 3.0)),
        wall("between", (4.15, 0.0), (4.15, 3.0), thickness=0.3),
    ]
    cutter = box("cutter", np.array([4.15, 1.0, 1.5]), np.array([0.2, 1.0, 0.45]), 0)
    quad = np.array([[4.15, 0, 1.05], [4.15, 0, 1.95], [4.15, 2, 1.95], [4.15, 2, 1.05]])
    door = Opening("door", "0", None, False, cutter, quad, np.array([1.0, 0, 0]))
    source = replace(house([*walls, *covers(a), *covers(b)], [a, b]), openings=(door,))
    after, report = _repaired(source)
    # Straight down anywhere in the doorway: one of the two floors, at floor height.
    shell = structure_of(after)
    x = np.linspace(4.01, 4.29, 29)
    origins = np.stack([x, np.full(29, 1.0), np.full(29, 1.5)], 1).astype(np.float32)
    down = np.tile(np.array([0, -1, 0], np.float32), (29, 1))
    distance, _ = EmbreeOccluder(shell).first_hit(origins, down)
    assert distance == pytest.approx(1.0, abs=1e-5)
    assert _sky(report) == 0
    assert sum(n for (i, _), n in seen_from(after, (4.15, 1.0, 1.5)).items() if i == "between") > 0  # fmt: skip


def test_a_slab_never_sticks_into_a_neighbour_at_another_height() -> None:
    # The second room's floor is 4 cm lower, behind a wall of 5 cm.
    a = room("0_0", RECT)
    b = room("0_1", (4.05, 0.0, 8.0, 3.0), floor_y=-0.04, ceiling_y=2.46)
    walls = [
        *walls_around((0.0, 0.0, 8.0, 3.0), bottom=-0.04),
        wall("between", (4.025, 0.0), (4.025, 3.0), thickness=0.05, bottom=-0.04),
    ]
    after, report = _repaired(house([*walls, *covers(a), *covers(b)], [a, b]))
    assert _sky(report) == 0
    for origin, room_id in ((MIDDLE, "0_0"), ((6.0, 1.3, 1.5), "0_1")):
        lids_seen = {i for i, _ in seen_from(after, origin) if not i.startswith(("w", "between"))}
        assert lids_seen == {f"floor_{room_id}", f"ceiling_{room_id}"}


def test_a_slab_of_an_upper_room_leaves_the_room_below_its_height() -> None:
    # The floors are 3 cm apart: a slab of 10 cm would come through the ceiling.
    a, b = room("0_0", RECT), room("1_0", RECT, floor_y=2.53, ceiling_y=5.0)
    walls = [*walls_around(RECT), *walls_around(RECT, "up", bottom=2.5, top=5.0)]
    after, report = _repaired(house([*walls, *covers(a), *covers(b)], [a, b]))
    assert len(unpaired_edges(after)) == 0
    assert _sky(report) == 0
    assert ("ceiling_0_0", "ceiling") in seen_from(after, MIDDLE)
    assert ("floor_1_0", "floor") in seen_from(after, (2.0, 3.8, 1.5))
    assert not any(i == "floor_1_0" for i, _ in seen_from(after, MIDDLE))


def test_a_stairwell_that_no_room_covers_gets_the_lid_it_lacks() -> None:
    # Below a room of the whole plan; above it a room that excludes the stairwell: x > 3.
    a = room("0_0", RECT)
    b = room("1_0", (0.0, 0.0, 3.0, 3.0), floor_y=2.6, ceiling_y=5.1)
    walls = [*walls_around(RECT), *walls_around(RECT, "up", bottom=2.5, top=5.1)]
    below = replace(a, polygon=np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]]))
    ceiling = covers(below, floor=False)
    stairs = Item(
        "stairs", "stairs", ItemKind.STAIRS, "0",
        (box("steps", np.array([3.5, 1.3, 1.5]), np.array([0.4, 1.3, 1.0]), 0),),
    )  # fmt: skip
    items = [*walls, *covers(a, ceiling=False), *ceiling, *covers(b), stairs]
    after, report = _repaired(house(items, [a, b]))
    assert report.structure.n_stairwells_closed == 1
    assert {x.space for x in report.rooms} == {("0_0", "1_0")}
    assert {r.enclosure for r in after.rooms} == {Enclosure.CLOSED}
    assert _sky(report) == 0


def test_uv_of_a_source_is_carried_to_the_new_solid() -> None:
    # A plank pattern turned by 30 degrees and scaled by 3: an affine map of the plan.
    r = room("0_0", RECT)
    floor, ceiling = covers(r)
    c, s = 3 * np.cos(np.pi / 6), 3 * np.sin(np.pi / 6)
    plan = floor.surfaces[0].positions[:, [0, 2]]
    uvs = (plan @ np.array([[c, s], [-s, c]]) + [0.3, 0.7]).astype(np.float32)
    floor = replace(floor, surfaces=(replace(floor.surfaces[0], uvs=uvs),))
    after, _ = _repaired(house([*walls_around(RECT), floor, ceiling], [r]))
    face = next(s for i in after.items for s in i.surfaces if s.name == "floor")
    assert face.uvs is not None
    want = face.positions[:, [0, 2]] @ np.array([[c, s], [-s, c]]) + [0.3, 0.7]
    assert face.uvs == pytest.approx(want, abs=1e-4)


def test_no_light_passes_a_mitre_above_walls_that_end_below_the_ceiling() -> None:
    r = room("0_0", RECT)
    after, report = _repaired(house([*mitred_walls(RECT, top=2.47), *covers(r)], [r]))
    assert _sky(report) == 0
    # From the room's corner along the diagonal, at heights between the walls and the ceiling.
    y = np.linspace(2.472, 2.498, 14)
    origins = np.stack([np.full(14, 1e-3), y, np.full(14, 1e-3)], 1).astype(np.float32)
    outward = np.tile(np.array([-0.5, 0, -0.5], np.float32) * np.sqrt(2), (14, 1))
    distance, _ = EmbreeOccluder(structure_of(after)).first_hit(origins, outward.astype(np.float32))
    assert distance.max() < 0.02


@settings(max_examples=examples(12), deadline=None)
@example(angle=0.0, gaps=(0.0,) * 4, slack=0.03125, thickness=0.03125, lifts=(0.0, 0.03125))
@example(
    angle=1.375, gaps=(0.0, 0.0, 0.015625, 0.0), slack=0.03125, thickness=0.03125, lifts=(0.0, 0.0)
)
@example(
    angle=0.785398, gaps=(0.01, 0.0, 0.01, 0.015625), slack=0.0, thickness=0.1, lifts=(0.001, 0.01)
)
@example(
    angle=0.2735617020880154,
    gaps=(0.015922034331182396, 0.0005, 0.0, 0.0),
    slack=0.039,
    thickness=0.04,
    lifts=(0.03824808627819242, 0.03125),
)
@given(
    angle=st.floats(0.0, 3.14),
    gaps=st.tuples(*[st.floats(0.0, 0.04)] * 4),
    slack=st.floats(0.0, 0.04),
    thickness=st.floats(0.03, 0.4),
    lifts=st.tuples(st.floats(0.0, 0.04), st.floats(0.0, 0.04)),
)
def test_badly_drawn_rooms_are_tight_after_repair(
    angle: float,
    gaps: tuple[float, ...],
    slack: float,
    thickness: float,
    lifts: tuple[float, float],
) -> None:
    # Walls up to 4 cm from their exact place at floor and ceiling, at any angle.
    x0, z0, x1, z1 = RECT
    rect = (x0 - gaps[0], z0 - gaps[1], x1 + gaps[2], z1 + gaps[3])
    walls = walls_around(rect, thickness=thickness, bottom=lifts[0], top=2.5 - lifts[1])
    shorter = [_shortened(w, slack) for w in walls]
    r = room("0_0", RECT)
    after, report = _repaired(turned(house([*shorter, *covers(r)], [r]), angle))
    assert after.rooms[0].enclosure is Enclosure.CLOSED
    assert _sky(report) == 0
    assert len(unpaired_edges(after)) == 0
    again, _ = repair(after, RepairFields())
    assert again is after


def _shortened(source: Item, by_m: float) -> Item:
    """The wall with both ends shortened, so that it may miss its neighbours."""
    low, high = source.bounds
    axis = int(np.argmax((high - low)[[0, 2]])) * 2
    middle = 0.5 * (low[axis] + high[axis])
    surfaces = []
    for s in source.surfaces:
        positions = s.positions.copy()
        positions[:, axis] -= (np.sign(positions[:, axis] - middle) * by_m).astype(np.float32)
        surfaces.append(replace(s, positions=positions))
    return replace(source, surfaces=tuple(surfaces))


def test_a_gable_is_as_high_as_its_slopes() -> None:
    gable = np.array([(0, 0), (4, 0), (4, 1), (2, 3), (0, 1)], float)
    n = len(gable)
    points = np.array([(x, y, z) for z in (0.0, 0.3) for x, y in gable], np.float32)
    faces = [(0, k + 1, k) for k in range(1, n - 1)] + [
        (n, n + k, n + k + 1) for k in range(1, n - 1)
    ]
    for k in range(n):
        j = (k + 1) % n
        faces += [(k, j, n + k), (j, n + j, n + k)]
    surface = Surface("left", points, np.array(faces, np.int32), 0)
    item = Item("gable", "gable", ItemKind.WALL, "0", (surface,))
    walls, rest = walls_from_house(house([item], [room("0_0", (0, 0, 4, 4))]), TagTable(), shapely.Polygon(), 0.2)  # fmt: skip
    assert not rest
    x = np.array([[0.0, 0.15], [1.0, 0.15], [2.0, 0.15], [3.5, 0.15]])
    assert walls[0].top_at(x) == pytest.approx([1.0, 2.0, 3.0, 1.5], abs=1e-5)
