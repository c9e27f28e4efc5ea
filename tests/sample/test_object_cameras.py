"""Cameras around an object without context (paper section 4.1)."""

import numpy as np
import pytest

from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.sample.object_cameras import icosphere_vertices, object_views

BOX = np.array([[-1.0, 0.0, 2.0], [1.0, 2.0, 3.0]])
INTRINSICS = Intrinsics.from_hfov(64, 48)


def test_the_twice_subdivided_icosahedron_has_162_vertices_on_the_unit_sphere() -> None:
    vertices = icosphere_vertices(2)
    assert vertices.shape == (162, 3)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1)
    gaps = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) + 9 * np.eye(162)
    assert gaps.min() > 0.27
    assert gaps.min(1).max() < 0.33
    # Twelve vertices keep five neighbours, the others have six.
    assert sorted(np.unique((gaps < 0.4).sum(1), return_counts=True)[1].tolist()) == [12, 150]
    np.testing.assert_allclose(vertices.sum(0), 0, atol=1e-12)


def test_each_camera_is_on_a_vertex_at_the_papers_distance_and_faces_the_centre() -> None:
    views = object_views(BOX, INTRINSICS, 0, ("chair",), 200)
    centre, diagonal = BOX.mean(0), np.linalg.norm(BOX[1] - BOX[0])
    vertices = icosphere_vertices(2)
    distances = []
    for view in views:
        offset = view.camera.eye - centre
        distances.append(np.linalg.norm(offset) / diagonal)
        np.testing.assert_allclose(
            offset / np.linalg.norm(offset), vertices[view.sector], atol=1e-12
        )
        np.testing.assert_allclose(view.camera.towards, -vertices[view.sector], atol=1e-12)
        rotation = view.camera.world_from_camera[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        if abs(vertices[view.sector][1]) < 0.999:
            assert rotation[1, 0] == pytest.approx(0)  # upright
    assert 1.5 <= min(distances) < 1.6
    assert 4.4 < max(distances) <= 4.5
    assert len({view.sector for view in views}) > 90
    assert len({view.id for view in views}) == 200


def test_the_views_over_the_poles_have_a_fixed_up_vector() -> None:
    views = object_views(BOX, INTRINSICS, 0, ("chair",), 2000)
    vertices = icosphere_vertices(2)
    polar = [v for v in views if abs(vertices[v.sector][1]) > 0.9999]
    assert polar
    for view in polar:
        np.testing.assert_allclose(view.camera.world_from_camera[:3, 1], [0, 0, -1], atol=1e-12)


def test_the_same_object_and_seed_give_the_same_views_and_others_do_not() -> None:
    def poses(seed: int, name: str) -> np.ndarray:
        views = object_views(BOX, INTRINSICS, seed, (name,))
        assert len(views) == 20
        return np.array([v.camera.world_from_camera for v in views])

    np.testing.assert_array_equal(poses(0, "a"), poses(0, "a"))
    assert (poses(0, "a") != poses(1, "a")).any()
    assert (poses(0, "a") != poses(0, "b")).any()


@pytest.mark.parametrize("bad", [np.zeros((2, 3)), np.full((2, 3), np.nan)])
def test_an_object_without_extent_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="bounds"):
        object_views(bad, INTRINSICS, 0, ())
