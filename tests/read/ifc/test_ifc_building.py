"""IFC buildings written row by row and read as houses."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
import shapely

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, ItemKind, MaterialKind, corners_of_surfaces
from pbrs_farm.core.mesh import signed_volume
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.crash_notes import set_watched
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.ifc import building as building_module
from pbrs_farm.repair import repair
from tests.inputs.ifc_files import IfcHouse, roof, storey_of_two_rooms
from tests.repair.embree import EmbreeOccluder


def two_rooms(unit: str = "mm", **more: object) -> IfcHouse:
    house = IfcHouse(unit, **{k: v for k, v in more.items() if k in ("at", "schema")})
    house.style("glass", (0.7, 0.9, 0.9), 0.7)
    house.storey("Erdgeschoss", 0.0)
    chosen = {k: v for k, v in more.items() if k in ("spaces", "slab")}
    storey_of_two_rooms(house, 0.0, **chosen)
    roof(house, 2.6)
    return house


def read(house: IfcHouse, folder: Path) -> House:
    return read_house(resolve(str(house.save(folder / "a.ifc"))), ReadFields())


def kinds(house: House) -> dict[str, int]:
    kind_values = [i.kind.value for i in house.items]
    return {k: kind_values.count(k) for k in sorted(set(kind_values))}


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_spaces_are_rooms_storeys_levels_and_openings_are_cut(tmp_path: Path, unit: str) -> None:
    house = read(two_rooms(unit), tmp_path)
    assert [r.name for r in house.rooms] == ["Wohnzimmer", "Küche"]
    assert [level.name for level in house.levels] == ["Erdgeschoss"]
    areas = [shapely.Polygon(r.polygon).area for r in house.rooms]
    assert areas == pytest.approx([12, 9], abs=1e-3)
    assert kinds(house) == {"ceiling": 1, "door": 2, "floor": 1, "wall": 5, "window": 2}
    assert [o.is_cut for o in house.openings] == [True] * 4
    window = next(i for i in house.items if i.kind is ItemKind.WINDOW)
    assert np.allclose(window.bounds[:, 1], [0.9, 2.1], atol=1e-4)
    assert {house.materials[s.material].kind for s in window.surfaces} == {
        MaterialKind.OPAQUE, MaterialKind.PANE,
    }  # fmt: skip
    assert next(i.tags for i in house.items if i.kind is ItemKind.DOOR) == ("hinge:left",)
    assert house.notes == ()


def test_a_window_without_a_style_has_its_thin_part_for_a_pane(tmp_path: Path) -> None:
    building = IfcHouse()
    building.storey("EG", 0.0)
    storey_of_two_rooms(building, 0.0)
    house = read(building, tmp_path)
    panes = [
        s for i in house.items if i.kind is ItemKind.WINDOW for s in i.surfaces
        if house.materials[s.material].kind is MaterialKind.PANE
    ]  # fmt: skip
    assert len(panes) == 2
    assert all(np.ptp(s.positions[:, 2]) == pytest.approx(0.02, abs=1e-4) for s in panes)


def test_without_slabs_the_spaces_get_floors_and_ceilings(tmp_path: Path) -> None:
    building = IfcHouse()
    building.storey("EG", None)
    storey_of_two_rooms(building, 0.0, slab=False)
    house = read(building, tmp_path)
    assert kinds(house)["floor"] == kinds(house)["ceiling"] == 2


def test_without_spaces_walls_and_slabs_enclose_rooms(tmp_path: Path) -> None:
    building = two_rooms(spaces=False)
    terrace = building.box_solid((0, -4, -0.25), (7.6, 0, 0))
    building.product("IfcSlab", "Terrace", [terrace], PredefinedType="FLOOR")
    house = read(building, tmp_path)
    areas = sorted(shapely.Polygon(r.polygon).area for r in house.rooms)
    assert areas == pytest.approx([9, 12], abs=0.1)


def test_a_slab_is_the_floor_above_and_rooms_below_get_a_ceiling(tmp_path: Path) -> None:
    building = IfcHouse("m")
    for k in range(2):
        building.storey(f"{k}. OG", 2.85 * k)
        storey_of_two_rooms(building, 2.85 * k)
    building.storey("Dach", 5.7)
    roof(building, 5.45)
    house = read(building, tmp_path)
    assert [level.name for level in house.levels] == ["0. OG", "1. OG"]
    assert [r.level_id for r in house.rooms] == ["0", "0", "1", "1"]
    ceilings = [i for i in house.items if i.kind is ItemKind.CEILING]
    assert sorted(round(float(i.bounds[0, 1]), 3) for i in ceilings) == [2.595, 2.595, 5.45]
    assert len({i.level_id for i in house.items if i.kind is ItemKind.WINDOW}) == 2


def test_coordinates_of_a_country_are_moved_to_the_origin(tmp_path: Path) -> None:
    house = read(two_rooms(at=(2_600_000, 1_200_000, 450)), tmp_path)
    assert np.abs([i.bounds for i in house.items]).max() < 20
    assert [n.kind for n in house.notes] == ["moved-to-origin"]
    areas = [shapely.Polygon(r.polygon).area for r in house.rooms]
    assert areas == pytest.approx([12, 9], abs=1e-3)


def test_classes_follow_entity_then_predefined_type_then_words(tmp_path: Path) -> None:
    building = two_rooms()
    solid = lambda: [building.box_solid((0, 0, 0), (0.6, 0.6, 0.5))]  # noqa: E731
    building.product("IfcSanitaryTerminal", "S 12", solid(), (1, 1, 0), PredefinedType="TOILETPAN")
    building.product("IfcFurniture", "Sessel 3", solid(), (2, 1, 0))
    building.product("IfcBuildingElementProxy", "Xyzzy", solid(), (3, 1, 0))
    building.product("IfcLightFixture", "L", solid(), (2, 2, 2))
    lawn = [building.box_solid((0, 0, 0), (6, 6, 0.02))]
    building.product("IfcBuildingElementProxy", "Surface:Grass:143210", lawn, (9, 0, -0.1))
    house = read(building, tmp_path)
    by_name = {i.name: (i.nyu40, i.kind.value, i.room_id) for i in house.items}
    assert by_name["S 12"] == (33, "object", "0_0")
    assert by_name["Sessel 3"] == (5, "object", "0_0")
    assert by_name["Xyzzy"] == (40, "object", "0_0")
    assert by_name["L"] == (35, "lamp", "0_0")
    assert by_name["Surface:Grass:143210"][:2] == (2, "ground")
    assert [n.kind for n in house.notes] == ["unmapped-class"]


def test_a_curtain_walls_glass_plates_are_windows(tmp_path: Path) -> None:
    building = two_rooms()
    wall = building.row("IfcCurtainWall", Name="Front")
    parts = []
    for k, style in enumerate(("glass", "")):
        solid = building.box_solid((0, 0, 0), (1, 0.02, 2), style)
        parts.append(building.product("IfcPlate", f"P{k}", [solid], (k, -1, 0)))
    building.contained.clear()  # each part is contained only in its wall
    building.row("IfcRelAggregates", RelatingObject=wall, RelatedObjects=parts)
    house = read(building, tmp_path)
    assert {i.name: i.kind.value for i in house.items if i.name[0] == "P"} == {
        "P0": "window",
        "P1": "wall",
    }


def test_names_written_as_a_star_lose_no_products(tmp_path: Path) -> None:
    text = two_rooms().text()
    broken = text.replace("'South'", "*").replace("'Door'", "*")
    assert broken != text
    path = tmp_path / "a.ifc"
    path.write_text(broken)
    house = read_house(resolve(str(path)), ReadFields())
    assert kinds(house) == {"ceiling": 1, "door": 2, "floor": 1, "wall": 5, "window": 2}


def test_a_product_whose_shape_fails_is_a_note(tmp_path: Path) -> None:
    building = two_rooms()
    flat = building.extruded([(0, 0), (0, 0), (0, 0)], 1.0)
    building.product("IfcFurniture", "Flat", [flat], (1, 1, 0))
    house = read(building, tmp_path)
    assert [n.kind for n in house.notes] == ["unusable-model"]
    assert "Flat" in house.notes[0].place


@pytest.mark.parametrize(
    ("axis_y", "scale"), [((0, 1, 0), 1.0), ((0, -1, 0), 1.0), ((0, -1, 0), 0.5)]
)
def test_a_mirrored_mapped_item_faces_outwards(
    tmp_path: Path, axis_y: tuple[int, int, int], scale: float
) -> None:
    building = two_rooms()
    boxes = [((0, 0.1, 0), (0.4, 0.5, 0.4)), ((0, 0.1, 0.4), (0.4, 0.2, 0.9))]
    chair = building.mapped(
        [building.box_solid(a, b) for a, b in boxes], axis_y=axis_y, scale=scale
    )
    building.product("IfcFurniture", "Stuhl", [chair], (1, 1.5, 0))
    item = next(i for i in read(building, tmp_path).items if i.name == "Stuhl")
    corners = corners_of_surfaces(item.surfaces)
    volume = signed_volume(corners, corners.reshape(-1, 3).mean(0))
    assert volume == pytest.approx((0.4**3 + 0.4 * 0.1 * 0.5) * scale**3, rel=1e-4)


def test_an_attic_is_no_room_unless_it_is_high(tmp_path: Path) -> None:
    building = two_rooms()
    building.space("Roof", [(0, 0), (4, 0), (4, 3), (0, 3)], 3.0, 1.2)
    assert [r.name for r in read(building, tmp_path).rooms] == ["Wohnzimmer", "Küche"]


def test_a_zipped_building_is_read(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.ifczip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.ifc", two_rooms().text())
    assert len(read_house(resolve(str(tmp_path / "a.ifczip")), ReadFields()).rooms) == 2


def test_the_library_runs_in_a_child_that_may_crash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(building_module, "read_ifc", None)
    set_watched(False)
    try:
        assert len(read(two_rooms(), tmp_path).rooms) == 2
    finally:
        set_watched()


def _cyclic(text: str) -> str:
    """A placement that is relative to itself."""
    rows = text.splitlines()
    k = next(i for i, r in enumerate(rows) if "IFCLOCALPLACEMENT(" in r)
    number = rows[k].split("=")[0]
    rows[k] = f"{number}=IFCLOCALPLACEMENT({number},$);"
    return "\n".join(rows)


@pytest.mark.parametrize(
    ("written", "schema"),
    [
        ("IFC2X_FINAL", "IFC2X3"),
        ("IFC2X2_FINAL", "IFC2X3"),
        ("IFC2X3_TC1", "IFC2X3"),
        ("IFC4_ADD2", "IFC4"),
        ("IFC4X3_RC2", "IFC4X3_ADD2"),
    ],
)
def test_older_and_draft_schemas_are_read_as_their_family(
    tmp_path: Path, written: str, schema: str
) -> None:
    building = IfcHouse(schema="IFC2X3" if schema == "IFC2X3" else "IFC4")
    building.storey("EG", 0.0)
    corners = [(0, 0), (4, 0), (4, 3), (0, 3)]
    for k in range(4):
        building.wall(f"W{k}", corners[(k + 1) % 4], corners[k], 0.0, 2.5)
    building.space("Wohnen", corners, 0.0, 2.5)
    path = tmp_path / "a.ifc"
    path.write_text(building.text().replace(building.model.schema_identifier, written))
    assert f"'{written}'" in path.read_text()
    house = read_house(resolve(str(path)), ReadFields())
    assert kinds(house) == {"ceiling": 1, "floor": 1, "wall": 4}


DAMAGED = {
    "schema": (lambda t: t.replace("'IFC4'", "'IFC151'"), "is IFC151, which is not supported"),
    "empty": (lambda t: "", "is empty"),
    "xml": (lambda t: "<?xml version='1.0'?><ifcXML/>", "IFCXML"),
    "json": (lambda t: '{"header": {}}', "IFC5"),
    "cut": (lambda t: t[: len(t) // 2], "a string is not closed|cut short"),
    "string": (lambda t: t.replace("'Erdgeschoss'", "'Erdgeschoss", 1), r"line \d+: a string"),
    "comment": (lambda t: t.replace("DATA;", "DATA; /* ", 1), "a comment is not closed"),
    "cycle": (_cyclic, r"#\d+: a cycle of references"),
    "missing": (lambda t: t.replace("(#", "(#9999", 1), "which does not exist"),
    "twice": (lambda t: t.replace("\n#2=", "\n#1=", 1), "#1: exists twice"),
    "no project": (lambda t: t.replace("IFCPROJECT(", "IFCNOTHING("), "IfcProject|damaged"),
    "no rooms": (lambda t: IfcHouse().text(), "has no space"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_file_is_refused_with_its_place(tmp_path: Path, case: str) -> None:
    damage, text = DAMAGED[case]
    path = tmp_path / "a.ifc"
    path.write_text(damage(two_rooms().text()))
    with pytest.raises(BadHouse, match=text) as caught:
        read_house(resolve(str(path)), ReadFields())
    assert "\n" not in str(caught.value)


def test_relations_that_lack_a_side_are_ignored(tmp_path: Path) -> None:
    path = tmp_path / "a.ifc"
    pattern = r"(IFCREL(?:VOIDS|FILLS)ELEMENT\('[^']*',[^,]*,[^,]*,[^,]*,)#\d+"
    text, n_broken = re.subn(pattern, r"\1$", two_rooms().text())
    assert n_broken >= 2
    path.write_text(text)
    assert kinds(read_house(resolve(str(path)), ReadFields()))["wall"] >= 4


def test_a_chair_of_millions_of_triangles_is_refused(tmp_path: Path) -> None:
    building = two_rooms()
    points = np.random.default_rng(0).random((60, 3))
    solid = building.mesh_solid(points, np.arange(60).reshape(-1, 3))
    building.product("IfcFurniture", "Chair", [solid], (1, 1, 0))
    source = resolve(str(building.save(tmp_path / "a.ifc")))
    with pytest.raises(BadHouse, match="more than 15 triangles"):
        read_house(source, ReadFields(max_model_triangles=15))


@pytest.mark.parametrize(("slab_top", "floor_y"), [(-0.12, -0.12), (0.0, 0.0), (0.05, 0.0)])
def test_a_room_reaches_down_to_its_slab_where_no_finish_is_drawn(
    tmp_path: Path, slab_top: float, floor_y: float
) -> None:
    """A garage: the space ends at the floor's finish, the door's hole reaches below it."""
    building = IfcHouse()
    building.storey("EG", 0.0)
    corners = [(0, 0), (4.4, 0), (4.4, 5.4), (0, 5.4)]
    for k, corner in enumerate(corners):
        wall = building.wall(f"Wall {k}", corner, corners[(k + 1) % 4], -0.5, 3.1)
        if k == 0:
            hole = building.hole(wall, 1.0, 2.4, 0.3, 2.3)
            leaf = building.box_solid((0, 0.08, 0.2), (2.4, 0.12, 2.3))
            building.fill(hole, "IfcDoor", "Garage door", [leaf])
    slab = building.box_solid((0, 0, slab_top - 0.25), (4.4, 5.4, slab_top))
    building.product("IfcSlab", "Slab", [slab], PredefinedType="FLOOR")
    inside = [(0.2, 0.2), (4.2, 0.2), (4.2, 5.2), (0.2, 5.2)]
    building.space("Garage", inside, 0.0, 2.6)
    roof = building.box_solid((-0.3, -0.3, 0), (4.7, 5.7, 0.3))
    building.product("IfcSlab", "Roof", [roof], (0, 0, 2.6), PredefinedType="ROOF")
    house = read_house(resolve(str(building.save(tmp_path / "garage.ifc"))), ReadFields())
    (room,) = house.rooms
    assert room.floor_y == pytest.approx(floor_y, abs=1e-5)
    _repaired, report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert report.leaks.closed_share == 1
    assert (report.leaks.n_sky, report.leaks.n_rays > 100_000) == (0, True)


def test_a_stairwell_that_is_a_room_of_two_storeys_is_closed(tmp_path: Path) -> None:
    building = IfcHouse()
    building.storey("EG", 0.0)
    corners, top = [(0, 0), (6, 0), (6, 4), (0, 4)], 5.45
    for k, corner in enumerate(corners):
        building.wall(f"Wall {k}", corner, corners[(k + 1) % 4], 0.0, top)
    ground = building.box_solid((0, 0, -0.25), (6, 4, 0))
    building.product("IfcSlab", "Ground", [ground], PredefinedType="FLOOR")
    building.space("Hall", [(0.2, 0.2), (4, 0.2), (4, 3.8), (0.2, 3.8)], 0.0, 2.6)
    stairs = [(4, 0.2), (5.8, 0.2), (5.8, 3.8), (4, 3.8)]
    building.space("Stair", stairs, 0.0, top)
    flight = building.box_solid((4.2, 0.5, 0), (5.0, 3.5, 2.85))
    building.product("IfcStair", "Stair", [flight])
    building.storey("OG", 2.85)
    floor = building.box_solid((0, 0, 2.6), (4, 4, 2.85))
    building.product("IfcSlab", "Upper", [floor], PredefinedType="FLOOR")
    building.space("Landing", [(0.2, 0.2), (4, 0.2), (4, 3.8), (0.2, 3.8)], 2.85, 2.6)
    roof = building.box_solid((-0.3, -0.3, 0), (6.3, 4.3, 0.3))
    building.product("IfcSlab", "Roof", [roof], (0, 0, top), PredefinedType="ROOF")
    house = read_house(resolve(str(building.save(tmp_path / "stair.ifc"))), ReadFields())
    _repaired, report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert [room.reason for room in report.rooms if room.reason] == []
    assert (report.leaks.closed_share, report.leaks.n_sky) == (1, 0)


def test_a_repaired_building_leaks_no_ray_and_keeps_walls_and_openings(tmp_path: Path) -> None:
    house = read(two_rooms(), tmp_path)
    repaired, report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert report.leaks is not None
    assert report.leaks.n_rays > 0
    assert (report.leaks.n_sky, report.leaks.closed_share) == (0, pytest.approx(1))
    assert "wall-lost" not in {n.kind for n in repaired.notes}
    assert len(repaired.openings) == len(house.openings) == 4
