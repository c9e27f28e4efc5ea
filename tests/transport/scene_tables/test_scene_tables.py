"""Per-face data that rays need."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.house import Geometry
from pbrs_farm.transport.scene_tables import scene_tables
from pbrs_farm.transport.scene_tables.scene_tables import NORMALS, UV0

UP = (0.0, 1.0, 0.0)


def geometry(normals: np.ndarray, uvs: np.ndarray) -> Geometry:
    """One floor triangle per three rows, seen from above."""
    n = len(normals) // 3
    corners = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0]], np.float32)
    nothing = np.zeros(n, np.int32)
    return Geometry(
        positions=np.tile(corners, (n, 1)),
        normals=np.asarray(normals, np.float32),
        uvs=np.asarray(uvs, np.float32),
        faces=np.arange(3 * n, dtype=np.int32).reshape(n, 3),
        face_item=nothing.astype(np.uint32),
        face_material=nothing,
        face_surface=nothing,
    )


def rows_of(normals: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    g = geometry(normals, uvs)
    return scene_tables.rows_of_faces(g, g.faces)


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ((0.6, 0.8, 0.0), (0.6, 0.8, 0.0)),
        ((0.0, -1.0, 0.0), UP),  # all three are turned to the front
        ((0.0, 0.0, 0.0), UP),
        ((np.nan, 0.0, 0.0), UP),
        ((0.0, 0.0, 5.0), UP),
        ((1.0, 0.0, 0.0), UP),  # on the horizon
    ],
)
def test_a_valid_corner_normal_is_kept(given: tuple, kept: tuple) -> None:
    (row,) = rows_of(np.tile(given, (3, 1)), np.zeros((3, 2)))
    for columns in NORMALS:
        assert row[columns] == pytest.approx(kept, abs=1e-6)


def test_one_bad_normal_does_not_change_the_others() -> None:
    (row,) = rows_of(np.array([(0.6, 0.8, 0), (0, 0, 0), (0, 0.8, 0.6)]), np.zeros((3, 2)))
    rows = [row[columns] for columns in NORMALS]
    assert np.allclose(rows, [(0.6, 0.8, 0), UP, (0, 0.8, 0.6)], atol=1e-6)


def test_texture_coordinates_begin_within_the_first_turn() -> None:
    (row,) = rows_of(np.tile(UP, (3, 1)), np.array([(-3.25, 7.5), (-3.0, 7.75), (-3.25, 8.0)]))
    assert row[UV0].tolist() == [0.75, 0.5]


def test_rows_and_refused_faces_do_not_depend_on_the_part_they_are_made_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(3)
    g = geometry(rng.normal(0, 1, (300, 3)), rng.normal(0, 9, (300, 2)))
    g.positions[rng.integers(0, 300, 20)] = np.nan
    whole = scene_tables.rows_of_faces(g, g.faces), scene_tables.solid_faces(g)
    monkeypatch.setattr(scene_tables, "FACES_AT_ONCE", 7)
    parts = scene_tables.rows_of_faces(g, g.faces), scene_tables.solid_faces(g)
    assert [a.tobytes() for a in parts] == [a.tobytes() for a in whole]
    assert 0 < whole[1].sum() < 100
