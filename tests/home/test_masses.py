"""Masses of items by their materials."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core import classes
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Material, MaterialKind, corners_of_surfaces
from pbrs_farm.geometry.solids import box
from pbrs_farm.home.masses import body_kg

WOOD, CLOTH = Material("oak wood"), Material("fabric pillow")


def solid(size: tuple[float, float, float]) -> F64:
    return corners_of_surfaces([box("", np.zeros(3), np.array(size) / 2, 0)])


def test_a_table_weighs_as_much_as_its_boards() -> None:
    parts = [((1.2, 0.03, 0.8), 1), ((0.05, 0.7, 0.05), 4)]
    solids = [(solid(size), WOOD) for size, n in parts for _ in range(n)]
    expected = 650 * (1.2 * 0.03 * 0.8 + 4 * 0.05 * 0.7 * 0.05)
    assert body_kg(solids, classes.TABLE) == pytest.approx(expected, rel=1e-5)


def test_a_chest_drawn_as_one_closed_shell_weighs_as_hollow_boards() -> None:
    area = 2 * (1.0 * 0.8 + 1.0 * 0.5 + 0.8 * 0.5)
    mass = body_kg([(solid((1.0, 0.8, 0.5)), WOOD)], classes.DRESSER)
    assert mass == pytest.approx(650 * 0.018 * area, rel=1e-5)


def test_a_cushion_is_cloth_about_foam_and_an_open_sheet_its_area() -> None:
    area, volume = 2 * (0.5 * 0.4 + 0.5 * 0.2 + 0.4 * 0.2), 0.5 * 0.4 * 0.2
    mass = body_kg([(solid((0.5, 0.4, 0.2)), CLOTH)], classes.PILLOW)
    assert mass == pytest.approx(300 * 0.003 * area + 40 * (volume - 0.003 * area), rel=1e-5)
    sheet = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 0, 1], [0, 0, 1]]])
    steel = Material("brushed steel")
    assert body_kg([(sheet, steel)], classes.OTHERPROP) == pytest.approx(7.85)


@pytest.mark.parametrize(
    ("material", "nyu40", "kg_m3"),
    [
        (Material("1_4"), classes.TABLE, 650),
        (Material("1_4"), classes.TELEVISION, 1000),
        (Material("1_4"), classes.BOOKS, 700),
        (Material("white china"), classes.TABLE, 2400),
        (Material("1_4", MaterialKind.GLASS), classes.TABLE, 2500),
        (Material("steelhead"), classes.TABLE, 650),  # only whole words count
    ],
)
def test_a_name_gives_the_material_and_otherwise_the_class_does(
    material: Material, nyu40: int, kg_m3: float
) -> None:
    # Half a millimetre is solid for every material.
    mass = body_kg([(solid((1.0, 0.0005, 1.0)), material)], nyu40)
    assert mass == pytest.approx(kg_m3 * 0.0005, rel=1e-5)
