"""Read an apartment from a table of dwellings with WKT polygons as a ParsedPlan. Effects: reads the file.

The columns are those of geometries.csv of Swiss Dwellings (Archilyse, doi 10.5281/zenodo.7788422):
entity_type (area, separator, opening, feature), entity_subtype, geometry (WKT in metres, +y north; geom
in Modified Swiss Dwellings), apartment_id, floor_id, and optionally elevation and height.
Walls follow from the areas; railings become parapets, columns are kept, features are items with only a box.
"""

from __future__ import annotations

import csv
import io
import math
import re
import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.ops import unary_union

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plan_walls import PARAPET_HEIGHT_M
from pbrs_farm.generate.plans.parsed_plan import (
    LeftOut,
    ParsedPlan,
    ParsedStorey,
    Thing,
    footprint,
    footprints,
    opening,
    value_of,
)
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms
from pbrs_farm.regular_files import MAX_DIGEST_BYTES, fault_of, open_regular

_NEEDED: Final = ("entity_type", "entity_subtype", "geometry", "apartment_id", "floor_id")
_MORE: Final = ("elevation", "height")
_OPENINGS: Final = {"DOOR": "door", "ENTRANCE_DOOR": "entrance", "WINDOW": "window"}
# fmt: off
_DRAWN: Final = {
    "opening": tuple(_OPENINGS), "separator": ("RAILING", "COLUMN"),
    "feature": (
        "KITCHEN", "SINK", "TOILET", "BATHTUB", "SHOWER", "WASHING_MACHINE", "BUILT_IN_FURNITURE",
        "STAIRS",
    ),
}
# fmt: on
_NO_ID: Final = ("", "nan", "None")
_NEAR_M: Final = 0.6  # from an apartment's rooms to its openings
_BESIDE_M: Final = 0.1  # from them to its fixtures
_LONGEST_FIELD: Final = 2**22  # characters of one WKT
_MOST_ROWS: Final = 20_000  # of a floor
_NAMED: Final = 3  # apartments that a message names
_IS_POLYGON: Final = re.compile(r"\s*(SRID=\d+;)?\s*(MULTI)?POLYGON[ ZM]*[ (]", re.IGNORECASE)
_MOST_NESTED: Final = 3  # brackets of a multipolygon
_FRENCH_M: Final = 0.3  # a window that begins below is a door of glass
# Default heights of fixtures; 1 m for others.
_HEIGHTS: Final = {
    "KITCHEN": 0.9,
    "SINK": 0.85,
    "TOILET": 0.8,
    "BATHTUB": 0.6,
    "SHOWER": 2.0,
    "WASHING_MACHINE": 0.85,
    "BUILT_IN_FURNITURE": 2.2,
}


@dataclass(frozen=True, slots=True)
class _Row:
    kind: str
    subtype: str
    shape: Polygon  # x right, z down
    elevation: float | None
    height: float | None


def plan_of_rows(path: Path, apartment: str = "") -> ParsedPlan:
    """Read one apartment, one storey per floor; BadInput for another table, and to name an apartment."""
    floors = _floors(path)
    if not floors:
        raise BadInput(path, "", "has no row of the type area with an apartment_id")
    if not apartment and len(floors) == 1:
        (apartment,) = floors
    if apartment not in floors:
        some = ", ".join(list(floors)[:_NAMED]) + (", ..." if len(floors) > _NAMED else "")
        text = f"has no apartment {apartment!r}" if apartment else f"has {len(floors)} apartments"
        first = next(iter(floors))
        raise BadInput(
            path,
            "apartment_id",
            f"{text}: {some}",
            hint=f"--apartment {first}, or the word {path.name}#apartment={first} of run",
        )
    left_out = LeftOut()
    rows = _of_apartment(path, floors[apartment])
    storeys = []
    for floor in sorted(rows, key=lambda f: (_elevation(rows[f]), f)):
        areas = [r for r in rows[floor] if r.kind == "area:own"]
        if areas:
            storeys.append(_storey_of_rows(path, areas, rows[floor], left_out))
    return ParsedPlan(tuple(storeys), left_out.lines())


def _elevation(rows: list[_Row]) -> float:
    elevations = [r.elevation for r in rows if r.kind == "area:own" and r.elevation is not None]
    return statistics.median(elevations) if elevations else 0.0


def _read_rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """(line, row) of the table, reduced to the required columns."""
    csv.field_size_limit(_LONGEST_FIELD)
    try:
        with open_regular(path, MAX_DIGEST_BYTES) as file:
            reader = csv.reader(io.TextIOWrapper(file, "utf-8-sig"))
            names = ["geometry" if n == "geom" else n for n in next(reader, [])]
            missing = [c for c in _NEEDED if c not in names]
            if missing:
                text = f"has no column {missing[0]}"
                raise BadInput(path, "", text, hint=f"columns {', '.join(_NEEDED)}")
            # Tables have millions of rows: extract only the required columns.
            places = [(c, names.index(c)) for c in (*_NEEDED, *_MORE) if c in names]
            least = max(place for _, place in places)
            for row in reader:
                if len(row) > least:
                    yield reader.line_num, {c: row[place] for c, place in places}
    except OSError as error:
        raise BadInput(path, "", fault_of(error)) from None
    except (csv.Error, UnicodeDecodeError) as error:
        raise BadInput(path, "", f"is not a text table: {error}") from None


def _floors(path: Path) -> dict[str, dict[str, str]]:
    """Apartment -> the floors that its areas lie on (and its own id), in the table's order."""
    floors: dict[str, dict[str, str]] = {}
    for _line, row in _read_rows(path):
        if row["entity_type"] == "area" and row["apartment_id"] not in _NO_ID:
            apartment = row["apartment_id"]
            floors.setdefault(apartment, {})[row["floor_id"]] = apartment
    return floors


def _of_apartment(path: Path, floors: dict[str, str]) -> dict[str, list[_Row]]:
    """By floor, an apartment's areas and whatever else is drawn on that floor."""
    rows_of_floor: dict[str, list[_Row]] = {floor: [] for floor in floors}
    for line, row in _read_rows(path):
        floor, kind = row["floor_id"], row["entity_type"]
        if floor not in floors:
            continue
        if kind == "area":
            if row["apartment_id"] != floors[floor]:
                continue
            kind = "area:own"
        elif row["entity_subtype"].upper() not in _DRAWN.get(kind, ()):
            continue
        rows_of_floor[floor].append(_parse_row(path, line, row, kind))
        if len(rows_of_floor[floor]) > _MOST_ROWS:
            raise BadInput(path, f"floor {floor}", f"has over {_MOST_ROWS} rows")
    return rows_of_floor


def _parse_row(path: Path, line: int, row: dict[str, str], kind: str) -> _Row:
    text, shape = row["geometry"], None
    # Ask for the form first: the parser of WKT follows nesting without an end.
    if _IS_POLYGON.match(text) and _bracket_depth(text) <= _MOST_NESTED:
        try:
            # A NaN or a number beyond all floats is refused below, without the library's own words.
            with np.errstate(all="ignore"):
                shape = shapely.from_wkt(text.partition(";")[2] if text[:5] == "SRID=" else text)
        except shapely.errors.ShapelyError:
            shape = None
    if shape is not None and not np.isfinite(shapely.get_coordinates(shape)).all():
        raise BadInput(path, f"line {line}", "has a coordinate that is not in metres")
    if isinstance(shape, MultiPolygon):
        shape = max(shape.geoms, key=lambda part: part.area, default=None)
    if not isinstance(shape, Polygon) or shape.is_empty:
        raise BadInput(path, f"line {line}", "its geometry is not a WKT polygon")
    # North is up: the plan's second coordinate runs downwards.
    ring = shapely.get_coordinates(shape.exterior) * [1, -1]
    if not all(map(math.isfinite, (*shape.bounds,))) or abs(ring).max() > 1e9:
        raise BadInput(path, f"line {line}", "has a coordinate that is not in metres")
    elevation, height = (_parse_number(row.get(key)) for key in ("elevation", "height"))
    return _Row(kind, row["entity_subtype"].upper(), Polygon(ring), elevation, height)


def _bracket_depth(text: str) -> int:
    """How deep the brackets of the text's beginning are nested."""
    head = text[:200]
    return (
        len(head) - len(head.replace("(", ""))
        if ")" not in head
        else max(head[:k].count("(") - head[:k].count(")") for k in range(1, len(head) + 1))
    )


def _parse_number(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _storey_of_rows(
    path: Path, areas: list[_Row], rows: list[_Row], left_out: LeftOut
) -> ParsedStorey:
    grounds = [shapely.make_valid(a.shape) for a in areas]
    ground = unary_union(grounds)
    near = [
        r
        for r in rows
        if r.kind != "area:own"
        and ground.distance(r.shape)
        < (_NEAR_M if r.kind == "opening" else _BESIDE_M + _NEAR_M * (r.kind == "separator"))
    ]
    height = statistics.median(
        [a.height for a in areas if a.height and 2 <= a.height <= 6] or [2.5]
    )
    floor = min((a.elevation for a in areas if a.elevation is not None), default=None)
    openings = [_opening_of_row(r, height, floor) for r in near if r.kind == "opening"]
    things = [
        t
        for r in near
        if r.kind == "feature"
        for t in _things_of_row(r, height, floor, left_out)
        if ground.distance(shapely.Point(t.x, t.z)) < _BESIDE_M
    ]
    railings = [r.shape for r in near if r.subtype == "RAILING"]
    drawn = [DrawnArea(a.shape, a.subtype, is_plain=a.subtype == "ROOM") for a in areas]
    rooms = typed_rooms("swiss", drawn, things, openings, left_out, railings)
    if not rooms:
        raise BadInput(path, "", "has an apartment without rooms")
    balconies = unary_union([Polygon(r["polygon"]) for r in rooms if r["type"] == "balcony"])
    walls = [
        w
        for r in near
        if r.kind == "separator" and (w := _wall_of_railing(r, balconies, height)) is not None
    ]
    return ParsedStorey(value_of(rooms, openings, height, walls), tuple(things))


def _wall_of_railing(row: _Row, balconies: Any, height: float) -> dict[str, Any] | None:
    """A parapet for a railing that does not belong to a balcony, or a column."""
    box = footprint(row.shape)
    is_railing = row.subtype == "RAILING"
    if (is_railing and balconies.distance(row.shape) < _NEAR_M) or box.width < 0.05:
        return None
    dx, dz = math.cos(box.turn_rad) * box.width / 2, -math.sin(box.turn_rad) * box.width / 2
    return {
        "start": [box.x - dx, box.z - dz],
        "end": [box.x + dx, box.z + dz],
        "thickness": min(max(box.depth, 0.04), 2.0),
        "height": min(PARAPET_HEIGHT_M, height) if is_railing else None,
    }


def _opening_of_row(row: _Row, height: float, floor: float | None) -> dict[str, Any]:
    """Where an opening is and how large: the long side of its polygon, heights where the row has them."""
    box = footprint(row.shape)
    kind = _OPENINGS[row.subtype]
    fields = opening(box._replace(width=round(max(box.width, 0.3), 3)), kind)
    tall = row.height
    if tall is not None and 0.3 <= tall <= height:
        fields["height"] = min(tall, height - 0.03)
        if kind == "window" and row.elevation is not None and floor is not None:
            sill = min(max(row.elevation - floor, 0.0), height - 0.03 - fields["height"])
            fields["sill"] = round(max(sill, 0.0), 3)
            fields["kind"] = "french_window" if sill < _FRENCH_M else kind
    return fields


def _things_of_row(row: _Row, height: float, floor: float | None, left_out: LeftOut) -> list[Thing]:
    if row.subtype == "STAIRS":
        left_out.add("a staircase is not built")
        return []
    tall = row.height if row.height and 0.05 <= row.height <= height else None
    tall = min(tall or _HEIGHTS.get(row.subtype, 1.0), _HEIGHTS.get(row.subtype, height), height)
    low = 0.0
    if row.elevation is not None and floor is not None and 0 <= row.elevation - floor < height:
        low = row.elevation - floor
    return [
        Thing("swiss-feature", row.subtype, b.x, b.z, low, b.width, b.depth, tall, b.turn_rad)
        for b in footprints(row.shape)
    ]


FORMAT = PlanFormat(
    title="Swiss Dwellings",
    files="geometries.csv and --apartment ID",
    order=110,
    brings="rooms, doors, windows, fixtures",
    where="zenodo.org/records/7788422",
    licence="CC BY 4.0",
    suffixes=(".csv",),
    shared_suffixes=frozenset({".csv"}),
    contains=re.compile(rb"\bapartment_id\b"),
    read=lambda path, _value, part: plan_of_rows(path, part.apartment),
)
