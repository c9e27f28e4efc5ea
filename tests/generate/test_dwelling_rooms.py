"""Room types of Swiss Dwellings whose areas are all NOT_DEFINED in the table."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from pbrs_farm.generate.plans.plan_files import plan_from_file

Rect = tuple[float, float, float, float]  # x0, z0, x1, z1
COLUMNS = (
    "apartment_id", "floor_id", "entity_type", "entity_subtype", "geometry", "elevation", "height",
)  # fmt: skip
# Walls of 0.2 m; a corridor in the middle, rooms above and below it, a balcony in front of them.
AREAS: dict[str, Rect] = {
    "living": (0, 0, 6, 4), "bedroom 1": (6.2, 0, 9, 4), "bedroom 2": (9.2, 0, 11.2, 4),
    "corridor": (0, 4.2, 11.2, 5.6), "kitchen": (0, 5.8, 3, 9), "bath": (3.2, 5.8, 5.4, 9),
    "wc": (5.6, 5.8, 6.8, 9), "store": (7, 5.8, 8.4, 9), "bedroom 3": (8.6, 5.8, 11.2, 9),
    "balcony": (6.2, -2, 9, -0.2), "loggia": (0, -2, 4, -0.2),
}  # fmt: skip
TYPES = {
    "living": "living", "bedroom 1": "bedroom", "bedroom 2": "bedroom", "corridor": "hall",
    "kitchen": "kitchen", "bath": "bathroom", "wc": "bathroom", "store": "store",
    "bedroom 3": "bedroom", "balcony": "balcony", "loggia": "balcony",
}  # fmt: skip
FEATURES: dict[str, Rect] = {
    "KITCHEN": (0.1, 8.3, 2.9, 8.9), "BATHTUB": (3.3, 8.2, 5.0, 8.9), "TOILET": (6.0, 8.2, 6.4, 8.9),
}  # fmt: skip
# Bedroom 1 has only the balcony's door, bedrooms 2 and 3 (8 and 8.3 m2) a window.
DOORS: list[tuple[float, float]] = [
    (3, 4.1), (7.6, 4.1), (10.2, 4.1), (1.5, 5.7), (4.3, 5.7), (6.2, 5.7), (7.7, 5.7), (9.9, 5.7),
    (7.6, -0.1), (2, -0.1),
]  # fmt: skip
WINDOWS: list[tuple[float, float]] = [(5, -0.1), (10.2, -0.1), (10, 9.1), (1.5, 9.1)]
RAILINGS: list[Rect] = [
    (6.2, -2.1, 9, -2), (6.1, -2, 6.2, -0.2), (9, -2, 9.1, -0.2), (0, -2.1, 4, -2),
]  # fmt: skip


def wkt(box: Rect) -> str:
    x0, z0, x1, z1 = box
    ring = [(x0, -z0), (x1, -z0), (x1, -z1), (x0, -z1), (x0, -z0)]
    return "POLYGON ((" + ", ".join(f"{x} {y}" for x, y in ring) + "))"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """An apartment of eleven areas without a word for their use."""
    rows = [("area", "NOT_DEFINED", box) for box in AREAS.values()]
    rows += [("feature", word, box) for word, box in FEATURES.items()]
    rows += [("opening", "DOOR", (x - 0.4, z - 0.1, x + 0.4, z + 0.1)) for x, z in DOORS]
    rows += [("opening", "WINDOW", (x - 0.5, z - 0.1, x + 0.5, z + 0.1)) for x, z in WINDOWS]
    rows += [("opening", "ENTRANCE_DOOR", (11.2, 4.4, 11.4, 5.3))]
    rows += [("separator", "RAILING", box) for box in RAILINGS]
    path = tmp_path / "geometries.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(("a1", "7", kind, word, wkt(box), 404.0, 2.5) for kind, word, box in rows)
    return path


def test_unnamed_areas_are_typed_by_fixtures_railings_windows_and_doors(table: Path) -> None:
    plan = plan_from_file(table).plan
    types = {}
    for name, (x0, z0, x1, z1) in AREAS.items():
        # The plan's origin is the corner of all rooms, (0, -2) here.
        middle = (x0 + x1) / 2, (z0 + z1) / 2 + 2
        (room,) = (r for r in plan.rooms if r.contains(middle))
        types[name] = room.type.value
    assert types == TYPES


def test_a_railing_along_a_stairwell_makes_no_balcony_of_a_room(table: Path) -> None:
    rail = ("a1", "7", "separator", "RAILING", wkt((1, 3.9, 3, 4)), 404.0, 1.0)
    with table.open("a", newline="") as file:
        csv.writer(file).writerow(rail)
    living = next(r for r in plan_from_file(table).plan.rooms if r.contains((3, 4)))
    assert living.type.value == "living"
