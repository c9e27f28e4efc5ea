"""Convex and symmetric lamps are recognised, so that no shadow ray goes to their far side."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.transport.scene_tables.lamp_symmetry import symmetry_row
from pbrs_farm.transport.scene_tables.scene_tables import tables_from_house
from pbrs_farm.transport.validation import known_rooms as rooms

RECIPE = recipe_from_name("fast")


def ball(centre: tuple[float, float, float] = (3.0, 2.0, -7.0)) -> np.ndarray:
    surface = rooms.sphere(centre, 0.04, 0)
    return triangle_corners(surface.positions, surface.faces)


def test_a_sphere_is_symmetric_about_its_centre_and_knows_its_outside() -> None:
    row = symmetry_row(ball())
    assert np.allclose(row, (3, 2, -7, 0.04), atol=1e-4)
    assert np.allclose(symmetry_row(ball()[:, ::-1]), (3, 2, -7, -0.04), atol=1e-4)


def test_a_lamp_that_shows_its_inside_or_has_no_opposite_is_not_symmetric() -> None:
    whole = ball()
    centre = np.array((3.0, 2.0, -7.0))
    half = whole[whole[..., 1].mean(1) > 2.0]
    dented = np.where((whole[..., 1] > 2.035)[..., None], centre, whole)
    egg = centre + (whole - centre) * np.where((whole[..., 1] > 2.0)[..., None], 1.5, 1.0)
    two = np.concatenate([whole, whole + np.array((0.3, 0, 0))])
    twice = np.concatenate([whole, whole])
    one_open = whole[1:]
    alike = 1 + int(np.abs(face_areas(whole[1:]) - face_areas(whole[:1])).argmin())
    one_for_another = np.concatenate([whole[1:], whole[alike : alike + 1]])
    cases = (half, dented, egg, two, twice, one_open, one_for_another, whole[:1])
    assert [float(symmetry_row(corners)[3]) for corners in cases] == [0] * len(cases)


@pytest.mark.parametrize(
    ("material", "radius"),
    [
        (rooms.BULB, 0.05),
        (Material("thin", kind=MaterialKind.GLASS), 0),
        (Material("shade", kind=MaterialKind.SHADE, diffuse=(0.5, 0.5, 0.5)), 0),
    ],
)
def test_a_lamp_with_translucent_faces_shows_its_inside(material: Material, radius: float) -> None:
    walls = rooms.shell((4.0, 2.5, 4.0), 0)
    lamp = rooms.bulb((1.0, 2.0, 1.0), 1, 900.0)
    house = rooms.house(walls, [rooms.matte("wall", 0.7), material], lamps=[lamp])
    assert tables_from_house(house, {}, RECIPE).lamp_symmetries[0, 3] == pytest.approx(
        radius, abs=1e-3
    )
