"""One home in each format of floor plans: the same rooms, openings and furniture; faults are one line."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import OpeningKind, RoomType
from pbrs_farm.generate.plan_walls import corners
from pbrs_farm.generate.plans.closed_rings import closed_rings
from pbrs_farm.generate.plans.parsed_plan import footprint, footprints
from pbrs_farm.generate.plans.plan_files import PlanFile, plan_from_file, upright
from pbrs_farm.generate.plans.plan_format import Part, part_of
from pbrs_farm.generate.plans.room_types import type_by_words
from tests.inputs.plan_files import (
    HOLES,
    ROOMS,
    THINGS,
    WRITERS,
    traced,
    with_a_stub,
    write_blueprint3d,
    write_cubicasa,
    write_procthor,
    write_react_planner,
    write_room_plan,
    write_spatial_lm,
    write_swiss,
    write_zind,
)

formats = pytest.mark.parametrize("name", WRITERS)
fronts = pytest.mark.parametrize("name", ["spatiallm", "procthor", "roomplan", "react-planner"])


def read(name: str, folder: Path) -> PlanFile:
    return plan_from_file(WRITERS[name](folder))


@formats
def test_every_format_gives_the_same_rooms(tmp_path: Path, name: str) -> None:
    plan = read(name, tmp_path).plan
    assert len(plan.rooms) == len(ROOMS)
    for sample in ROOMS:
        x0, z0, x1, z1 = sample.box
        middle = Point((x0 + x1) / 2, (z0 + z1) / 2)
        near = [r for r in plan.rooms if Polygon(r.polygon).distance(middle) < 0.3]
        # ProcTHOR has four types of rooms, and no hall.
        expected = {sample.type} | ({"living"} if name == "procthor" else set())
        assert {r.type.value for r in near} <= expected
        assert near[0].area == pytest.approx((x1 - x0) * (z1 - z0), rel=0.18)


@formats
def test_every_opening_keeps_its_place(tmp_path: Path, name: str) -> None:
    plan = read(name, tmp_path).plan
    assert len(plan.openings) == len(HOLES)
    shift = (
        min(x for r in plan.rooms for x, _ in r.polygon),
        min(z for r in plan.rooms for _, z in r.polygon),
    )
    for hole in HOLES:
        middle = np.array(hole.at) + shift
        near = min(plan.openings, key=lambda o: math.dist(plan.walls[o.wall].at(o.along), middle))
        assert math.dist(plan.walls[near.wall].at(near.along), middle) < 0.3
        assert near.width == pytest.approx(hole.width, abs=0.02)
        assert (near.kind is OpeningKind.WINDOW) == (hole.kind == "window")
        assert (near.other is None) == (len(hole.rooms) == 1)


@fronts
def test_furniture_has_the_place_and_direction_of_the_file(tmp_path: Path, name: str) -> None:
    things = read(name, tmp_path).storeys[0].things
    for thing in things:
        sample = min(THINGS, key=lambda t: math.dist(t.at, (thing.x, thing.z)))
        assert math.dist(sample.at, (thing.x, thing.z)) < 0.15
        np.testing.assert_allclose((thing.width, thing.depth, thing.height), sample.size, atol=1e-6)
        front = math.sin(thing.turn_rad), math.cos(thing.turn_rad)
        np.testing.assert_allclose(front, sample.front, atol=1e-3)
        assert thing.low == pytest.approx(0.0, abs=0.02)
    assert len(things) >= 7


def test_a_left_handed_house_is_mirrored_once(tmp_path: Path) -> None:
    """A bathtub to the lower right of the page is there, and faces up the page."""
    (tub,) = (t for t in read("procthor", tmp_path).storeys[0].things if t.name == "Bathtub")
    assert (tub.x, tub.z) == pytest.approx((7.4, 8.55))
    assert (math.sin(tub.turn_rad), math.cos(tub.turn_rad)) == pytest.approx((0, -1), abs=1e-6)


def test_slivers_are_noted_and_undefined_areas_are_typed_by_fixtures(tmp_path: Path) -> None:
    file = read("swiss", tmp_path)
    types = [r.type for r in file.plan.rooms]
    assert types == [
        RoomType.LIVING, RoomType.KITCHEN, RoomType.HALL, RoomType.BEDROOM, RoomType.BATHROOM,
    ]  # fmt: skip
    assert file.left_out == ("an area below 0.5 m2 is a sliver",)
    assert {t.name for t in file.storeys[0].things} == {
        "KITCHEN", "SINK", "TOILET", "BATHTUB", "BUILT_IN_FURNITURE",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "bedroom", "office"),
    [
        ("swiss", "area,ROOM", "area,OFFICE"),
        ("cubicasa", "Space Bedroom", "Space Office"),
        ("zind", '"label": "bedroom"', '"label": "office"'),
    ],
)
def test_an_office_of_a_plan_is_no_bedroom(
    tmp_path: Path, name: str, bedroom: str, office: str
) -> None:
    path = WRITERS[name](tmp_path)
    assert bedroom in path.read_text()
    path.write_text(path.read_text().replace(bedroom, office))
    types = [room.type for room in plan_from_file(path).plan.rooms]
    assert types.count(RoomType.OFFICE) == 1
    assert RoomType.BEDROOM not in types


def test_a_studio_has_a_bed() -> None:
    assert [type_by_words(name) for name in ("Studio", "Study", "Büro")] == [
        "bedroom",
        "office",
        "office",
    ]


def test_a_column_stays_and_a_railing_inside_is_a_parapet(tmp_path: Path) -> None:
    path = write_swiss(tmp_path)
    railing = '"POLYGON ((101 48, 103 48, 103 47.9, 101 47.9, 101 48))"'
    path.write_text(path.read_text() + f",7,separator,RAILING,{railing},404,1\n")
    extra = plan_from_file(path).plan.walls[-2:]
    assert [w.height for w in extra] == [None, 1.0]
    assert [round(w.thickness, 2) for w in extra] == [0.3, 0.1]


def test_storeys_of_a_file_are_kept_and_one_can_be_selected(tmp_path: Path) -> None:
    path = write_zind(tmp_path, n_floors=2)
    assert len(plan_from_file(path).storeys) == 2
    assert plan_from_file(path, Part(floor=1)).storeys[0].name == "floor_02"
    with pytest.raises(BadInput, match="has 2 storeys, no floor 2"):
        plan_from_file(path, Part(floor=2))


def test_a_scan_of_two_stories_has_two_storeys(tmp_path: Path) -> None:
    path = write_room_plan(tmp_path)
    value = json.loads(path.read_text())
    for key in ("walls", "doors", "windows", "objects", "sections"):
        upper = [json.loads(json.dumps(row)) | {"story": 1} for row in value[key]]
        for row in upper:
            if "transform" in row:
                row["transform"][13] += 2.9
        value[key] += upper
    path.write_text(json.dumps(value))
    lower, upper_storey = plan_from_file(path).storeys
    assert len(lower.things) == len(upper_storey.things) == len(THINGS)
    assert max(t.low for t in upper_storey.things) < 0.1


def test_older_scans_with_text_and_rows_give_the_same_plan(tmp_path: Path) -> None:
    path = write_room_plan(tmp_path)
    before = plan_from_file(path)
    value = json.loads(path.read_text())
    for key in ("walls", "doors", "windows", "objects"):
        for row in value[key]:
            row["category"] = next(iter(row["category"]))
            row["transform"] = np.reshape(row["transform"], (4, 4)).T.tolist()
    path.write_text(json.dumps(value))
    assert plan_from_file(path) == before


def test_a_layout_of_a_machine_loses_a_stray_door_and_keeps_the_rest(tmp_path: Path) -> None:
    path = write_spatial_lm(tmp_path)
    path.write_text(path.read_text() + "door_9=Door(wall_0,2.5,-2.0,5.9,0.9,2.05)\n")
    file = plan_from_file(path)
    assert len(file.plan.openings) == len(HOLES)
    assert file.left_out == ("door 6: an opening is 2.0 m from the nearest wall",)


def test_an_open_wall_gives_the_place_of_its_gap(tmp_path: Path) -> None:
    lines = [((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (4.0, 3.0)), ((4.0, 3.0), (1.7, 3.0)),
             ((0.0, 3.0), (0.0, 0.0))]  # fmt: skip
    with pytest.raises(
        BadInput, match=r"close no room: the widest gap, 1\.70 m, is at \((0|1)\.\d0"
    ):
        closed_rings(tmp_path / "x.txt", lines)


def test_a_room_under_other_rooms_keeps_its_uncovered_part(tmp_path: Path) -> None:
    path = write_zind(tmp_path)
    value = json.loads(path.read_text())
    rooms = value["redraw"]["floor_01"]
    rooms["room_00"]["vertices"][1][0] += 0.12 / 2.5
    file = plan_from_file(_written(path, value))
    assert len(file.plan.rooms) == len(ROOMS)
    # A room inside another is dropped.
    inner = {"vertices": [[0.4, -0.4], [0.8, -0.4], [0.8, -0.8], [0.4, -0.8]]}
    rooms["room_99"] = inner
    file = plan_from_file(_written(path, value))
    assert len(file.plan.rooms) == len(ROOMS)
    assert any("inside another" in line for line in file.left_out)


def test_a_traced_home_has_its_openings_by_their_outlines_and_its_scale_is_an_area(
    tmp_path: Path,
) -> None:
    path = write_react_planner(tmp_path)
    drawn = plan_from_file(path).plan
    file = plan_from_file(_written(path, traced(json.loads(path.read_text()), 1.18)))
    assert file.left_out == ()
    for room, drawn_room in zip(file.plan.rooms, drawn.rooms, strict=True):
        assert (room.type, room.name) == (drawn_room.type, drawn_room.name)
        np.testing.assert_allclose(room.polygon, drawn_room.polygon, atol=1e-3)
    for hole, drawn_hole in zip(file.plan.openings, drawn.openings, strict=True):
        assert (hole.kind, hole.wall) == (drawn_hole.kind, drawn_hole.wall)
        sizes = (drawn_hole.along, drawn_hole.width, drawn_hole.sill)
        assert (hole.along, hole.width, hole.sill) == pytest.approx(sizes, abs=1e-3)


@pytest.mark.parametrize("unit_m", [1.0, 0.01])
def test_outlines_of_areas_in_another_unit_than_the_vertices_are_as_large_as_the_lines(
    tmp_path: Path, unit_m: float
) -> None:
    path = write_react_planner(tmp_path)
    drawn = plan_from_file(path).plan
    value = traced(json.loads(path.read_text()), 1.18)
    for area in value["layers"]["layer-1"]["areas"].values():
        (ring,) = area["coords"]
        area["coords"] = [[[x / 118 / unit_m, y / 118 / unit_m] for x, y in ring]]
    rooms = plan_from_file(_written(path, value)).plan.rooms
    for room, drawn_room in zip(rooms, drawn.rooms, strict=True):
        assert (room.type, room.name) == (drawn_room.type, drawn_room.name)
        np.testing.assert_allclose(room.polygon, drawn_room.polygon, atol=1e-3)


def test_areas_without_an_inside_leave_the_rooms_to_the_lines(tmp_path: Path) -> None:
    path = write_react_planner(tmp_path)
    value = json.loads(path.read_text())
    for area in value["layers"]["layer-1"]["areas"].values():
        area.pop("vertices")
        area["coords"] = [[0, 0], [0, 0], [0, 0]]
    plan = plan_from_file(_written(path, value)).plan
    assert len(plan.rooms) == len(ROOMS)


def test_corners_of_blueprint3d_are_in_centimetres_or_metres(tmp_path: Path) -> None:
    sizes = []
    for name, per_metre in (("old", 100.0), ("new", 1.0)):
        (tmp_path / name).mkdir()
        path = write_blueprint3d(tmp_path / name, per_metre=per_metre)
        found = plan_from_file(path)
        sizes.append(sorted(round(room.area, 2) for room in found.plan.rooms))
        (bed,) = found.storeys[0].things
        assert (bed.x, bed.z, bed.low) == pytest.approx((1.2, 1.3, 0.0), abs=0.01)
        assert math.sin(bed.turn_rad) == pytest.approx(-1)
    assert sizes[0] == sizes[1]


def test_a_hole_without_a_place_is_a_guess_and_a_note(tmp_path: Path) -> None:
    path = write_react_planner(tmp_path)
    value = json.loads(path.read_text())
    holes = value["layers"]["layer-1"]["holes"]
    del holes["h0"]["offset"]
    (line,) = plan_from_file(_written(path, value)).left_out
    assert line.startswith("layers.layer-1.holes.h0: a hole has no place")


def test_a_stub_of_wall_has_its_drawn_thickness(tmp_path: Path) -> None:
    path = write_zind(tmp_path)
    value, ring = with_a_stub(json.loads(path.read_text()))
    plan = plan_from_file(_written(path, value)).plan
    (room,) = plan.rooms
    assert Polygon(room.polygon).symmetric_difference(Polygon(ring)).area < 1e-3
    (stub,) = [w for w in plan.walls if not w.is_outer]
    assert (stub.thickness, stub.length) == pytest.approx((0.11, 1.2))
    # No wall is oblique: all are level or upright.
    assert all(
        min(abs(a - b) for a, b in zip(w.start, w.end, strict=True)) < 1e-6 for w in plan.walls
    )


def test_a_corner_drawn_twice_stays() -> None:
    square = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (2.0, 1.00002), (0.0, 1.0)]
    assert set(corners(Polygon(square))) == {(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)}


def test_an_l_of_cabinets_is_two_boxes() -> None:
    shape = Polygon([(0, 0), (3, 0), (3, 0.6), (0.6, 0.6), (0.6, 2), (0, 2)])
    boxes = footprints(shape)
    assert sum(b.width * b.depth for b in boxes) == pytest.approx(shape.area, rel=0.02)
    assert len(boxes) == 2


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.3, -0.7])
def test_a_footprint_turns_as_its_shape_does(turn: float) -> None:
    right = np.array([math.cos(turn), -math.sin(turn)])
    down = np.array([right[1], -right[0]])
    ring = [a * right + b * down for a, b in ((-2, -0.5), (2, -0.5), (2, 0.5), (-2, 0.5))]
    box = footprint(Polygon(ring))
    assert (box.width, box.depth) == pytest.approx((4, 1))
    assert abs(math.cos(box.turn_rad - turn)) == pytest.approx(1)


@fronts
def test_turning_a_home_upright_turns_its_furniture(tmp_path: Path, name: str) -> None:
    file = read(name, tmp_path)
    turned = upright(file)
    for before, after in zip(file.storeys[0].things, turned.storeys[0].things, strict=True):
        assert (before.x, before.z) == pytest.approx((after.x, after.z), abs=0.1)


def test_parts_of_files_are_named_behind_a_hash() -> None:
    assert part_of("apartment=a1,floor=2") == Part("a1", 2)
    assert Part("a1", 2).word == "apartment=a1,floor=2"
    with pytest.raises(BadInput, match="names no part"):
        part_of("room=3")


# Faults.


def _written(path: Path, value: Any) -> Path:
    path.write_text(value if isinstance(value, str) else json.dumps(value))
    return path


def _without(path: Path, key: str) -> Path:
    value = json.loads(path.read_text())
    del value[key]
    return _written(path, value)


def _circle(n: int, radius: float = 3.0) -> list[list[float]]:
    return [
        [radius * math.cos(2 * math.pi * k / n), radius * math.sin(2 * math.pi * k / n)] for k in range(n)
    ]  # fmt: skip


def _own(*rings: list[list[float]]) -> dict[str, Any]:
    return {"rooms": [{"type": "living", "polygon": ring} for ring in rings]}


def _square(side: float) -> list[list[float]]:
    return [[0, 0], [side, 0], [side, side], [0, side]]


NESTED = "GEOMETRYCOLLECTION (" * 30_000
CSV_HEAD = "apartment_id,floor_id,entity_type,entity_subtype,geometry\n"
FAULTS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "centimetres": (lambda d: _written(d / "p.json", _own(_square(450))), "looks like centimetres"),
    "millimetres": (lambda d: _written(d / "p.json", _own(_square(4500))), "looks like millimetres"),
    "a room of 3 cm": (lambda d: _written(d / "p.json", _own(_square(0.03))), "looks like"),
    "a room of 3 km": (lambda d: _written(d / "p.json", _own(_square(3000))), "over 200 m wide: looks"),
    "100,000 corners": (lambda d: _written(d / "p.json", _own(_circle(100_000))), "20000 values at most"),
    "nested WKT": (lambda d: _written(d / "p.csv", f'{CSV_HEAD}a,1,area,ROOM,"{NESTED}"\n'), "line 2: .*not a WKT poly"),
    "truncated layout": (lambda d: _written(d / "p.txt", "wall_0=Wall(0,0,0,1,0"), "line 1: is not a wall"),
    "NaN in a layout": (lambda d: _written(d / "p.txt", "wall_0=Wall(0,0,0,nan,0,0,2.6,0)"), "line 1: .*not a length"),
    "1e30 in a layout": (lambda d: _written(d / "p.txt", "wall_0=Wall(0,0,0,1e30,0,0,2.6,0)"), "not a length"),
    "one wall": (lambda d: _written(d / "p.txt", "wall_0=Wall(0,0,0,4,0,0,2.6,0)"), "close no room"),
    "an entity": (
        lambda d: _written(d / "p.svg", '<!DOCTYPE s [<!ENTITY a "b">]><svg>&a;</svg>'), "is not valid SVG"),
    "half an SVG": (lambda d: _written(d / "p.svg", write_cubicasa(d).read_text()[:900]), "is not valid SVG"),
    "another SVG": (lambda d: _written(d / "p.svg", "<svg><g/></svg>"), "no group of the class Space"),
    "no scale": (lambda d: _without(write_zind(d), "scale_meters_per_coordinate"), "expected metres a unit"),
    "no lines": (lambda d: _written(d / "p.json", {"unit": "cm", "layers": {"a": {}}}), "no layer with lines"),
    "a unit": (lambda d: _written(d / "p.json", {"unit": "parsec", "layers": {"a": {}}}), "no such unit"),
    "a wall without a pose": (
        lambda d: _written(d / "p.json", {"walls": [{"dimensions": [1, 2], "transform": [1] * 15}], "objects": []}),
        "wall 1, transform: expected 16"),
    "no walls": (lambda d: _written(d / "p.json", {"walls": [], "objects": []}), "has no wall"),
    "rooms of points": (
        lambda d: _written(d / "p.json", {"rooms": [{"floorPolygon": [{}]}], "walls": [], "doors": [], "objects": []}),
        r"rooms\[0\].floorPolygon: expected 3"),
    "an empty table": (lambda d: _written(d / "p.csv", ""), "has no column"),
    "a million entities": (
        lambda d: _written(d / "p.txt", "wall_0=Wall(0,0,0,4,0,0,2.6,0)\n" * 1_000_000), "1000000 lines, at most"),
}  # fmt: skip


def _crossing(folder: Path) -> Path:
    lines = [f"wall_{k}=Wall({k / 5},0,0,{60 - k / 5},50,0,2.6,0)" for k in range(300)]
    lines += [f"wall_{k}x=Wall(0,{k / 5},0,60,{50 - k / 5},0,2.6,0)" for k in range(250)]
    return _written(folder / "p.txt", "\n".join(lines))


def _many_rooms(folder: Path) -> Path:
    path = write_zind(folder)
    value = json.loads(path.read_text())
    room = value["redraw"]["floor_01"]["room_00"]
    value["redraw"]["floor_01"] = {f"r{k}": room for k in range(2000)}
    return _written(path, value)


FAULTS["walls that cross"] = _crossing, r"cross \d+ times: no plan"
FAULTS["two thousand rooms"] = _many_rooms, "has 2000 rooms, at most 60"
FAULTS["deep groups"] = (
    lambda d: _written(d / "p.svg", "<svg>" + "<g>" * 30_000 + "</g>" * 30_000 + "</svg>"),
    "no group of the class Space",
)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_file_that_is_no_plan_is_refused_quickly(tmp_path: Path, fault: str) -> None:
    write, message = FAULTS[fault]
    path = write(tmp_path)
    started = time.monotonic()
    with pytest.raises(BadInput, match=message) as caught:
        plan_from_file(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 700
    assert time.monotonic() - started < 20


def test_a_round_room_of_a_hundred_corners_has_straight_walls(tmp_path: Path) -> None:
    plan = plan_from_file(_written(tmp_path / "p.json", _own(_circle(400)))).plan
    assert len(plan.walls) <= 120
    assert plan.rooms[0].area == pytest.approx(math.pi * 9, rel=0.01)


@pytest.mark.parametrize(
    "write", [write_procthor, write_room_plan, write_zind, write_react_planner]
)
def test_json_that_ends_early_names_the_place(
    tmp_path: Path, write: Callable[[Path], Path]
) -> None:
    path = write(tmp_path)
    path.write_text(path.read_text()[:-40])
    with pytest.raises(BadInput, match="line 1 column"):
        plan_from_file(path)


def test_a_plan_without_a_scale_keeps_its_drawn_size(tmp_path: Path) -> None:
    path = write_react_planner(tmp_path)
    drawn = plan_from_file(path).plan
    value = json.loads(path.read_text()) | {"scale": None}
    rooms = plan_from_file(_written(path, value)).plan.rooms
    assert [room.polygon for room in rooms] == [room.polygon for room in drawn.rooms]
