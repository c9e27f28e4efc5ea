"""Doors, windows and holes of an IFC building, from its relations, names and shapes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.house import House, ItemKind, Opening
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs.ifc_files import IfcHouse, roof, storey_of_two_rooms


def a_room(at: tuple[float, float, float] = (0, 0, 0)) -> tuple[IfcHouse, Any]:
    """A building of two rooms, and a wall in front of its south side to cut holes into."""
    building = IfcHouse(at=at)
    building.storey("EG", 0.0)
    storey_of_two_rooms(building, 0.0)
    roof(building, 2.6)
    return building, building.wall("Front", (-6, -2), (0, -2), 0.0, 2.6)


def read(house: IfcHouse, folder: Path) -> House:
    return read_house(resolve(str(house.save(folder / "a.ifc"))), ReadFields())


def in_front(house: House) -> list[Opening]:
    """The openings of the wall 1.8 to 2 m in front of the house."""
    return [o for o in house.openings if o.quad[:, 2].min() > 1.5]


def size_of(opening: Opening) -> list[float]:
    """Width, height and depth of the filling of the hole."""
    axes = np.stack([np.cross([0, 1, 0], opening.normal), [0, 1, 0], opening.normal], 1)
    return [round(float(e), 2) for e in np.ptp(opening.cutter.positions @ axes, axis=0)]


def test_a_slit_of_a_window_in_a_thick_wall_is_found_by_its_relation(tmp_path: Path) -> None:
    building, wall = a_room()
    hole = building.hole(wall, 2.0, 0.15, 0.5, 1.2)
    pane = building.box_solid((0, 0.09, 0), (0.15, 0.11, 1.2))
    building.fill(hole, "IfcWindow", "Slit", [pane])
    house = read(building, tmp_path)
    (opening,) = in_front(house)
    assert size_of(opening) == [0.15, 1.2, 0.2]
    assert opening.normal[2] == pytest.approx(1, abs=1e-6) or opening.normal[2] == pytest.approx(-1)
    assert (opening.is_cut, opening.is_window) == (True, True)


def test_a_door_on_a_higher_floor_than_its_wall_has_its_opening(tmp_path: Path) -> None:
    building, _ = a_room()
    # Floors 0.6 m apart are separate levels: the door is on the upper, its wall on the lower.
    building.space("Podest", [(-6, -1.8), (0, -1.8), (0, 0), (-6, 0)], 0.6, 2.0)
    wall = building.wall("Back", (-6, -4), (0, -4), 0.0, 2.6)
    hole = building.hole(wall, 2.0, 0.9, 0.6, 1.9)
    leaf = building.box_solid((0, 0.08, 0), (0.9, 0.12, 1.88))
    door = building.fill(hole, "IfcDoor", "Door", [leaf])
    house = read(building, tmp_path)
    assert door.GlobalId in {o.item_id for o in house.openings}


def test_an_unfilled_hole_is_an_opening_and_a_niche_is_not(tmp_path: Path) -> None:
    building, wall = a_room()
    building.hole(wall, 1.0, 0.9, 0.0, 2.0)
    niche = building.hole(wall, 3.0, 0.9, 0.5, 1.0)
    niche.Representation.Representations[0].Items = [
        building.box_solid((0, -0.1, 0), (0.9, 0.1, 1.0))
    ]
    (opening,) = in_front(read(building, tmp_path))
    assert (opening.item_id, opening.is_window, opening.is_cut) == (None, False, True)
    assert size_of(opening) == [0.9, 2.0, 0.2]


def test_a_door_whose_wall_is_missing_keeps_its_opening(tmp_path: Path) -> None:
    building, wall = a_room()
    hole = building.hole(wall, 2.0, 0.9, 0.0, 2.0)
    leaf = building.box_solid((0, 0.08, 0), (0.9, 0.12, 2.0))
    door = building.fill(hole, "IfcDoor", "Door", [leaf])
    # A passage removes its jambs and lintel.
    building.hole(wall, 1.9, 2.1, 0.0, 2.4)
    of_item = {o.item_id: o for o in in_front(read(building, tmp_path))}
    assert size_of(of_item[door.GlobalId]) == [0.9, 2.0, 0.2]
    assert size_of(of_item[None]) == [2.1, 2.4, 0.2]
    assert [o.is_cut for o in of_item.values()] == [True, True]


def test_holes_in_both_leaves_of_a_wall_are_one_opening(tmp_path: Path) -> None:
    building, wall = a_room()
    outer = building.wall("Outer", (-6, -2.1), (0, -2.1), 0.0, 2.6, thick=0.1)
    hole = building.hole(wall, 2.0, 1.0, 0.9, 1.0)
    building.hole(outer, 2.0, 1.0, 0.9, 1.0, thick=0.1)
    pane = building.box_solid((0, 0.09, 0), (1.0, 0.11, 1.0))
    building.fill(hole, "IfcWindow", "Window", [pane])
    (opening,) = in_front(read(building, tmp_path))
    assert size_of(opening) == [1.0, 1.0, 0.3]
    assert opening.is_cut


@pytest.mark.parametrize("entity", ["IfcDoor", "IfcWindow"])
def test_a_door_or_window_without_a_shape_is_built_to_its_hole(tmp_path: Path, entity: str) -> None:
    building, wall = a_room()
    hole = building.hole(wall, 2.0, 1.0, 0.0, 2.0)
    leaf = building.box_solid((0, 0.09, 0), (1.0, 0.11, 2.0))
    filling = building.fill(hole, entity, "D 7", [leaf])
    filling.Representation = None
    house = read(building, tmp_path)
    (opening,) = in_front(house)
    item = next(i for i in house.items if i.id == opening.item_id)
    assert (item.id, item.kind.value) == (filling.GlobalId, entity.removeprefix("Ifc").lower())
    assert np.ptp(item.bounds, axis=0)[:2] == pytest.approx([1.0, 2.0], abs=0.02)
    assert item.tags == ("made",)


# Name, sill, height, predefined type -> expected kind.
NAMES = [
    ("M_Single-Flush:0864 x 2032mm:1423", 0.0, 2.03, "IfcWindow", "door"),
    ("Sliding-Closet:72 x 84", 0.0, 2.1, "IfcWindow", "door"),
    ("Bifold-4 Panel", 0.0, 2.1, "IfcWindow", "door"),
    ("Eingangst\u00fcr", 0.0, 2.1, "IfcWindow", "door"),
    ("Puerta de 1 hoja", 0.0, 2.1, "IfcWindow", "door"),
    ("M_Fixed:2800mm x 2410mm", 0.0, 2.41, "IfcWindow", "window"),
    ("Window by the door", 0.0, 2.1, "IfcWindow", "window"),
    ("Single-Flush", 1.0, 1.0, "IfcWindow", "window"),
    ("Double-Glass 1:1730 x 2032mm", 0.0, 2.03, "IfcWindow", "door"),
    ("Fenstertür 2-flg", 0.0, 2.1, "IfcWindow", "door"),
    ("Single-Flush", 0.0, 2.03, "IfcDoor", "door"),
    ("M_Casement:819mm x 759mm", 0.9, 0.8, "IfcDoor", "window"),
    ("Fenster 3", 0.9, 1.2, "IfcDoor", "window"),
    ("M_Fixed", 0.0, 2.1, "IfcDoor", "door"),
]


@pytest.mark.quick(8)
@pytest.mark.parametrize(("name", "sill", "height", "entity", "kind"), NAMES)
@pytest.mark.parametrize("z", [0.0, 450.0])
def test_names_and_sills_tell_doors_from_windows_that_an_exporter_mixed_up(
    tmp_path: Path, name: str, sill: float, height: float, entity: str, kind: str, z: float
) -> None:
    building, wall = a_room(at=(0, 0, z))
    hole = building.hole(wall, 2.0, 0.8, sill, height)
    leaf = building.box_solid((0, 0.09, 0), (0.8, 0.11, height))
    building.fill(hole, entity, name, [leaf])
    item = next(i for i in read(building, tmp_path).items if i.name == name)
    assert item.kind.value == kind
    assert item.tags == (("sliding",) if "Sliding" in name or "Bifold" in name else ())


def test_a_window_typed_as_a_door_is_a_window(tmp_path: Path) -> None:
    building, wall = a_room()
    hole = building.hole(wall, 2.0, 0.8, 0.0, 2.0)
    leaf = building.box_solid((0, 0.09, 0), (0.8, 0.11, 2.0))
    window = building.fill(hole, "IfcWindow", "D 7", [leaf])
    kind = building.row("IfcDoorType", Name="D", PredefinedType="DOOR", OperationType="NOTDEFINED")
    building.row("IfcRelDefinesByType", RelatedObjects=[window], RelatingType=kind)
    item = next(i for i in read(building, tmp_path).items if i.name == "D 7")
    assert item.kind is ItemKind.DOOR


def test_a_cabinet_with_two_doors_is_no_door(tmp_path: Path) -> None:
    building, _ = a_room()
    solid = [building.box_solid((0, 0, 0), (0.9, 0.6, 0.85))]
    name = "M_Base Cabinet-Double Door & 2 Drawer:0915mm"
    building.product("IfcFurnishingElement", name, solid, (1, 0.3, 0))
    house = read(building, tmp_path)
    item = next(i for i in house.items if i.name == name)
    assert (item.kind, item.nyu40) == (ItemKind.OBJECT, 3)
    assert len(house.openings) == 4
