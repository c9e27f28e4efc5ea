"""A caster of another time sees what a caster of that time's triangles alone would see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Geometry
from pbrs_farm.raycast.caster import Caster
from tests.raycast.scenes import camera, soup

VIEW = camera(64, 48, eye=(0, 0.2, 4), towards=(0, -0.1, -1))


def moved(g: Geometry, moving: np.ndarray) -> Geometry:
    """Every vertex of a face that moves turned by 40 degrees and lifted."""
    positions = g.positions.copy()
    own = np.unique(g.faces[moving])
    positions[own] = (positions[own] @ rotation_y(0.7).T + [0.1, 0.3, 0.0]).astype(np.float32)
    return replace(g, positions=positions)


@pytest.mark.parametrize("n_moving", [0, 40, 300])
def test_hits_after_a_move_are_those_of_a_caster_of_the_moved_triangles(n_moving: int) -> None:
    g = soup(300)
    moving = np.arange(300) < n_moving
    then = moved(g, moving)
    found, expected = Caster(g).at(then, moving), Caster(then)
    a, b = found.hit_record(VIEW), expected.hit_record(VIEW)
    same = a.face == b.face
    assert (~same).sum() <= 2  # rays through an edge
    np.testing.assert_array_equal(a.depth_z[same], b.depth_z[same])
    assert (a.face >= 0).mean() > 0.5
    np.testing.assert_allclose(found.item_counts([VIEW]), expected.item_counts([VIEW]), atol=2)
    skip = np.arange(300) % 3 == 0
    faces = found.hit_record(VIEW, skip_faces=skip).face
    assert not skip[faces[faces >= 0]].any()
    assert (faces == expected.hit_record(VIEW, skip_faces=skip).face).mean() > 0.999


def test_what_stands_still_is_traced_by_one_mesh_for_all_times() -> None:
    g = soup(50)
    moving = np.arange(50) < 5
    rest = Caster(g)
    one, other = (rest.at(moved(g, moving), moving) for _ in range(2))
    one.hit_record(VIEW), other.hit_record(VIEW)
    assert one._tracer._first is other._tracer._first  # type: ignore[union-attr]
