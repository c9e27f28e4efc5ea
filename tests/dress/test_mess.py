"""Mess: chairs, pictures, beds, clothes; it breaks no gate, and 0 adds none."""

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
    """A chair 40 cm wide in front of the table, its back to -z."""
    parts = [([x, 0.0, z], [x + 0.4, 0.45, z + 0.4]), ([x, 0.45, z], [x + 0.4, 0.9, z + 0.03])]
    return boards(name, parts, CHAIR)


def _dining() -> House:
    return house(TABLE_ITEM, _chair("a", 1.4, 0.7), _chair("b", 2.0, 0.7))


def _moves(seed: int, share: float) -> list[float]:
    mutable = MutableHouse(_dining(), seed, share)
    move_chairs(mutable, EMPTY, STYLE, share)
    pairs = zip(mutable.items[1:], mutable.source.items[1:], strict=True)
    return [float(np.linalg.norm(a.bounds.mean(0) - b.bounds.mean(0))) for a, b in pairs]


def test_chairs_move_by_centimetres_and_some_are_pulled_out() -> None:
    few = [m for seed in range(12) for m in _moves(seed, 0.001)]
    many = [m for seed in range(12) for m in _moves(seed, 1.0)]
    assert len({round(m, 3) for m in few}) > 12
    assert max(few) < 0.2
    assert np.mean([m > 0.1 for m in many]) > 0.6


def test_a_chair_is_not_pulled_into_furniture_or_through_a_wall() -> None:
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


def test_a_picture_is_a_degree_askew_in_its_plane() -> None:
    piece = Piece(
        "generated#picture", "Picture", "picture_frame", Place.WALL, PICTURE, (0.5, 0.02, 0.4)
    )
    shape = Shape(
        (box("p", np.array([0, 0.2, 0.01]), np.array([0.25, 0.2, 0.01]), 0),), (Material("m"),)
    )
    angles = []
    for seed in range(12):
        mutable = MutableHouse(house(), seed, 0.5)
        centre = np.array([2.0, 1.4, 0.001])
        item = mutable.placed(
            piece, shape, centre, 0.0, item_id="dress-walls-0", room_id="0_0", level_id="0"
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
        # The pillows are at the head, the duvet covers the rest.
        assert max(p.bounds[1, 0] for p in pillows) < duvets[0].bounds[0, 0]
        assert duvets[0].bounds[1, 0] > 1.95


def test_clothes_on_a_seat_do_not_hang_on_a_post_behind_it() -> None:
    posts = [([x, 0.0, 0.4], [x + 0.04, 0.95, 0.44]) for x in (0.0, 0.12, 0.24, 0.36)]
    chair = boards("Chair", [([0.0, 0.0, 0.0], [0.4, 0.45, 0.4]), *posts], CHAIR)
    clothes = []
    for seed in range(6):
        mutable = MutableHouse(house(chair, name="Bedroom"), seed, 1.0)
        rng = mutable.rng("test")
        stock = Stock(EMPTY, book_covers(rng, STYLE), 1)
        placing = Placing(mutable, stock, mutable.source.rooms[0], STYLE, rng, 1.0)
        drop_clothes(placing, SceneTriangles(mutable.items), np.array([0.2, 0.2]), 0.45)
        clothes += mutable.items[1:]
    # Clothes without a place on the seat stay in the wardrobe.
    assert len(clothes) >= 3
    assert max(float(item.bounds[1, 1]) for item in clothes) < 0.65


FOLDS = Folds(9, 0.03, 0.04, (0.2, 0.6))


def _ground(item: Item, thread_m: float) -> Ground:
    """The ground of one item, in a frame that starts at the world's origin."""
    grid = PlanGrid(np.zeros(2), 0.0, CELL_M, (260, 260))
    return Ground.of(grid, item_triangles(item), 0.0, 1.0, thread_m / 2)


def _fallen(net: Net, ground: Ground, thick_m: float) -> Net:
    cloth = drape(net, ground, thick_m, FOLDS, np.random.default_rng(2))
    assert cloth is not None
    return cloth


def test_fallen_cloth_covers_its_ground_hangs_over_its_edge_and_enters_nothing() -> None:
    block, thick = solid("block", [0.5, 0.0, 0.5], [2.1, 0.5, 2.5]), 0.02
    corners, ground = item_triangles(block), _ground(block, 0.06)
    net = flat_net((1.2, 1.0), 0.06, (0.6, 0.6, 1.5), 0.1)
    cloths = [_fallen(net, ground, thick) for _ in range(2)]
    assert np.array_equal(cloths[0].points, cloths[1].points)
    sheet = sheet_of("cloth", cloths[0], ground, thick)
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
    # Folds draw cloth in from the edges: cloth neither stretches nor shrinks.
    assert np.median(cloths[0].stretches()) == pytest.approx(1.0, abs=0.03)
    assert sheet.uvs is not None
    assert np.ptp(sheet.uvs, axis=0) == pytest.approx([1.2, 1.0], abs=1e-6)


# A board across the foot of the bed, its top above the mattress; the back of a sofa, thinner than
# the spacing of threads.
@pytest.mark.parametrize(
    ("parts", "size", "thread_m", "thick_m", "turn"),
    [
        ([([0.5, 0, 0.5], [2.1, 0.4, 2.4]), ([0.5, 0, 2.4], [2.1, 0.9, 2.44])], (1.8, 1.6), 0.065, 0.03, 0.0),
        ([([0.5, 0, 1.5], [2.5, 0.45, 2.3]), ([0.5, 0, 1.4], [2.5, 0.9, 1.44])], (1.3, 0.9), 0.05, 0.008, 0.6),
    ],
    ids=["bed", "sofa"],
)  # fmt: skip
def test_obstacles_below_do_not_tear_cloth(
    parts: list[tuple[list[float], list[float]]], size: tuple[float, float], thread_m: float,
    thick_m: float, turn: float,
) -> None:  # fmt: skip
    ground = _ground(boards("piece", parts, BED), thread_m)
    middle = (1.3, 0.95, 1.6)
    cloth = _fallen(flat_net(size, thread_m, middle, turn), ground, thick_m)
    stretches = cloth.stretches()
    assert np.percentile(stretches, 99) < 1.2 < MOST_STRETCH
    assert stretches.max() < 2.0
    assert cloth.deepest_m(ground) == 0.0
    # It fell on both sides of the obstacle.
    assert cloth.points[..., 1].min() < 0.6


def test_cloth_that_cannot_fall_stays_flat_on_level_ground() -> None:
    # A post as high as a hand through the middle of the net, which starts inside it.
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


def test_a_point_leaves_a_solid_by_the_shorter_way() -> None:
    ground = _ground(solid("block", [0.5, 0.0, 0.5], [1.5, 0.5, 1.5]), 0.02)
    wide = ground.grown_m
    points = np.array([[1.0, 0.48, 1.0], [1.46, 0.3, 1.0], [1.0, 0.3, 0.53], [2.0, 0.3, 1.0]]).T
    moved = (points + ground.ways_out(points, 0.01)).T
    assert moved[0] == pytest.approx([1.0, 0.51, 1.0])
    # It leaves sideways by one cell more than the block's width, and upwards until it touches.
    assert moved[1] == pytest.approx([1.5 + wide + 0.01, 0.3, 1.0], abs=CELL_M + 1e-9)
    assert moved[2] == pytest.approx([1.0, 0.3, 0.5 - wide - 0.01], abs=CELL_M + 1e-9)
    assert moved[3] == pytest.approx([2.0, 0.3, 1.0])


def test_shoes_are_apart_and_on_their_soles() -> None:
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
    messy = recipe_from_name("fast", {"dress.seed": "3", "dress.mess": "0.3"})
    untold = recipe_from_name("fast", {"dress.seed": "3"})
    messier = recipe_from_name("fast", {"dress.seed": "3", "dress.mess": "0.6"})
    assert messy.digest() == untold.digest() != messier.digest()
