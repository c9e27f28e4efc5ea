"""Depths, distances and shells of closed, open and thin meshes with either winding."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item
from pbrs_farm.dress.gates.bodies import Body, shells_of
from pbrs_farm.dress.gates.penetration import penetration_m
from pbrs_farm.dress.gates.plumb import Plumb
from pbrs_farm.dress.gates.shells import Solids, depths_inside, thickness
from pbrs_farm.geometry.solids import box_quads, lathe, quads_surface, sphere
from pbrs_farm.geometry.surface_points import item_triangles
from tests.dress.furniture import boards, bookcase, solid


def body(item: Item, index: int = 0, *, is_new: bool = True) -> Body:
    corners = item_triangles(item)
    points = corners.reshape(-1, 3)
    return Body(index, item, corners, points.min(0), points.max(0), is_new, None, None)


def open_box(low: list[float], high: list[float], *without: int) -> F64:
    """Triangles of a box without some sides: 0 -x, 1 +x, 2 -y, 3 +y, 4 -z, 5 +z."""
    centre, half = (np.array(low) + high) / 2, (np.array(high) - low) / 2
    quads = box_quads(centre, half)
    # Find the side of each quad.
    out = quads.mean(1) - centre
    sides = [2 * int(np.argmax(np.abs(o))) + int(o[np.argmax(np.abs(o))] > 0) for o in out]
    quads_left = np.array([q for q, side in zip(quads, sides, strict=True) if side not in without])
    surface = quads_surface("", quads_left, 0)
    return np.asarray(surface.positions[surface.faces], np.float64)


def depth(a: Item, b: Item) -> float:
    return penetration_m(body(a), body(b), Solids())


def test_boxes_that_overlap_by_a_depth_enter_each_other_so_deep():
    table = solid("a", [0, 0, 0], [1, 0.7, 1])
    for d in (0.03, 0.2):
        thing = solid("b", [0.4, 0.7 - d, 0.4], [0.6, 1, 0.6])
        assert depth(table, thing) == pytest.approx(d, abs=1e-5)
    assert depth(table, solid("b", [0.4, 0.695, 0.4], [0.6, 1, 0.6])) <= 0.01


def test_touching_items_do_not_overlap():
    table = solid("a", [0, 0, 0], [1, 0.7, 1])
    assert depth(table, solid("b", [0.4, 0.7, 0.4], [0.6, 1, 0.6])) == 0


def test_an_item_wholly_inside_another_is_found():
    assert depth(solid("a", [0, 0, 0], [1, 1, 1]), solid("b", [0.4] * 3, [0.6] * 3)) >= 0.2


def test_a_thin_plate_through_a_cupboard_is_found_though_it_shares_little():
    plate = solid("b", [-0.5, 0.4, 0.4], [1.5, 0.8, 0.404])
    assert depth(solid("a", [0, 0, 0], [1, 1, 1]), plate) > 0.1


def test_two_thin_plates_that_cross_are_found_and_plates_that_touch_are_not():
    plate = solid("a", [0, 0, 0], [0.3, 0.3, 0.005])
    across = solid("b", [0.15, 0, -0.2], [0.155, 0.3, 0.2])
    assert depth(plate, across) > 0.1
    assert depth(plate, solid("b", [0.15, 0, 0.005], [0.155, 0.3, 0.2])) == 0


def test_a_book_through_a_shelf_is_found():
    book = solid("book", [1.4, 0.2, 0.05], [1.43, 0.7, 0.25])
    assert depth(bookcase(), book) > 0.01


def test_a_book_between_shelves_shares_nothing():
    # Boards of 2 cm are at 0.1 m and every 0.47 m above.
    book = solid("book", [1.4, 0.12, 0.05], [1.43, 0.4, 0.25])
    assert depth(bookcase(), book) < 1e-6


def test_a_chair_under_a_table_shares_nothing_though_their_boxes_meet():
    table = boards("table", [([0, 0.7, 0], [1, 0.74, 1]), ([0, 0, 0], [0.05, 0.7, 0.05])], 7)
    chair = boards("chair", [([0.3, 0.4, 0.3], [0.7, 0.45, 1.2])], 5)
    assert depth(table, chair) == 0


def test_a_body_without_a_bottom_counts_as_full_and_a_bowl_as_empty():
    points = np.array([[0.5, 0.5, 0.5], [0.5, 2.0, 0.5]])
    assert depths_inside(points, open_box([0, 0, 0], [1, 1, 1], 2)).tolist() == [0.5, 0.0]
    assert depths_inside(points, open_box([0, 0, 0], [1, 1, 1], 3)).max() == 0
    assert depths_inside(points, open_box([0, 0, 0], [1, 1, 1], 5)).max() == 0


@pytest.mark.parametrize("is_flipped", [False, True])
def test_depths_agree_with_a_sphere_of_either_winding(is_flipped):
    ball = sphere("", np.zeros(3), 1.0, 0, n=64)
    corners = np.asarray(ball.positions[ball.faces], np.float64)
    corners = corners[:, ::-1] if is_flipped else corners
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (200, 3))
    inside = np.linalg.norm(points, axis=1) < 0.98
    depths = depths_inside(points, corners)
    assert (depths[inside] > 0).all()
    assert (depths[np.linalg.norm(points, axis=1) > 1.0] == 0).all()


def test_a_ray_along_an_edge_is_counted_once():
    corners = open_box([0, 0, 0], [1, 1, 1])
    assert depths_inside(np.array([[0.5, 0.5, 0.5], [0.25, 0.25, 0.25]]), corners).min() > 0.2


def test_the_thickness_of_a_bent_skin_is_not_that_of_its_hull():
    plate = open_box([0, 0, 0], [0.4, 0.003, 0.4])
    assert thickness(plate) == pytest.approx(0.003)
    outer, inner = open_box([0, 0, 0], [1, 1, 1]), open_box([0.002] * 3, [0.998] * 3)[:, ::-1]
    assert thickness(np.concatenate([outer, inner])) < 0.007


def test_connected_parts_are_shells_and_open_ones_are_reported():
    corners = np.concatenate([open_box([0, 0, 0], [1, 1, 1]), open_box([2, 0, 0], [3, 1, 1], 2)])
    shells = shells_of(corners)
    assert sorted(s.is_closed for s in shells) == [False, True]


def test_a_closed_shell_that_is_inside_out_is_turned():
    (shell,) = shells_of(open_box([0, 0, 0], [1, 1, 1])[:, ::-1])
    assert shell.is_closed
    assert depth(solid("a", [0.4] * 3, [0.6] * 3), solid("b", [0, 0, 0], [1, 1, 1])) > 0.1


def test_an_open_body_is_measured_by_points():
    cushion = solid("cushion", [0.2, 0.3, 0.2], [0.6, 0.5, 0.6])
    sofa = open_box([0, 0, 0], [1, 0.4, 1], 2)
    b = Body(1, cushion, sofa, sofa.min((0, 1)), sofa.max((0, 1)), False, None, None)
    assert penetration_m(body(cushion), b, Solids()) == pytest.approx(0.1, abs=0.02)


def test_upright_lines_hit_faces_above_and_below_and_their_edges():
    bodies = [body(solid("a", [0, 0, 0], [8, 0.5, 8])), body(solid("b", [1, 2, 1], [2, 3, 2]))]
    places = np.array([[1.5, 1.0, 1.5], [0.0, 1.0, 0.0], [9.0, 1.0, 9.0]])
    hits = Plumb(bodies, [0, 1]).hits(places, 2.1)
    heights = [sorted({round(float(y), 6) for y in hits.y[hits.place == k]}) for k in range(3)]
    assert heights == [[0.0, 0.5, 2.0, 3.0], [0.0, 0.5], []]


def test_a_vase_turned_on_a_lathe_is_closed():
    vase = lathe("", np.array([[0, 0], [0.1, 0], [0.1, 0.3], [0, 0.3]]), np.zeros(3), 0)
    (shell,) = shells_of(np.asarray(vase.positions[vase.faces], np.float64))
    assert shell.is_closed
