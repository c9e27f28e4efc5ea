"""A leaf that crosses its frame: at equal depth a ray may hit either."""

from types import SimpleNamespace

import numpy as np

from pbrs_farm.check.cases import Cast, Scene
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.pixel_checks import of_another_part


def test_of_two_crossing_surfaces_the_other_is_accepted_only_on_their_line() -> None:
    # A frame across the axis at 2 m, and a leaf at 45 degrees that crosses it at x = 0.
    frame = [(-1, -1, -2), (1, -1, -2), (0, 2, -2)]
    leaf = [(-1, -1, -3), (1, -1, -1), (0, 2, -2)]
    triangles = SimpleNamespace(
        vertices=np.array(frame + leaf, np.float32),
        faces=np.arange(6).reshape(2, 3),
        has_holes=np.zeros(2, bool),
        is_hole=lambda faces, _points: np.zeros(len(faces), bool),
        instance=np.array([1, 1]),
        part=np.array([0, 1]),
    )
    rays = Rays(triangles)
    directions = np.array([[1e-5, 0.1, -1], [0.1, 0.1, -1], [-0.1, 0.1, -1], [0.9, 0.9, -1]])
    first = rays.first(np.zeros(3), directions)
    scene, pixels = Scene(triangles, rays), np.zeros(4, int)
    faces = of_another_part(Cast(scene, pixels, pixels, np.zeros(3), directions, first))
    assert first.tolist() == [1, 1, 0, -1]
    assert faces.tolist() == [0, -1, -1, -1]
