"""Ceilings of an IFC building: sloped roofs, suspended ceilings, slabs that act as roofs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.house import House, ItemKind
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.repair import repair
from tests.inputs.ifc_files import IfcHouse, attic, storey_of_two_rooms
from tests.repair.embree import EmbreeOccluder

ROOFS: dict[str, dict[str, Any]] = {
    "typed slab": {"roof": ("IfcSlab", "A", "B"), "PredefinedType": "ROOF"},
    "named slab": {"roof": ("IfcSlab", "Dach Nord", "Dach Sued")},
    "named floor": {"roof": ("IfcSlab", "Basic Roof:A", "Basic Roof:B"), "PredefinedType": "FLOOR"},
    "placed slab": {"roof": ("IfcSlab", "A", "B"), "PredefinedType": "FLOOR"},
    "roof": {"roof": ("IfcRoof", "A", "B")},
}


def read(house: IfcHouse, folder: Path) -> House:
    return read_house(resolve(str(house.save(folder / "a.ifc"))), ReadFields())


def of_kind(house: House, kind: ItemKind) -> list[str]:
    return [i.source_class for i in house.items if i.kind is kind]


def leaks_of(house: House) -> tuple[int, float]:
    """(rays that reach the sky, share of the floor in closed rooms)."""
    _, report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert report.leaks is not None
    assert report.leaks.n_rays > 0
    return report.leaks.n_sky, report.leaks.closed_share


@pytest.mark.quick(4)
@pytest.mark.parametrize("is_box", [True, False])
@pytest.mark.parametrize("how", ROOFS)
def test_a_sloped_roof_is_the_ceiling_of_the_attic(tmp_path: Path, how: str, is_box: bool) -> None:
    building = IfcHouse()
    attic(building, is_box=is_box, **ROOFS[how])
    house = read(building, tmp_path)
    assert of_kind(house, ItemKind.CEILING) == [ROOFS[how]["roof"][0]] * 2
    assert house.rooms[0].ceiling_y == pytest.approx(3.5, abs=0.06)
    assert leaks_of(house) == (0, 1.0)


@pytest.mark.parametrize("is_box", [True, False])
def test_a_roof_may_come_down_to_the_floor(tmp_path: Path, is_box: bool) -> None:
    building = IfcHouse()
    attic(building, knee=0.0, is_box=is_box, **ROOFS["typed slab"])
    assert leaks_of(read(building, tmp_path)) == (0, 1.0)


def test_without_a_roof_the_ceiling_slopes_as_the_space_does(tmp_path: Path) -> None:
    building = IfcHouse()
    attic(building, is_box=False)
    house = read(building, tmp_path)
    ceiling = next(i for i in house.items if i.kind is ItemKind.CEILING)
    assert ceiling.source_class == "IfcSpace"
    assert ceiling.bounds[:, 1] == pytest.approx([0.995, 3.495], abs=1e-3)
    assert leaks_of(house) == (0, 1.0)


def test_without_spaces_the_attic_is_as_high_as_its_roof(tmp_path: Path) -> None:
    building = IfcHouse()
    attic(building, has_space=False, **ROOFS["typed slab"])
    house = read(building, tmp_path)
    assert [round(r.ceiling_y, 1) for r in house.rooms] == [3.5]
    assert leaks_of(house) == (0, 1.0)


CEILINGS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "covering": ("IfcCovering", "C", {"PredefinedType": "CEILING"}),
    "covering of no type": ("IfcCovering", "Abgeh\u00e4ngte Decke", {}),
    "covering of a type of its own": ("IfcCovering", "C", {"PredefinedType": "USERDEFINED"}),
    "slab": ("IfcSlab", "Ceiling slab", {"PredefinedType": "ROOF"}),
    "proxy": ("IfcBuildingElementProxy", "Suspended ceiling", {}),
}


@pytest.mark.quick(2)
@pytest.mark.parametrize("how", CEILINGS)
def test_a_suspended_ceiling_sets_the_height_of_a_room(tmp_path: Path, how: str) -> None:
    entity, name, fields = CEILINGS[how]
    building = IfcHouse()
    building.storey("EG", 0.0)
    storey_of_two_rooms(building, 0.0)
    slab = building.box_solid((0, 0, 2.6), (7.6, 3.4, 2.85))
    building.product("IfcSlab", "Slab", [slab], PredefinedType="FLOOR")
    # A shadow gap of 3 cm runs around the ceiling of the first room.
    sheet = building.box_solid((0.23, 0.23, 2.2), (4.17, 3.17, 2.22))
    building.product(entity, name, [sheet], **fields)
    house = read(building, tmp_path)
    assert [round(r.ceiling_y, 3) for r in house.rooms] == [2.2, 2.6]
    assert leaks_of(house) == (0, 1.0)


@pytest.mark.quick(1)
@pytest.mark.parametrize("spaces", [True, False])
@pytest.mark.parametrize(
    ("name", "fields"), [("Basic Roof:Flat", {}), ("S 3", {"PredefinedType": "FLOOR"})]
)
def test_the_slab_on_top_is_a_roof_with_no_room_on_it(
    tmp_path: Path, name: str, fields: dict[str, Any], spaces: bool
) -> None:
    building = IfcHouse()
    for k in range(2):
        building.storey(f"{k}. OG", 2.85 * k)
        storey_of_two_rooms(building, 2.85 * k, spaces=spaces)
    solid = building.box_solid((0, 0, 0), (7.6, 3.4, 0.25))
    building.product("IfcSlab", name, [solid], (0, 0, 5.45), **fields)
    # Add a parapet of 1 m on top.
    building.wall("Parapet", (0, 0), (7.6, 0), 5.7, 1.0)
    house = read(building, tmp_path)
    assert [r.level_id for r in house.rooms] == ["0", "0", "1", "1"]
    heights = [r.ceiling_y - r.floor_y for r in house.rooms]
    assert heights == pytest.approx([2.6] * 4, abs=1e-3)
    roof = next(i for i in house.items if i.name == name)
    assert roof.kind is ItemKind.CEILING
    assert leaks_of(house) == (0, 1.0)


def test_a_space_on_a_roof_under_the_sky_is_no_room(tmp_path: Path) -> None:
    building = IfcHouse()
    building.storey("EG", 0.0)
    storey_of_two_rooms(building, 0.0)
    solid = building.box_solid((0, 0, 2.6), (7.6, 3.4, 2.85))
    building.product("IfcSlab", "Roof", [solid])
    building.space("Roof", [(0, 0), (7.6, 0), (7.6, 3.4), (0, 3.4)], 2.85, 3.0)
    house = read(building, tmp_path)
    assert [r.name for r in house.rooms] == ["Wohnzimmer", "K\u00fcche"]
    assert [n.kind for n in house.notes] == ["degenerate-room"]


@pytest.mark.parametrize("has_spaces", [True, False])
def test_a_slab_that_carries_a_storey_is_no_roof_under_any_name(
    tmp_path: Path, has_spaces: bool
) -> None:
    building = IfcHouse()
    for k in range(2):
        building.storey(f"{k}. OG", 2.85 * k)
        storey_of_two_rooms(building, 2.85 * k, spaces=has_spaces, slab=False)
        floor = building.box_solid((0, 0, -0.25), (7.6, 3.4, 0))
        building.product("IfcSlab", "Roof slab", [floor], (0, 0, 2.85 * k))
    house = read(building, tmp_path)
    slabs = [i for i in house.items if i.name == "Roof slab"]
    assert [i.kind for i in slabs] == [ItemKind.FLOOR] * 2
    assert np.ptp([i.bounds[1, 1] for i in slabs]) == pytest.approx(2.85)


def test_a_roof_next_to_a_higher_house_carries_no_storey(tmp_path: Path) -> None:
    building = IfcHouse()
    for k in range(2):
        building.storey(f"{k}. OG", 2.85 * k)
        storey_of_two_rooms(building, 2.85 * k, spaces=False)
    # A garage whose roof is embedded in the wall of the house.
    building.wall("Garage", (11.0, 0), (11.0, 3.4), 0.0, 2.4)
    roof_slab = building.box_solid((7.5, 0, 0), (11.0, 3.4, 0.2))
    building.product("IfcSlab", "Garage roof", [roof_slab], (0, 0, 2.4))
    house = read(building, tmp_path)
    assert [i.kind for i in house.items if i.name == "Garage roof"] == [ItemKind.CEILING]
