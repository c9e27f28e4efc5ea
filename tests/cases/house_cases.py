"""Cases of rooms, walls, openings and roofs, in every format with rooms; writers write files."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core.house import ItemKind, MaterialKind
from pbrs_farm.repair.repair_report import RepairReport
from tests.cases.case import Case, house_of, named, repaired, run
from tests.cases.surface_cases import room
from tests.hostile.sound_inputs import suncg
from tests.inputs import front3d_files, plan_files
from tests.inputs.ifc_files import IfcHouse
from tests.inputs.scanned_stages import dining_group, write_scanned_stage
from tests.read.gltf.gltf_scenes import two_rooms
from tests.read.habitat.habitat_sets import dataset
from tests.read.suncg.suncg_root import item, material_of


def cases() -> Iterator[Case]:
    """By format."""
    yield Case("habitat_plain", partial(_habitat, 1.0), _ask_to_run)
    yield Case("habitat_scaled", partial(_habitat, 0.01), _ask_to_run)
    yield Case("suncg_light_row", _suncg, _ask_for_bulb_and_shade)
    yield Case("front_tiles", _front_tiles, _ask_for_the_openings_of_plain_walls)
    yield Case("react_coordinates", _react, _ask_for_holes_at_their_places)
    yield Case("zind_stub", _zind, _ask_for_the_stub)
    yield Case("roomplan_attic", _attic_scan, _ask_for_gables)
    yield Case("roomplan_stage", _scanned_stage, _ask_for_chairs_and_a_passage)
    yield Case("ifc_attic", partial(_ifc, _attic), _ask_for_a_sloped_ceiling)
    yield Case("ifc_lowceiling", partial(_ifc, _low_ceiling), _ask_for_the_height_of_the_ceiling)
    yield Case("ifc_twostoreys", partial(_ifc, _two_storeys), _ask_for_two_rooms)
    for record in (True, False):
        name = "ifc_skylight" if record else "ifc_bare_skylight"
        write = partial(_ifc, partial(_skylight, has_record=record))
        yield Case(name, write, _ask_for_light_from_the_roof)
    yield Case("ifc_no_floor", partial(_ifc, _no_floor), _ask_for_two_closed_rooms)
    yield Case("ifc_no_records", partial(_ifc, _no_records), _ask_for_two_closed_rooms)
    yield Case("ifc_tall_walls", partial(_ifc, _tall_walls), _ask_for_a_window_upstairs)
    for slab in (True, False):
        name = f"ifc_garage_{'solid' if slab else 'planar'}"
        write = partial(_ifc, partial(_garage, has_slab=slab))
        yield Case(name, write, _ask_for_a_closed_garage)
    yield Case("ifc_mapped", partial(_ifc, _mapped), _ask_for_positive_volumes)
    yield Case("grass", _grass, _ask_for_ground)


def _habitat(scale: float, folder: Path) -> Path:
    """A scene with a space in its name, and its stage in a unit of `scale` metres."""
    stage = two_rooms()
    stage.node("all", children=list(range(len(stage.nodes))), scale=[1 / scale] * 3)
    path = dataset(folder, stage, translation_origin="COM")
    config = folder / "stages/flat.stage_config.json"
    config.write_text(json.dumps(json.loads(config.read_text()) | {"scale": [scale] * 3}))
    return path.rename(path.with_name("flat 1.scene_instance.json"))


def _ask_to_run(path: Path) -> None:
    house = house_of(path)
    assert len(house.rooms) == 2
    width, _height, depth = np.ptp(np.concatenate([i.bounds for i in house.items]), axis=0)
    assert np.allclose((width, depth), (6, 3), atol=0.5)
    run(path, path.parents[1] / "out")


def _suncg(folder: Path) -> Path:
    house = suncg(folder)
    table = house.parents[1] / "metadata/light_geometry_compact.txt"
    table.write_text("lamp 1 material_1 1 material_2\nbare_lamp 1 material_1 0\n")
    return house


def _ask_for_bulb_and_shade(path: Path) -> None:
    house = house_of(path)
    assert item(house, "0_4").lights
    assert material_of(house, "0_4", "material_1_0").kind is MaterialKind.BULB
    assert material_of(house, "0_4", "material_2").kind is MaterialKind.SHADE


_TILED: Final = ("Bathroom-5", "SecondBedroom-6", "Kitchen-2")


def _front_tiles(folder: Path) -> Path:
    house = front3d_files.tile_walls(front3d_files.front_house("0.11 gaps"), _TILED)
    return _json(folder / "flat.json", house)


def _ask_for_the_openings_of_plain_walls(path: Path) -> None:
    plain = house_of(_json(path.with_name("plain.json"), front3d_files.front_house("0.11 gaps")))
    assert [o.id for o in house_of(path).openings] == [o.id for o in plain.openings]


def _react(folder: Path) -> Path:
    path = plan_files.write_react_planner(folder)
    return _json(path, plan_files.traced(json.loads(path.read_text()), 1.18))


def _ask_for_holes_at_their_places(path: Path) -> None:
    house = house_of(path)
    kinds = [i.kind for i in house.items]
    assert (kinds.count(ItemKind.WINDOW), kinds.count(ItemKind.DOOR)) == (4, 5)
    corners = np.concatenate([r.polygon for r in house.rooms])
    drawn = np.array([box for _type, box in plan_files.ROOMS])
    assert np.allclose(np.ptp(corners, axis=0), drawn.max(0)[2:] - drawn.min(0)[:2], atol=0.3)
    for hole in plan_files.HOLES:
        middles = np.array([o.quad.mean(0)[[0, 2]] for o in house.openings]) - corners.min(0)
        assert np.linalg.norm(middles - hole.at, axis=1).min() < 0.2, f"no {hole.kind} at {hole.at}"


def _zind(folder: Path) -> Path:
    path = plan_files.write_zind(folder)
    return _json(path, plan_files.with_a_stub(json.loads(path.read_text()))[0])


def _ask_for_the_stub(path: Path) -> None:
    (room,) = house_of(path).rooms
    _value, ring = plan_files.with_a_stub({"scale_meters_per_coordinate": {"floor_01": 1.0}})
    lost = shapely.Polygon(room.polygon).area - shapely.Polygon(ring).area
    assert abs(lost) < 0.3, f"the room is {lost:+.2f} m2 larger"


def _scanned_stage(folder: Path) -> Path:
    return write_scanned_stage(
        folder, opening="Opening0", objects=dining_group(), label="diningRoom"
    )


def _ask_for_chairs_and_a_passage(path: Path) -> None:
    house, _report = repaired(path)
    assert [r.name for r in house.rooms] == ["Dining room"]
    assert len([o for o in house.openings if not o.is_window]) == 2, "door and passage"
    pieces = [i.name for i in house.items if "stand-in" in i.tags and "piece:box" not in i.tags]
    assert pieces.count("chair") == 3, pieces


_KNEE, _RIDGE = 1.2, 3.0


def _attic_scan(folder: Path) -> Path:
    """RoomPlan: a room of 4 x 3 m with two walls of 1.2 m and two gables of 3 m."""
    x, z, eaves = 2.0, 1.5, _KNEE - _RIDGE / 2
    level = [[-x, _KNEE / 2, 0], [x, _KNEE / 2, 0], [x, -_KNEE / 2, 0], [-x, -_KNEE / 2, 0]]
    gable = [
        [-z, eaves, 0], [0, _RIDGE / 2, 0], [z, eaves, 0], [z, -_RIDGE / 2, 0], [-z, -_RIDGE / 2, 0],
    ]  # fmt: skip
    sides = [((-x, -z), (x, -z)), ((x, z), (-x, z)), ((-x, z), (-x, -z)), ((x, -z), (x, z))]
    walls = []
    for k, (a, b) in enumerate(sides):
        high = _KNEE if k < 2 else _RIDGE
        wall = plan_files.surface("wall", a, b, math.dist(a, b), 0.0, high)
        walls.append(wall | {"polygonCorners": level if k < 2 else gable, "completedEdges": []})
    floor = [[-x, -z, 0], [x, -z, 0], [x, z, 0], [-x, z, 0]]
    flat = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]
    value = {
        "version": 2, "story": 0, "walls": walls, "openings": [], "windows": [], "objects": [],
        "doors": [plan_files.surface("door", (x, -1), (x, 1), 0.8, 0.0, 2.0)],
        "sections": [{"label": "bedroom", "center": [0, 1, 0], "story": 0}],
        "floors": [{"dimensions": [4, 3, 0], "transform": flat, "polygonCorners": floor}],
    }  # fmt: skip
    return _json(folder / "room.json", value)


def _ask_for_gables(path: Path) -> None:
    """The room is as high as its gables at the ridge and as its knee walls at the eaves."""
    house, report = repaired(path)
    tops = np.array([i.bounds[1, 1] for i in house.items if i.kind is ItemKind.CEILING])
    lows = np.array([i.bounds[0, 1] for i in house.items if i.kind is ItemKind.CEILING])
    assert tops.max() > _RIDGE - 0.1, f"the ceiling ends at {tops.max():.2f}"
    assert lows.min() < _KNEE + 0.2, f"the ceiling begins at {lows.min():.2f}"
    _ask_for_no_leak(report)


def _ask_for_no_leak(report: RepairReport) -> None:
    assert report.leaks is not None
    assert report.leaks.n_sky == 0, f"{report.leaks.n_sky} rays reach the sky"


def _ifc(build: Callable[[IfcHouse], None], folder: Path) -> Path:
    house = IfcHouse("m")
    build(house)
    return house.save(folder / "house.ifc")


_W, _D, _T = 6.0, 5.0, 0.3  # a room's clear width and depth, and its walls


def _four_walls(house: IfcHouse, bottom: float, height: float, *, gables: bool = True) -> None:
    boxes = [((-_T, -_T), (_W + _T, 0)), ((-_T, _D), (_W + _T, _D + _T))]
    boxes += [((-_T, 0), (0, _D)), ((_W, 0), (_W + _T, _D))] if gables else []
    for k, (low, high) in enumerate(boxes):
        solid = house.box_solid((*low, 0), (*high, height))
        house.product("IfcWall", f"Wall {k}", [solid], (0, 0, bottom))


def _slab(house: IfcHouse, name: str, bottom: float, thick: float, kind: str | None) -> None:
    solid = house.box_solid((-_T, -_T, 0), (_W + _T, _D + _T, thick))
    fields = {"PredefinedType": kind} if kind else {}
    house.product("IfcSlab", name, [solid], (0, 0, bottom), **fields)


def _room(house: IfcHouse, name: str, bottom: float, height: float) -> None:
    house.space(name, [(0, 0), (_W, 0), (_W, _D), (0, _D)], bottom, height)


def _prism(house: IfcHouse, section: list[tuple[float, float]], x0: float, x1: float) -> Any:
    """A solid along x of a convex section (y, z)."""
    n = len(section)
    points = [(x, y, z) for x in (x0, x1) for y, z in section]
    caps = [(0, k, k + 1) for k in range(1, n - 1)]
    faces = [(a, c, b) for a, b, c in caps] + [(n + a, n + b, n + c) for a, b, c in caps]
    for k in range(n):
        j = (k + 1) % n
        faces += [(k, j, n + j), (k, n + j, n + k)]
    return house.mesh_solid(points, faces)


def _attic(house: IfcHouse) -> Any:
    """Knee walls of 1 m, gables, and two sloped slabs that meet at 3.5 m; returns the southern one."""
    house.storey("attic", 0.0)
    _four_walls(house, 0.0, 1.0, gables=False)
    slope = 2.5 / (_D / 2)
    gable = [(0.0, 0.0), (_D, 0.0), (_D, 1.0), (_D / 2, 3.5), (0.0, 1.0)]
    for k, x in enumerate((-_T, _W)):
        house.product("IfcWall", f"Gable {k}", [_prism(house, gable, x, x + _T)])
    _slab(house, "floor", -0.25, 0.25, "FLOOR")
    low = 1.0 - slope * _T
    south = [(-_T, low), (_D / 2, 3.5), (_D / 2, 3.75), (-_T, low + 0.25)]
    north = [(_D - y, z) for y, z in reversed(south)]
    roofs = [
        house.product(
            "IfcSlab", name, [_prism(house, section, -_T, _W + _T)], PredefinedType="ROOF"
        )
        for name, section in (("roof south", south), ("roof north", north))
    ]
    space = [(0.0, 0.0), (_D, 0.0), (_D, 1.0), (_D / 2, 3.5), (0.0, 1.0)]
    house.product("IfcSpace", "1", [_prism(house, space, 0.0, _W)], LongName="Attic room")
    return roofs[0]


def _skylight(house: IfcHouse, *, has_record: bool) -> None:
    """The attic with a window of 1 x 1 m in the southern slope; has_record: that it fills its hole."""
    roof = _attic(house)
    up, out = np.array([0.707, 0.707]), np.array([-0.707, 0.707])  # along and out of the slope
    middle = np.array([1.25, 2.25]) + 0.09 * out

    def across(thick: float, size: float = 1.0) -> Any:
        sides = ((-size, -thick), (size, -thick), (size, thick), (-size, thick))
        section = [tuple(middle + a / 2 * up + b / 2 * out) for a, b in sides]
        return _prism(house, section, 2.5, 3.5)

    hole = house.product("IfcOpeningElement", "hole", [across(1.0)])
    house.row("IfcRelVoidsElement", RelatingBuildingElement=roof, RelatedOpeningElement=hole)
    house.style("glass", (0.8, 0.9, 0.9), 0.8)
    pane = across(0.04)
    house.model.createIfcStyledItem(pane, [house.styles["glass"]], None)
    window = house.product("IfcWindow", "Roof window", [pane])
    if has_record:
        house.row("IfcRelFillsElement", RelatingOpeningElement=hole, RelatedBuildingElement=window)


def _ask_for_light_from_the_roof(path: Path) -> None:
    house, report = repaired(path)
    assert len([o for o in house.openings if o.is_window]) == 1, "one roof window"
    assert "windows" in house.rooms[0].lit_by, f"lit by {house.rooms[0].lit_by}"
    assert report.leaks is not None
    assert report.leaks.n_rays > 0, "the room counts as open"
    _ask_for_no_leak(report)


def _no_floor(house: IfcHouse) -> None:
    """Walls, a deck, a door and a window of bars and a plate without a record of its hole."""
    house.storey("s", 0.0)
    _four_walls(house, 0.0, 2.5)
    _slab(house, "deck", 2.5, 0.25, "ROOF")
    inner = house.wall("Inner", (3.0, _D), (3.0, 0.0), 0.0, 2.5)
    house.door(inner, 1.0)
    outer = house.model.by_type("IfcWall")[0]
    hole = house.product("IfcOpeningElement", "hole", [house.box_solid((1, -1, 0.9), (2, 1, 2.1))])
    house.row("IfcRelVoidsElement", RelatingBuildingElement=outer, RelatedOpeningElement=hole)
    bars = [
        ((1, 0.9), (2, 1.0)),
        ((1, 2.0), (2, 2.1)),
        ((1, 1.0), (1.1, 2.0)),
        ((1.9, 1.0), (2, 2.0)),
    ]
    parts = [
        house.product("IfcMember", "bar", [house.box_solid((a[0], -0.2, a[1]), (b[0], -0.1, b[1]))])
        for a, b in bars
    ]
    pane = house.box_solid((1.1, -0.16, 1.0), (1.9, -0.14, 2.0))
    parts.append(house.product("IfcPlate", "pane", [pane]))
    window = house.row("IfcWindow", Name="Window", ObjectPlacement=house.site_place)
    house.row("IfcRelAggregates", RelatingObject=window, RelatedObjects=parts)


def _ask_for_two_closed_rooms(path: Path) -> None:
    house, report = repaired(path)
    assert len(house.rooms) == 2
    assert all(str(r.enclosure) == "closed" for r in house.rooms)
    (window,) = (i for i in house.items if i.kind is ItemKind.WINDOW)
    assert [o.item_id for o in house.openings if o.is_window] == [window.id]
    _ask_for_no_leak(report)


def _no_records(house: IfcHouse) -> None:
    """A door in a gap of an inner wall and a window in a wall, neither with an opening element."""
    house.storey("s", 0.0)
    _slab(house, "floor", -0.25, 0.25, "FLOOR")
    _slab(house, "deck", 2.5, 0.25, "ROOF")
    _four_walls(house, 0.0, 2.5)
    for k, (low, high) in enumerate(((0.0, 2.0), (2.9, _D))):
        solid = house.box_solid((3, low, 0), (3.1, high, 2.5))
        house.product("IfcWall", f"Inner {k}", [solid])
    house.product("IfcDoor", "Door", [house.box_solid((3.02, 2, 0), (3.08, 2.9, 2.1))])
    house.product("IfcWindow", "Window", [house.box_solid((1, -0.2, 0.9), (2, -0.1, 2.1))])


def _tall_walls(house: IfcHouse) -> None:
    """Walls of two storeys with a window in each, neither with an opening element."""
    house.storey("ground", 0.0)
    _slab(house, "floor", -0.25, 0.25, "FLOOR")
    _four_walls(house, 0.0, 5.3)
    house.product("IfcWindow", "Lower", [house.box_solid((1, -0.2, 0.9), (2, -0.1, 2.1))])
    house.storey("first", 2.75)
    floor = house.box_solid((0, 0, 2.5), (_W, _D, 2.75))
    house.product("IfcSlab", "floor", [floor], PredefinedType="FLOOR")
    house.product("IfcWindow", "Upper", [house.box_solid((1, -0.2, 3.65), (2, -0.1, 4.85))])
    _slab(house, "deck", 5.3, 0.25, "ROOF")


def _ask_for_a_window_upstairs(path: Path) -> None:
    house, report = repaired(path)
    assert [len([o for o in house.openings if o.is_window]), len(house.rooms)] == [2, 2]
    assert all("windows" in r.lit_by for r in house.rooms)
    _ask_for_no_leak(report)


def _garage(house: IfcHouse, *, has_slab: bool) -> None:
    """A floor 8 cm below the foot of the walls, with a garage door down to that foot."""
    house.storey("s", 0.0)
    if has_slab:
        solid = house.box_solid((0, 0, -0.33), (_W, _D, -0.08))
        house.product("IfcSlab", "floor", [solid], PredefinedType="FLOOR")
    _slab(house, "deck", 2.8, 0.25, "ROOF")
    _four_walls(house, 0.0, 2.8)
    outer = house.model.by_type("IfcWall")[0]
    hole = house.product("IfcOpeningElement", "hole", [house.box_solid((1, -1, 0), (4, 1, 2.2))])
    house.row("IfcRelVoidsElement", RelatingBuildingElement=outer, RelatedOpeningElement=hole)
    door = house.product("IfcDoor", "Garage", [house.box_solid((1, -0.2, 0), (4, -0.1, 2.2))])
    house.row("IfcRelFillsElement", RelatingOpeningElement=hole, RelatedBuildingElement=door)
    _room(house, "Garage", -0.08, 2.88)


def _ask_for_a_closed_garage(path: Path) -> None:
    house, report = repaired(path)
    assert [str(r.enclosure) for r in house.rooms] == ["closed"]
    _ask_for_no_leak(report)


def _ask_for_a_sloped_ceiling(path: Path) -> None:
    house, report = repaired(path)
    _ask_for_no_leak(report)
    (attic,) = house.rooms
    flat = [
        s.positions
        for i in house.items
        if i.kind is ItemKind.CEILING
        for s in i.surfaces
        if np.ptp(s.positions[:, 1]) < 0.1 and np.ptp(s.positions[:, [0, 2]], axis=0).min() > 2
    ]
    assert not flat, f"a flat ceiling in {attic.name!r}"


def _low_ceiling(house: IfcHouse) -> None:
    """A space of 2.5 m under a deck, with a ceiling suspended at 2.2 m."""
    house.storey("s", 0.0)
    _four_walls(house, 0.0, 2.8)
    _slab(house, "floor", -0.25, 0.25, "FLOOR")
    _slab(house, "deck", 2.8, 0.25, "FLOOR")
    cover = house.box_solid((0, 0, 0), (_W, _D, 0.02))
    house.product("IfcCovering", "ceiling", [cover], (0, 0, 2.2), PredefinedType="CEILING")
    _room(house, "Bedroom", 0.0, 2.5)


def _ask_for_the_height_of_the_ceiling(path: Path) -> None:
    house, report = repaired(path)
    (bedroom,) = house.rooms
    height = bedroom.ceiling_y - bedroom.floor_y
    assert abs(height - 2.2) < 0.02, f"{height:.2f} m high"
    assert not report.structure.walls_lost
    _ask_for_no_leak(report)


def _two_storeys(house: IfcHouse) -> None:
    """A flat roof and an intermediate floor, named as exporters do, without a type."""
    house.storey("ground", 0.0)
    _slab(house, "Floor:Concrete", -0.25, 0.25, "FLOOR")
    _four_walls(house, 0.0, 2.5)
    house.storey("first", 2.75)
    _slab(house, "Floor:2 x 10", 2.5, 0.25, None)
    _four_walls(house, 2.75, 2.5)
    _slab(house, "Basic Roof:Flat", 5.25, 0.25, None)


def _ask_for_two_rooms(path: Path) -> None:
    house, _report = repaired(path)
    assert sorted(round(r.floor_y, 2) for r in house.rooms) == [0.0, 2.75]


_MIRROR: Final = (-1.0, 0.0, 0.0)
_WEDGE: Final = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.4)]


def _mapped(house: IfcHouse) -> None:
    """A wedge of one representation map four times: unchanged, turned, half as large, mirrored."""
    house.storey("s", 0.0)
    _four_walls(house, 0.0, 2.5)
    _slab(house, "floor", -0.25, 0.25, "FLOOR")
    _slab(house, "deck", 2.5, 0.25, "FLOOR")
    _room(house, "Bedroom", 0.0, 2.5)
    m = house.model
    shape = m.createIfcShapeRepresentation(
        house.context, "Body", "Tessellation", [_prism(house, _WEDGE, 0.0, 0.9)]
    )
    source = m.createIfcRepresentationMap(house.axes, shape)
    for k, (axis, scale) in enumerate(
        (((1.0, 0.0, 0.0), 1.0), ((0.0, 1.0, 0.0), 1.0), ((1.0, 0.0, 0.0), 0.5), (_MIRROR, 1.0))
    ):
        # A mirrored one keeps its y and z: the three axes are left-handed.
        y = (0.0, 1.0, 0.0) if axis[1] == 0 else (-1.0, 0.0, 0.0)
        way = [m.createIfcDirection(list(v)) for v in (axis, y, (0.0, 0.0, 1.0))]
        origin = m.createIfcCartesianPoint([0.0, 0.0, 0.0])
        operator = m.createIfcCartesianTransformationOperator3D(
            way[0], way[1], origin, scale, way[2]
        )
        mapped = m.createIfcMappedItem(source, operator)
        name = f"Table {k}"
        product = house.product("IfcFurniture", name, [mapped], (1.5 + k, 2.0, 0.0))
        product.Representation.Representations[0].RepresentationType = "MappedRepresentation"


def _ask_for_positive_volumes(path: Path) -> None:
    house = house_of(path)
    for k in range(4):
        wedge = named(house, f"Table {k}")
        corners = np.concatenate([s.positions[s.faces] for s in wedge.surfaces]).astype(np.float64)
        corners -= corners.mean((0, 1))
        volume = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)  # fmt: skip
        expected = 0.9 * 0.6 * 0.4 / 2 * (0.125 if k == 2 else 1.0)
        assert np.isclose(volume, expected, rtol=0.01), f"{wedge.name}: {volume:.4f} m3"


def _grass(folder: Path) -> Path:
    s = room()
    s.node("Grass", mesh=s.box([-6, -0.3, -6], [10, -0.13, 9], 0))
    path = folder / "room.glb"
    path.write_bytes(s.glb())
    return path


def _ask_for_ground(path: Path) -> None:
    house, _report = repaired(path)
    assert named(house, "Grass").kind is ItemKind.GROUND


def _json(path: Path, value: object) -> Path:
    path.write_text(json.dumps(value))
    return path
