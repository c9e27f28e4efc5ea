"""Area, normal, volume, closedness and distance of triangles against closed forms and trimesh."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pbrs_farm.core.mesh import (
    area_vectors,
    boxes_meeting,
    clipped_to_box,
    closed_edge_share,
    cross_products,
    distances_to_triangles,
    dots,
    edges_are_paired,
    face_areas,
    faces_with_area,
    lengths,
    numbered_points,
    points_bounds,
    signed_volume,
    triangle_corners,
    unique_points,
    unit_normals,
)

TRIANGLE = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
SEGMENT = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
POINT = np.zeros((3, 3))
CORNERS = np.stack([TRIANGLE, TRIANGLE[::-1], SEGMENT, POINT])


def test_areas_and_normals_are_those_of_geometry() -> None:
    assert face_areas(CORNERS).tolist() == [2, 2, 0, 0]
    assert area_vectors(CORNERS)[:, 2].tolist() == [4, -4, 0, 0]
    assert unit_normals(CORNERS).tolist() == [[0, 0, 1], [0, 0, -1], [0, 0, 0], [0, 0, 0]]


def test_corners_are_taken_in_double_precision() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 0]], np.int32)
    corners = triangle_corners(TRIANGLE.astype(np.float32), faces)
    assert corners.dtype == np.float64
    np.testing.assert_array_equal(corners, CORNERS[:2])


def test_a_face_with_a_corner_that_is_no_number_has_no_area() -> None:
    broken = np.repeat(TRIANGLE[None], 4, axis=0)
    broken[1, 0, 0], broken[2, 0, 0], broken[3, 2, 1] = np.nan, np.inf, 1e-13
    assert faces_with_area(broken, 1e-12).tolist() == [True, False, False, False]


@pytest.mark.parametrize("shape", [(1, 3), (257, 3), (40, 3, 3)])
def test_lengths_are_numpys_to_the_bit(shape: tuple[int, ...]) -> None:
    vectors = np.random.default_rng(1).normal(size=shape) * 10.0 ** np.arange(-4, 5, 4)
    np.testing.assert_array_equal(lengths(vectors), np.linalg.norm(vectors, axis=-1))


def test_bounds_of_points_hold_them_all_and_are_double() -> None:
    points = np.random.default_rng(2).normal(size=(50, 3)).astype(np.float32)
    low, high = points_bounds(points)
    assert low.dtype == high.dtype == np.float64
    np.testing.assert_array_equal([low, high], [points.min(0), points.max(0)])


def test_touching_boxes_meet_and_separated_ones_do_not() -> None:
    low = np.array([[1.0, 0, 0], [0, 1.1, 0], [0, 0, -2], [0.2, 0.2, 0.2], [np.nan] * 3])
    meets = boxes_meeting(low, low + 1.0, np.zeros(3), np.ones(3))
    assert meets.tolist() == [True, False, False, True, False]


@pytest.mark.parametrize("n", [0, 1, 200])
def test_unique_points_are_numpys_unique_rows(n: int) -> None:
    points = np.random.default_rng(3).integers(0, 4, (n, 3)).astype(np.float64)
    np.testing.assert_array_equal(unique_points(points), np.unique(points, axis=0))


@pytest.mark.parametrize("n", [0, 1, 2, 200])
def test_points_are_numbered_as_numpys_unique_rows_are(n: int) -> None:
    points = np.random.default_rng(4).integers(-1, 3, (n, 3)).astype(np.float64)
    points *= np.where(np.arange(n) % 2, 1.0, -1.0)[
        :, None
    ]  # zeros of both signs are the same place
    _, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    numbers = numbered_points(points)
    np.testing.assert_array_equal(numbers[0], first)
    np.testing.assert_array_equal(numbers[1], np.ravel(number))


@pytest.mark.parametrize("seed", range(20))
def test_areas_are_trimeshs_to_the_bit(seed: int) -> None:
    corners = np.random.default_rng(seed).normal(size=(100, 3, 3)) * 10.0 ** (seed % 7 - 4)
    theirs = trimesh.triangles.area(crosses=area_vectors(corners))
    np.testing.assert_array_equal(face_areas(corners), theirs)


def cut_by_trimesh(corners: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    for axis in range(3):
        for normal, place in ((np.eye(3)[axis], low), (-np.eye(3)[axis], high)):
            faces = np.arange(3 * len(corners)).reshape(-1, 3)
            points, faces, _ = trimesh.intersections.slice_faces_plane(
                corners.reshape(-1, 3), faces, normal, place
            )
            corners = points[faces].reshape(-1, 3, 3)
    return corners


@pytest.mark.parametrize("is_on_a_grid", [False, True])
@pytest.mark.parametrize("seed", range(30))
def test_boxes_cut_triangles_exactly_like_trimesh(seed: int, is_on_a_grid: bool) -> None:
    # On a grid many corners, edges and whole faces are in the box's sides.
    random = np.random.default_rng(seed)
    corners, size = random.normal(size=(60, 3, 3)), random.uniform(0.2, 2.0, 3)
    if is_on_a_grid:
        corners, size = np.rint(2 * corners) / 2, np.ceil(2 * size) / 2
    cut = clipped_to_box(corners, -size, size)
    np.testing.assert_array_equal(cut, cut_by_trimesh(corners, -size, size))


def test_a_triangle_over_a_corner_of_the_box_keeps_the_inner_part() -> None:
    cut = clipped_to_box(TRIANGLE[None], np.array([-1.0, -1, -1]), np.array([1.0, 1, 1]))
    assert face_areas(cut).sum() == pytest.approx(1)
    outside = np.array([3.0, 3, 3])
    assert len(clipped_to_box(TRIANGLE[None], outside, outside + 1)) == 0


def box(extents: tuple[float, float, float]) -> np.ndarray:
    return np.asarray(trimesh.creation.box(extents).triangles, np.float64)


def test_volume_is_negative_inside_out_and_the_same_far_away() -> None:
    corners = box((1.0, 2.0, 3.0))
    far = np.array([1e4, 0.0, -1e4])
    assert signed_volume(corners, np.zeros(3)) == pytest.approx(6)
    assert signed_volume(corners[:, ::-1], np.zeros(3)) == pytest.approx(-6)
    assert signed_volume(corners + far, far) == pytest.approx(6)


def test_a_box_is_closed_without_a_face_it_is_open() -> None:
    corners = box((1.0, 1.0, 1.0))
    assert closed_edge_share(corners) == 1
    assert closed_edge_share(corners[1:]) == pytest.approx(15 / 18)
    assert closed_edge_share(corners[:0]) == 0


def test_turned_and_collapsed_faces_do_not_open_a_mesh() -> None:
    corners = box((1.0, 1.0, 1.0))
    collapsed = corners[0][[0, 0, 1]]
    turned = np.concatenate([corners[:1, ::-1], corners[1:], collapsed[None]])
    assert closed_edge_share(turned) == 1


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((0.5, 0.5, 0.3), 0.3),  # above the inside
        ((0.5, 0.5, 0.0), 0.0),  # in it
        ((-3.0, -4.0, 0.0), 5.0),  # nearest: a corner
        ((1.0, -0.7, 0.0), 0.7),  # nearest: an edge
        ((2.0, 2.0, 0.0), np.sqrt(2.0)),  # nearest: the slanted edge
        ((3.0, 0.0, 1.0), np.sqrt(2.0)),  # nearest: a corner, off the plane
    ],
)
def test_the_distance_is_that_of_geometry(point: tuple[float, ...], distance: float) -> None:
    computed = distances_to_triangles(np.array(point), TRIANGLE[None])
    assert computed[0] == pytest.approx(distance, abs=1e-12)


def test_a_triangle_without_area_is_a_segment_or_a_point() -> None:
    points = np.array([[1.5, 3.0, 4.0], [0.0, 3.0, 4.0]])
    assert distances_to_triangles(points, np.stack([SEGMENT, POINT])).tolist() == [5, 5]


@given(seed=st.integers(0, 10_000))
def test_areas_normals_and_distances_agree_with_trimesh(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-3, 3, (50, 3, 3))
    points = rng.uniform(-3, 3, (50, 3))
    nearest = trimesh.triangles.closest_point(corners, points)
    np.testing.assert_allclose(face_areas(corners), trimesh.triangles.area(corners), atol=1e-12)
    np.testing.assert_allclose(
        unit_normals(corners), trimesh.triangles.normals(corners)[0], atol=1e-9
    )
    np.testing.assert_allclose(
        distances_to_triangles(points, corners), np.linalg.norm(nearest - points, axis=1), atol=1e-9
    )


def test_small_triangles_are_as_exact_as_large_ones() -> None:
    # trimesh.triangles.closest_point is wrong here: it returns points of the edges.
    rng = np.random.default_rng(0)
    corners, points = rng.uniform(-1, 1, (100, 3, 3)), rng.uniform(-1, 1, (100, 3))
    large = distances_to_triangles(points, corners)
    small = distances_to_triangles(1e-4 * points, 1e-4 * corners)
    np.testing.assert_allclose(small, 1e-4 * large, rtol=1e-9)


def test_edges_are_paired_if_each_reverse_occurs_as_often() -> None:
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    assert edges_are_paired(tetrahedron)
    assert edges_are_paired(tetrahedron[:0])
    assert not edges_are_paired(tetrahedron[1:])
    assert not edges_are_paired(np.concatenate([tetrahedron[:1, ::-1], tetrahedron[1:]]))
    # A fan has a rim; together with the reversed fan it has none.
    fan = np.array([[0, k, k + 1] for k in range(1, 6)])
    assert not edges_are_paired(fan)
    assert edges_are_paired(np.concatenate([fan, fan[:, ::-1]]))
    # A degenerate face has the edges of a line, in both directions.
    assert edges_are_paired(np.concatenate([tetrahedron, [[0, 1, 1]]]))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_cross_products_are_numpys_to_the_bit(dtype: type) -> None:
    a, b = np.random.default_rng(0).normal(size=(2, 500, 3)).astype(dtype)
    products = cross_products(a, b)
    assert products.dtype == dtype
    assert products.tobytes() == np.cross(a, b).tobytes()
    assert np.array_equal(cross_products(a[0], b), np.cross(a[0], b))


def test_dots_and_unit_normals_are_numpys_to_the_bit() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(0, 3, (2, 4000, 3, 3))
    assert dots(a, b).tobytes() == (a * b).sum(-1).tobytes()
    n = np.cross(a[:, 1] - a[:, 0], a[:, 2] - a[:, 0])
    assert unit_normals(a).tobytes() == (n / np.linalg.norm(n, axis=1)[:, None]).tobytes()
