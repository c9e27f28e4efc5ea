"""Rows of a table of dwellings: an apartment becomes a plan through the reader of own plans."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import OpeningKind, RoomType
from pbrs_farm.generate.plans.plan_files import PlanFile, plan_from_file
from pbrs_farm.generate.plans.plan_format import Part
from pbrs_farm.prepare.plan_house import furnish_plan_file
from pbrs_farm.read.sweethome3d.home import read_home

COLUMNS = (
    "apartment_id", "floor_id", "entity_type", "entity_subtype", "geometry", "elevation", "height",
)  # fmt: skip


def rect(x: float, y: float, w: float, d: float) -> str:
    ring = [(x, y), (x + w, y), (x + w, y + d), (x, y + d), (x, y)]
    return f"POLYGON (({', '.join(f'{a} {b}' for a, b in ring)}))"


def area(kind: str, wkt: str, apartment: str = "a1", floor: str = "7") -> tuple[Any, ...]:
    return apartment, floor, "area", kind, wkt, 404.0, 2.6


# North of a corridor a large and a small room, with a bathroom beside them; walls of 0.2 m.
ROWS: list[tuple[Any, ...]] = [
    area("ROOM", rect(10, 21.7, 5, 4)),
    area("ROOM", rect(15.2, 21.7, 3, 4)),
    area("CORRIDOR", rect(10, 20, 5.8, 1.5)),
    area("BATHROOM", rect(16, 20, 2.2, 1.5)),
    area("SHAFT", rect(18.3, 20, 0.4, 1.5)),
    area("ROOM", rect(40, 20, 4, 4), apartment="a2"),
    ("", "7", "separator", "WALL", rect(10, 21.5, 8, 0.2), 404.0, 2.6),
    ("", "7", "opening", "ENTRANCE_DOOR", rect(9.8, 20.3, 0.2, 0.9), 404.0, 2.0),
    ("", "7", "opening", "DOOR", rect(12, 21.5, 0.8, 0.2), 404.0, 2.0),
    ("", "7", "opening", "WINDOW", rect(12, 25.7, 1.6, 0.3), 404.9, 1.4),
    ("", "7", "opening", "WINDOW", rect(41, 24, 1.6, 0.3), 404.9, 1.4),
    ("", "8", "opening", "WINDOW", rect(12, 25.7, 1.6, 0.3), 407.6, 1.4),
]


def written(folder: Path, rows: list[tuple[Any, ...]], columns: tuple[str, ...] = COLUMNS) -> Path:
    path = folder / "geometries.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    return path


def plan(
    folder: Path, rows: list[tuple[Any, ...]] | None = None, apartment: str = "a1"
) -> PlanFile:
    return plan_from_file(written(folder, ROWS if rows is None else rows), apartment)


def test_an_apartments_areas_are_rooms_and_its_largest_plain_room_is_to_live_in(
    tmp_path: Path,
) -> None:
    drawn = plan(tmp_path)
    types = [room.type for room in drawn.plan.rooms]
    assert types == [RoomType.LIVING, RoomType.BEDROOM, RoomType.HALL, RoomType.BATHROOM]
    assert drawn.plan.rooms[0].area == pytest.approx(20, abs=0.05)
    assert drawn.plan.height == 2.6
    assert drawn.left_out == ()


def test_north_is_up_on_the_page_and_only_the_apartments_openings_count(tmp_path: Path) -> None:
    entrance, door, window = plan(tmp_path).plan.openings
    assert (entrance.kind, entrance.other) == (OpeningKind.ENTRANCE, None)
    assert {door.room, door.other} == {0, 2}
    wall = plan(tmp_path).plan.walls[window.wall]
    assert wall.at(window.along)[1] < 0.0
    assert (window.sill, window.height, window.width) == pytest.approx((0.9, 1.4, 1.6))


def test_an_opening_that_fits_no_wall_is_dropped_with_a_note(tmp_path: Path) -> None:
    wide = ("", "7", "opening", "WINDOW", rect(10.2, 25.7, 7.9, 0.3), 404.9, 1.4)
    drawn = plan(tmp_path, [*ROWS, wide])
    assert len(drawn.plan.openings) == 3
    assert "wider than its wall" in drawn.left_out[0]


def test_the_home_of_an_apartment_reads_as_a_house(tmp_path: Path) -> None:
    house = read_home(furnish_plan_file(plan(tmp_path), EMPTY, seed=1).data, "a1.sh3d")
    assert [len(house.rooms), len(house.openings)] == [4, 3]


@pytest.mark.parametrize(
    ("rows", "apartment", "message"),
    [
        (ROWS, "", r"has 2 apartments: a1, a2.*--apartment a1"),
        (ROWS, "b9", r"has no apartment 'b9'"),
        ([], "", "has no row of the type area"),
        ([area("ROOM", "POLYGON ((0 0, 1")], "a1", "line 2: its geometry is not a WKT polygon"),
        ([area("SHAFT", rect(0, 0, 1, 1))], "a1", "without rooms"),
    ],
)
def test_a_table_without_the_apartment_is_refused(
    tmp_path: Path, rows: list[tuple[Any, ...]], apartment: str, message: str
) -> None:
    with pytest.raises(BadInput, match=message) as caught:
        plan(tmp_path, rows, apartment)
    assert "\n" not in str(caught.value)


def test_a_table_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="has no column entity_type"):
        plan_from_file(written(tmp_path, [(1, 2)], ("price", "rent")))


def test_an_apartment_is_valid_only_for_a_table(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("{}")
    with pytest.raises(BadInput, match=r"names a row of a \.csv"):
        plan_from_file(path, "a1")


def test_the_floors_of_an_apartment_are_storeys(tmp_path: Path) -> None:
    upper = ("a1", "8", "area", "ROOM", rect(10, 21, 5, 4), 407.0, 2.4)
    drawn = plan(tmp_path, [upper, *ROWS])
    assert [s.plan.height for s in drawn.storeys] == [2.6, 2.4]
    path = tmp_path / "geometries.csv"
    assert len(plan_from_file(path, Part("a1", 1)).storeys) == 1
    with pytest.raises(BadInput, match="has 2 storeys, no floor 2"):
        plan_from_file(path, Part("a1", 2))
