"""How little was tidied up: chairs, pictures, beds, clothes; never against a gate, and none of it at 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.catalogue import EMPTY, Piece, Place, Shape
from pbrs_farm.core.classes import BED, CHAIR, PICTURE, TABLE
from pbrs_farm.core.house import House, Item, Material
from pbrs_farm.core.mesh import edges_are_paired, triangle_corners
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.dress.clutter import add_clutter
from pbrs_farm.dress.clutter.cloth_ground import CELL_M, Ground
from pbrs_farm.dress.clutter.cloths import drop_clothes
from pbrs_farm.dress.clutter.drapes import (
    MOST_STRETCH,
    Folds,
    Net,
    drape,
    flat_net,
    lie_flat,
    sheet_of,
)
from pbrs_farm.dress.clutter.placing import Placing, separate_pair
from pbrs_farm.dress.clutter.stock import Stock
from pbrs_farm.dress.gates import keep_gates
from pbrs_farm.dress.mess import move_chairs, tilt_pictures
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.furnishings.things.book_covers import book_covers
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.plan_grid import PlanGrid
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.solids import box
from pbrs_farm.geometry.surface_points import item_triangles
from tests.dress.furniture import boards, house, solid

STYLE = style_for(np.random.default_rng(1), "nordic")
TABLE_ITEM = replace(solid("table", [1.2, 0.72, 1.0], [2.8, 0.75, 1.8]), nyu40=TABLE)


def _chair(name: str, x: float, z: float) -> Item:
    """A chair 40 cm wide before the table, its back to -z."""
    parts = [([x, 0.0, z], [x + 0.4, 0.45, z + 0.4]), ([x, 0.45, z], [x + 0.4, 0.9, z + 0.03])]
    return boards(name, parts, CHAIR)


def _dining() -> House:
    return house(TABLE_ITEM, _chair("a", 1.4, 0.7), _chair("b", 2.0, 0.7))


def _moves(seed: int, share: float) -> list[float]:
    mutable = MutableHouse(_dining(), seed, share)
    move_chairs(mutable, EMPTY, STYLE, share)
    pairs = zip(mutable.items[1:], mutable.source.items[1:], strict=True)
    return [float(np.linalg.norm(a.bounds.mean(0) - b.bounds.mean(0))) for a, b in pairs]


def test_chairs_stand_apart_by_a_few_centimetres_and_some_are_pulled_out() -> None:
    few = [m for seed in range(12) for m in _moves(seed, 0.001)]
    many = [m for seed in range(12) for m in _moves(seed, 1.0)]
    assert len({round(m, 3) for m in few}) > 12
    assert max(few) < 0.2
    assert np.mean([m > 0.1 for m in many]) > 0.6


def test_a_chair_is_not_pulled_into_what_stands_behind_it_or_through_a_wall() -> None:
    cupboard = solid("cupboard", [1.0, 0.0, 0.35], [3.0, 1.0, 0.66])
    for seed in range(8):
        mutable = MutableHouse(house(TABLE_ITEM, _chair("a", 1.4, 0.7), cupboard), seed, 1.0)
        move_chairs(mutable, EMPTY, STYLE, 1.0)
        assert mutable.items[1].bounds[0, 2] > 0.64
        keep_gates(mutable, {})
        assert not mutable.refused["swap: stood in another thing"]
        at_wall = MutableHouse(house(TABLE_ITEM, _chair("a", 1.4, 0.02)), seed, 1.0)
        move_chairs(at_wall, EMPTY, STYLE, 1.0)
        assert at_wall.items[1].bounds[0, 2] > -0.001


def test_a_picture_hangs_a_degree_askew_in_its_own_plane() -> None:
    piece = Piece(
        "generated#picture", "Picture", "picture_frame", Place.WALL, PICTURE, (0.5, 0.02, 0.4)
    )
    shape = Shape(
        (box("p", np.array([0, 0.2, 0.01]), np.array([0.25, 0.2, 0.01]), 0),), (Material("m"),)
    )
    angles = []
    for seed in range(12):
        mutable = MutableHouse(house(), seed, 0.5)
        at = np.array([2.0, 1.4, 0.001])
        item = mutable.placed(
            piece, shape, at, 0.0, item_id="dress-walls-0", room_id="0_0", level_id="0"
        )
        mutable.add(item, "walls", piece)
        tilt_pictures(mutable, EMPTY, STYLE, 0.5)
        moved = mutable.items[-1]
        assert moved.bounds[:, 2] == pytest.approx(item.bounds[:, 2], abs=1e-6)
        assert moved.box is not None
        angles.append(float(np.degrees(np.arctan2(moved.box.axes[1, 0], moved.box.axes[0, 0]))))
    assert 0.3 < np.std(angles) < 3.0
    assert max(map(abs, angles)) < 6.0


def _bedroom(width: float) -> House:
    parts = [
        ([0.0, 0.0, 0.5], [0.05, 0.9, 0.5 + width]),
        ([0.05, 0.0, 0.5], [2.05, 0.5, 0.5 + width]),
    ]
    return house(boards("Bed", parts, BED), name="Bedroom")


@pytest.mark.quick(1)
@pytest.mark.parametrize(("width", "n"), [(1.6, 2), (1.12, 2), (0.9, 1)])
def test_a_bed_has_a_duvet_and_as_many_pillows_as_people_sleep_there(width: float, n: int) -> None:
    for seed in range(3):
        mutable = MutableHouse(_bedroom(width), seed, 0.3)
        add_clutter(mutable, EMPTY, STYLE, 1.0)
        keep_gates(mutable, mutable.used)
        added = mutable.items[1:]
        pillows = [i for i in added if i.source_class == "generated#pillow"]
        duvets = [i for i in added if i.source_class == "generated#duvet"]
        assert (len(pillows), len(duvets)) == (n, 1)
        # The pillows lie at the head, the duvet below them over the rest.
        assert max(p.bounds[1, 0] for p in pillows) < duvets[0].bounds[0, 0]
        assert duvets[0].bounds[1, 0] > 1.95


def test_clothes_on_a_seat_hang_on_no_post_behind_it() -> None:
    posts = [([x, 0.0, 0.4], [x + 0.04, 0.95, 0.44]) for x in (0.0, 0.12, 0.24, 0.36)]
    chair = boards("Chair", [([0.0, 0.0, 0.0], [0.4, 0.45, 0.4]), *posts], CHAIR)
    found = []
    for seed in range(6):
        mutable = MutableHouse(house(chair, name="Bedroom"), seed, 1.0)
        rng = mutable.rng("test")
        stock = Stock(EMPTY, book_covers(rng, STYLE), 1)
        placing = Placing(mutable, stock, mutable.source.rooms[0], STYLE, rng, 1.0)
        drop_clothes(placing, SceneTriangles(mutable.items), np.array([0.2, 0.2]), 0.45)
        found += mutable.items[1:]
    # What finds no place on the seat stays in the wardrobe.
    assert len(found) >= 3
    assert max(float(item.bounds[1, 1]) for item in found) < 0.65


FOLDS = Folds(9, 0.03, 0.04, (0.2, 0.6))


def _ground(item: Item, thread_m: float) -> Ground:
    """The ground of one item in a frame that begins at the world's origin."""
    grid = PlanGrid(np.zeros(2), 0.0, CELL_M, (260, 260))
    return Ground.of(grid, item_triangles(item), 0.0, 1.0, thread_m / 2)


def _fallen(net: Net, ground: Ground, thick_m: float) -> Net:
    made = drape(net, ground, thick_m, FOLDS, np.random.default_rng(2))
    assert made is not None
    return made


def test_cloth_that_fell_lies_on_what_is_below_it_hangs_over_its_edge_and_enters_nothing() -> None:
    block, thick = solid("block", [0.5, 0.0, 0.5], [2.1, 0.5, 2.5]), 0.02
    corners, ground = item_triangles(block), _ground(block, 0.06)
    net = flat_net((1.2, 1.0), 0.06, (0.6, 0.6, 1.5), 0.1)
    made = [_fallen(net, ground, thick) for _ in range(2)]
    assert np.array_equal(made[0].points, made[1].points)
    sheet = sheet_of("cloth", made[0], ground, thick)
    points = sheet.positions.astype(np.float64)
    places = np.unique(
        np.round(triangle_corners(sheet.positions, sheet.faces).reshape(-1, 3), 6),
        axis=0,
        return_inverse=True,
    )[1]
    assert edges_are_paired(places.reshape(-1, 3))
    over = points[:, 1] - np.maximum(highest_below(points[:, [0, 2]], corners), 0.0)
    assert 0.0 < over.min() < 0.002
    assert points[:, 1].min() < 0.3
    # What folds take is drawn in from the edges: cloth neither grows nor shrinks away.
    assert np.median(made[0].stretches()) == pytest.approx(1.0, abs=0.03)
    assert sheet.uvs is not None
    assert np.ptp(sheet.uvs, axis=0) == pytest.approx([1.2, 1.0], abs=1e-6)


# A board across the bed's foot, its top above the mattress; the back of a sofa, thinner than threads are apart.
@pytest.mark.parametrize(
    ("parts", "size", "thread_m", "thick_m", "turn"),
    [
        ([([0.5, 0, 0.5], [2.1, 0.4, 2.4]), ([0.5, 0, 2.4], [2.1, 0.9, 2.44])], (1.8, 1.6), 0.065, 0.03, 0.0),
        ([([0.5, 0, 1.5], [2.5, 0.45, 2.3]), ([0.5, 0, 1.4], [2.5, 0.9, 1.44])], (1.3, 0.9), 0.05, 0.008, 0.6),
    ],
    ids=["bed", "sofa"],
)  # fmt: skip
def test_cloth_is_not_torn_by_what_rises_below_it(
    parts: list[tuple[list[float], list[float]]], size: tuple[float, float], thread_m: float,
    thick_m: float, turn: float,
) -> None:  # fmt: skip
    ground = _ground(boards("piece", parts, BED), thread_m)
    middle = (1.3, 0.95, 1.6)
    made = _fallen(flat_net(size, thread_m, middle, turn), ground, thick_m)
    stretches = made.stretches()
    assert np.percentile(stretches, 99) < 1.2 < MOST_STRETCH
    assert stretches.max() < 2.0
    assert made.deepest_m(ground) == 0.0
    # It fell, on both sides of what rises.
    assert made.points[..., 1].min() < 0.6


def test_cloth_that_finds_no_way_to_fall_lies_flat_where_that_is_level() -> None:
    # A post of a hand's height through the middle of the net: it begins in it.
    parts = [([0.5, 0, 0.5], [2.1, 0.4, 2.4]), ([1.2, 0.4, 1.2], [1.5, 0.9, 1.5])]
    ground = _ground(boards("block", parts, BED), 0.05)
    low = flat_net((1.0, 0.8), 0.05, (1.35, 0.41, 1.35), 0.0)
    assert drape(low, ground, 0.008, FOLDS, np.random.default_rng(1)) is None
    assert lie_flat(low, ground, 0.008) is None
    beside = flat_net((1.0, 0.8), 0.05, (1.1, 0.41, 1.9), 0.0)
    flat = lie_flat(beside, ground, 0.008)
    assert flat is not None
    assert np.ptp(flat.points[..., 1]) == 0.0
    assert flat.stretches() == pytest.approx(np.ones(len(flat.stretches())))
    assert float(flat.points[0, 0, 1]) == pytest.approx(0.4 + 0.004, abs=0.001)
    assert 0.3 < np.ptp(flat.points[..., 0]) <= 1.0


def test_a_point_leaves_what_is_solid_by_the_shorter_way() -> None:
    ground = _ground(solid("block", [0.5, 0.0, 0.5], [1.5, 0.5, 1.5]), 0.02)
    wide = ground.grown_m
    points = np.array([[1.0, 0.48, 1.0], [1.46, 0.3, 1.0], [1.0, 0.3, 0.53], [2.0, 0.3, 1.0]]).T
    moved = (points + ground.ways_out(points, 0.01)).T
    assert moved[0] == pytest.approx([1.0, 0.51, 1.0])
    # To a side it goes by a cell farther than the block is wide, and up to another that it touches.
    assert moved[1] == pytest.approx([1.5 + wide + 0.01, 0.3, 1.0], abs=CELL_M + 1e-9)
    assert moved[2] == pytest.approx([1.0, 0.3, 0.5 - wide - 0.01], abs=CELL_M + 1e-9)
    assert moved[3] == pytest.approx([2.0, 0.3, 1.0])


def test_shoes_stand_apart_and_on_their_soles() -> None:
    pair = [
        box("s", np.array([x, 0.04, 0.0]), np.array([0.04, 0.04, 0.13]), 0) for x in (-0.05, 0.05)
    ]
    surface = replace(
        pair[0], positions=np.concatenate([p.positions for p in pair]),
        faces=np.concatenate([pair[0].faces, pair[1].faces + len(pair[0].positions)]),
        uvs=None, normals=None,
    )  # fmt: skip
    piece = Piece("generated#shoes", "Shoes", "shoes", Place.SURFACE, 40, (0.18, 0.26, 0.08))
    shape = Shape((surface,), (Material("m"),))
    _piece, moved = separate_pair((piece, shape), np.random.default_rng(3), 1.0)
    points = moved.surfaces[0].positions
    assert points[:, 1].min() == pytest.approx(0.0, abs=1e-6)
    halves = [
        shapely.MultiPoint(points[k * 24 : (k + 1) * 24][:, [0, 2]]).convex_hull for k in (0, 1)
    ]
    assert halves[0].intersection(halves[1]).area < 1e-6
    _same, tidy = separate_pair((piece, shape), np.random.default_rng(3), 0.0)
    assert tidy.surfaces[0].positions == pytest.approx(surface.positions, abs=1e-6)


def test_a_recipe_that_does_not_name_the_mess_keeps_its_digest() -> None:
    told = recipe_from_name("fast", {"dress.seed": "3", "dress.mess": "0.3"})
    untold = recipe_from_name("fast", {"dress.seed": "3"})
    other = recipe_from_name("fast", {"dress.seed": "3", "dress.mess": "0.6"})
    assert told.digest() == untold.digest() != other.digest()
