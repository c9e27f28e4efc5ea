"""Prisms over plan polygons: the solid is the polygon times its height, sides upright."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pbrs_farm.core.mesh import face_areas, triangle_corners, unit_normals
from pbrs_farm.repair.structure.booleans import Tag, TagTable, patches_from_solid
from pbrs_farm.repair.structure.prisms import level_plane, solid_prisms, uv_parts

RECTANGLE = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]
DENTED = [(0.0, 0.0), (2.0, 1.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]
TAG = Tag(0, "side", 0)


@pytest.mark.parametrize(
    ("outline", "hole"),
    [
        (RECTANGLE, [(0.0, 0.0), (1.0, 0.5), (0.5, 1.0)]),
        (RECTANGLE, [(0.0, 0.0), (0.05, 0.02), (0.02, 0.05)]),
        (DENTED, [(2.0, 1.0), (2.2, 1.5), (1.8, 1.5)]),
        (DENTED, [(2.0, 1.0), (2.002, 1.005), (1.998, 1.005)]),
        # A sharp wedge between the rings: without a small crumb removed they would touch.
        (RECTANGLE, [(0.0, 0.0), (3.0, 0.06), (3.0, 1.0)]),
    ],
)
def test_a_prism_whose_hole_touches_its_outline_keeps_volume_and_upright_sides(
    outline: list[tuple[float, float]], hole: list[tuple[float, float]]
) -> None:
    polygon, table = shapely.Polygon(outline, [hole]), TagTable()
    assert polygon.is_valid
    (solid,) = solid_prisms([polygon], level_plane(0.0), level_plane(0.1), (TAG,) * 3, table)
    assert solid.volume() == pytest.approx(0.1 * polygon.area, rel=1e-5)
    (patch,) = patches_from_solid(solid, table)
    corners = triangle_corners(patch.positions, patch.faces)
    up = np.abs(unit_normals(corners)[:, 1])
    assert face_areas(corners)[(up > 1e-3) & (up < 0.999)].sum() < 1e-9


def test_tiles_of_one_picture_each_are_one_part_and_a_turned_one_is_separate() -> None:
    corners = np.array([[x, 0.0, z] for x in range(3) for z in (0.0, 1.0)], np.float64)
    positions = corners[[0, 2, 3, 1, 2, 4, 5, 3]]
    tile = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    (single,) = uv_parts(positions, faces, np.concatenate([tile, tile]))
    assert single.area.area == pytest.approx(2.0)
    turned = uv_parts(positions, faces, np.concatenate([tile, 1 - tile[:, ::-1]]))
    assert [part.area.area for part in turned] == pytest.approx([1.0, 1.0])
