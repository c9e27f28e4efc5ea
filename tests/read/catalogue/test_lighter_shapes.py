from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Material
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.geometry.solids import box, sphere
from pbrs_farm.read.catalogue.library_shapes import lighter_shape


def _ball(n: int = 160) -> Shape:
    surface = sphere("ball", np.array([0.0, 0.5, 0.0]), 0.5, 0, n=n)
    return Shape((surface,), (Material("m"),))


def _n_faces(shape: Shape) -> int:
    return sum(len(s.faces) for s in shape.surfaces)


def test_a_heavy_shape_gets_light_and_keeps_its_size() -> None:
    heavy = _ball()
    lighter = lighter_shape(heavy, 4000, 1 / 20)
    assert _n_faces(heavy) > 20_000
    assert _n_faces(lighter) <= 4000
    assert_allclose(lighter.bounds, heavy.bounds, atol=1e-6)


def test_its_surface_and_its_shading_hardly_change() -> None:
    (surface,) = lighter_shape(_ball(), 3000, 1 / 20).surfaces
    assert surface.normals is not None
    radius = np.linalg.norm(surface.positions - [0, 0.5, 0], axis=1)
    assert_allclose(radius, 0.5, atol=0.02)
    outward = (surface.positions - [0, 0.5, 0]) / radius[:, None]
    assert ((outward * surface.normals).sum(-1) > 0.9).all()
    area = face_areas(triangle_corners(surface.positions, surface.faces)).sum()
    assert_allclose(area, np.pi, rtol=0.03)


def test_a_light_shape_is_unchanged() -> None:
    shape = _ball(12)
    assert lighter_shape(shape, 3000, 1 / 20) is shape


def test_a_shape_that_stays_heavy_is_as_light_as_it_may_get() -> None:
    lighter = lighter_shape(_ball(), 10, 1 / 40)
    assert 1000 < _n_faces(lighter) < _n_faces(_ball())


def test_surfaces_keep_their_number_and_touching_parts_still_touch() -> None:
    heavy = _ball()
    half = len(heavy.surfaces[0].faces) // 2
    upper = replace(heavy.surfaces[0], faces=heavy.surfaces[0].faces[half:])
    lower = replace(heavy.surfaces[0], faces=heavy.surfaces[0].faces[:half])
    tiny = box("tiny", np.array([0.0, 0.5, 0.0]), np.full(3, 1e-4), 0)
    parts = lighter_shape(replace(heavy, surfaces=(upper, tiny, lower)), 3000, 1 / 20).surfaces
    assert len(parts) == 3
    first, two = ({tuple(p) for p in s.positions[np.unique(s.faces)]} for s in (parts[0], parts[2]))
    assert len(first & two) > 20
