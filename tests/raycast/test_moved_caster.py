"""A moved caster finds the same hits as a new caster of the moved triangles."""

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
    """The geometry with all vertices of moving faces turned by 40 degrees and lifted."""
    positions = g.positions.copy()
    moving_vertices = np.unique(g.faces[moving])
    positions[moving_vertices] = (
        positions[moving_vertices] @ rotation_y(0.7).T + [0.1, 0.3, 0.0]
    ).astype(np.float32)
    return replace(g, positions=positions)


@pytest.mark.parametrize("n_moving", [0, 40, 300])
def test_hits_after_a_move_are_those_of_a_caster_of_the_moved_triangles(n_moving: int) -> None:
    g = soup(300)
    moving = np.arange(300) < n_moving
    then = moved(g, moving)
    moved_caster, expected = Caster(g).at(then, moving), Caster(then)
    a, b = moved_caster.hit_record(VIEW), expected.hit_record(VIEW)
    same = a.face == b.face
    assert (~same).sum() <= 2  # rays through an edge
    np.testing.assert_array_equal(a.depth_z[same], b.depth_z[same])
    assert (a.face >= 0).mean() > 0.5
    np.testing.assert_allclose(
        moved_caster.item_counts([VIEW]), expected.item_counts([VIEW]), atol=2
    )
    skip = np.arange(300) % 3 == 0
    faces = moved_caster.hit_record(VIEW, skip_faces=skip).face
    assert not skip[faces[faces >= 0]].any()
    assert (faces == expected.hit_record(VIEW, skip_faces=skip).face).mean() > 0.999


def test_static_faces_are_traced_by_one_mesh_for_all_times() -> None:
    g = soup(50)
    moving = np.arange(50) < 5
    rest = Caster(g)
    first, second = (rest.at(moved(g, moving), moving) for _ in range(2))
    first.hit_record(VIEW), second.hit_record(VIEW)
    assert first.tracer.first is second.tracer.first  # type: ignore[union-attr]
