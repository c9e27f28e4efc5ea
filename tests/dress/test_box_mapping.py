from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import area_vectors, face_areas, triangle_corners
from pbrs_farm.dress.box_mapping import box_mapped
from pbrs_farm.geometry.solids import box


def _board(half: list[float], axes: F64 | None = None) -> Surface:
    return box("board", np.zeros(3), np.array(half), 0, axes=axes)


def _uv_areas(surface: Surface) -> F64:
    assert surface.uvs is not None
    a, b, c = (surface.uvs[surface.faces[:, k]].astype(np.float64) for k in range(3))
    u, v = b - a, c - a
    return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def test_a_picture_has_the_same_scale_on_every_side() -> None:
    surface = _board([1.0, 0.2, 0.4])
    mapped = box_mapped(surface, np.eye(3), (0.5, 0.25))
    areas = face_areas(triangle_corners(mapped.positions, mapped.faces))
    assert_allclose(_uv_areas(mapped), areas / (0.5 * 0.25), rtol=1e-4)


def test_faces_and_their_winding_stay() -> None:
    surface = _board([1.0, 0.2, 0.4])
    mapped = box_mapped(surface, np.eye(3), (1.0, 1.0))
    before, after = (triangle_corners(s.positions, s.faces) for s in (surface, mapped))
    assert_allclose(after, before)


def test_the_grain_runs_along_the_longest_side_of_a_turned_board() -> None:
    axes = rotation_y(0.7)
    mapped = box_mapped(_board([0.1, 0.02, 0.9], axes), axes, (1.0, 1.0))
    assert mapped.uvs is not None
    along = mapped.positions.astype(np.float64) @ axes[:, 2]
    corners = triangle_corners(mapped.positions, mapped.faces)
    ends = np.abs(area_vectors(corners) @ axes).argmax(1) == 2
    long_faces = mapped.faces[~ends]
    for i, j in ((0, 1), (1, 2)):
        step = along[long_faces[:, j]] - along[long_faces[:, i]]
        u = mapped.uvs[long_faces[:, j], 0] - mapped.uvs[long_faces[:, i], 0]
        assert_allclose(np.abs(u), np.abs(step), atol=1e-5)


def test_two_boards_show_different_places_of_the_picture() -> None:
    board = _board([1.0, 0.1, 0.1])
    two = replace(board, positions=board.positions + np.float32([0, 1, 0]))
    boards = replace(
        board, positions=np.concatenate([board.positions, two.positions]),
        faces=np.concatenate([board.faces, two.faces + len(board.positions)]),
    )  # fmt: skip
    mapped = box_mapped(replace(boards, uvs=None), np.eye(3), (1.0, 1.0))
    assert mapped.uvs is not None
    is_low = mapped.positions[:, 1] < 0.5
    low, high = (np.sort(mapped.uvs[m][:, 0] % 1.0) for m in (is_low, ~is_low))
    assert len(low) == len(high)
    assert not np.allclose(low, high, atol=0.01)


def test_normals_go_with_their_vertices() -> None:
    surface = _board([1.0, 0.2, 0.4])
    normals = np.repeat(np.eye(3), 8, axis=0).astype(np.float32)
    mapped = box_mapped(replace(surface, normals=normals), np.eye(3), (1.0, 1.0))
    assert mapped.normals is not None
    assert len(mapped.normals) == len(mapped.positions)
