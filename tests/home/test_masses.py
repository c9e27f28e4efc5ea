"""Masses of items by their materials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core import classes
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Material, MaterialKind, corners_of_surfaces
from pbrs_farm.furnishings.things.families import family_pieces, family_shape
from pbrs_farm.geometry.solids import box
from pbrs_farm.home.masses import body_kg, surfaces_kg, weighed
from pbrs_farm.read.builtin.builtin_home import builtin_home

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
    assert body_kg([(sheet, steel)], classes.OTHERPROP) == pytest.approx(7850 * 0.0006)


@pytest.mark.parametrize("name", ["oak wood", "joinery"])
def test_an_inner_door_weighs_as_a_light_core_between_skins(name: str) -> None:
    mass = body_kg([(solid((0.86, 2.0, 0.04)), Material(name))], classes.DOOR)
    assert 15 < mass < 30


def test_parts_are_weighed_in_their_present_materials_and_a_stated_mass_remains() -> None:
    house = builtin_home()
    (k, door), *_ = ((k, i) for k, i in enumerate(house.items) if i.joints)
    assert 15 < weighed(house).items[k].joints[0].mass_kg < 30
    stated = replace(door.joints[0], mass_kg=3.0)
    for source_class, mass in (("someone's door", 3.0), ("builtin#door", 21.298)):
        item = replace(door, source_class=source_class, joints=(stated,))
        (joint,) = weighed(house.with_items((item,))).items[0].joints
        assert joint.mass_kg == pytest.approx(mass, abs=0.002)


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


def test_washing_machines_weigh_as_much_as_real_ones() -> None:
    masses = [
        surfaces_kg(shape.surfaces, shape.materials, 0)
        for piece in family_pieces()
        if piece.id.startswith("generated#washing_machine")
        for shape in [family_shape(piece)]
    ]
    assert len(masses) > 20
    assert min(masses) > 55
    assert max(masses) < 80
