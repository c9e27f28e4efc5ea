"""Boxes of repaired houses: filled by the mesh, along the axes of the source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.assets import homes_package
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import Box, House, Item, LightPart, corners_of_surfaces
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import repair
from tests.example_homes import example_homes
from tests.repair.embree import EmbreeOccluder

CHAIR = NYU40_NAMES.index("chair")


def errors_mm(house: House) -> F64:
    """Distance in mm of each side of each item's box from its triangles."""
    errors = []
    for item in house.items:
        points = corners_of_surfaces(item.surfaces).reshape(-1, 3)
        if len(points):
            local = (points - item.oriented_box.centre) @ item.oriented_box.axes
            sides = np.array([-local.min(0), local.max(0)]) - item.oriented_box.half
            errors.append(1000 * np.abs(sides).max())
    return np.array(errors)


def grown(item: Item) -> Item:
    if item.box is None:
        return item
    return replace(item, box=Box(item.box.centre + 0.1, item.box.half * 2, item.box.axes))


def test_a_box_larger_than_its_mesh_becomes_the_meshs() -> None:
    home = builtin_home()
    planned = home.with_items(map(grown, home.items))
    assert errors_mm(planned).max() > 90
    house, _report = repair(planned, RepairFields())
    assert errors_mm(house).max() < 0.01
    # Its axes are unchanged.
    axes = {item.id: item.box.axes for item in planned.items if item.box is not None}
    boxed = [item for item in house.items if item.id in axes]
    assert len(boxed) > 3
    for item in boxed:
        assert item.box is not None
        np.testing.assert_array_equal(item.box.axes, axes[item.id])


def test_a_bulb_that_repair_adds_is_in_its_lamps_box() -> None:
    home = builtin_home()
    number, item = next((k, i) for k, i in enumerate(home.items) if i.box is not None and i.lights)
    low, high = item.bounds
    above = (float(low[0]), float(high[1]) + 0.1, float(low[2]))
    lamp = replace(item, lights=(LightPart(above, 0.03, 800.0, PowerUnit.LUMEN),))
    items = [*home.items]
    items[number] = lamp
    house, _report = repair(home.with_items(items), RepairFields())
    assert errors_mm(house).max() < 0.01


def test_vertices_that_no_triangle_has_are_in_no_box() -> None:
    home = builtin_home()
    number = next(k for k, i in enumerate(home.items) if i.nyu40 == CHAIR)
    item = home.items[number]
    first = item.surfaces[0]
    far = replace(
        first,
        positions=np.concatenate([first.positions, np.full((1, 3), 30, np.float32)]),
        uvs=None,
        normals=None,
    )
    items = [*home.items]
    items[number] = replace(item, surfaces=(far, *item.surfaces[1:]), box=None)
    house, _report = repair(home.with_items(items), RepairFields())
    assert errors_mm(house).max() < 0.01


@pytest.mark.homes
@pytest.mark.slow
@pytest.mark.parametrize("name", [h.name for h in homes_package.example_homes()])
def test_boxes_of_example_homes_are_their_meshes(name: str) -> None:
    package = example_homes()
    data, file = package.home(name)
    house = read_home(data, file, resources=package.resources(), fields=ReadFields())
    house, _report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert errors_mm(house).max() < 0.01
