"""An apartment of a table of dwellings with WKT polygons -> a plan's rooms and openings. Effects: reads the file.

The columns are those of geometries.csv of Swiss Dwellings (Archilyse, doi 10.5281/zenodo.7788422):
entity_type (area, separator, opening, feature), entity_subtype, geometry (WKT in metres, +y north),
apartment_id, floor_id, and where they are there elevation and height. Walls follow from the areas.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.ops import unary_union

from pbrs_farm.core.errors import BadInput
from pbrs_farm.regular_files import MAX_DIGEST_BYTES, fault_of, open_regular

_NEEDED: Final = ("entity_type", "entity_subtype", "geometry", "apartment_id", "floor_id")
_TYPES: Final = {
    "living": "LIVING_ROOM LIVING_DINING DINING LIVING LOUNGE",
    "kitchen": "KITCHEN KITCHEN_DINING",
    "bedroom": "BEDROOM ROOM",
    "studio": "STUDIO",
    "bathroom": "BATHROOM",
    "wc": "WC TOILET",
    "hall": "CORRIDOR CORRIDORS_AND_HALLS LOBBY ENTRANCE FOYER",
    "store": "STOREROOM STORAGE_ROOM BASEMENT TECHNICAL_AREA WASH_AND_DRY_ROOM",
    "wardrobe": "DRESSING_ROOM WARDROBE",
    "balcony": "BALCONY LOGGIA TERRACE PATIO ARCADE WINTERGARTEN",
}
_TYPE_OF: Final = {word: kind for kind, words in _TYPES.items() for word in words.split()}
_NO_ROOM: Final = frozenset(
    ["SHAFT", "VOID", "ELEVATOR", "STAIRCASE", "LIGHTWELL", "GARDEN", "OUTDOOR_VOID", "AIR"]
)
_OPENINGS: Final = {"DOOR": "door", "ENTRANCE_DOOR": "entrance", "WINDOW": "window"}
_SMALL_BATH_M2: Final = 2.6  # a smaller one has no bath: a WC
_NEAR_M: Final = 0.6  # from an apartment's rooms to its openings
_LONGEST_FIELD: Final = 2**22  # characters of one WKT
_NAMED: Final = 3  # apartments that a message names


@dataclass(frozen=True, slots=True)
class _Row:
    kind: str
    subtype: str
    shape: Polygon  # x right, z down
    elevation: float | None
    height: float | None


def plan_value_of_rows(path: Path, apartment: str = "") -> dict[str, Any]:
    """What a plan's JSON file would say of one apartment of the table; rooms first.

    Raises BadInput: no such table, no such apartment, several where none is named, several floors.
    """
    floors = _floors(path)
    if not floors:
        raise BadInput(path, "", "has no row of the type area with an apartment_id")
    if not apartment and len(floors) == 1:
        (apartment,) = floors
    if apartment not in floors:
        some = ", ".join(list(floors)[:_NAMED]) + (", ..." if len(floors) > _NAMED else "")
        what = f"has no apartment {apartment!r}" if apartment else f"has {len(floors)} apartments"
        raise BadInput(
            path, "apartment_id", f"{what}: {some}", hint=f"--apartment {next(iter(floors))}"
        )
    if len(floors[apartment]) > 1:
        raise BadInput(
            path, f"apartment {apartment}", f"has {len(floors[apartment])} floors; one storey works",
            hint=f"keep the rows of floor_id {min(floors[apartment])} alone",
        )  # fmt: skip
    (floor,) = floors[apartment]
    areas, openings = _of_apartment(path, apartment, floor)
    return _value(path, areas, openings)


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """(line, row) of the table, with the columns that are needed."""
    csv.field_size_limit(_LONGEST_FIELD)
    try:
        with open_regular(path, MAX_DIGEST_BYTES) as file:
            reader = csv.DictReader(io.TextIOWrapper(file, "utf-8"))
            missing = [c for c in _NEEDED if c not in (reader.fieldnames or ())]
            if missing:
                text = f"has no column {missing[0]}"
                raise BadInput(path, "", text, hint=f"columns {', '.join(_NEEDED)}")
            for row in reader:
                yield reader.line_num, row
    except OSError as error:
        raise BadInput(path, "", fault_of(error)) from None
    except (csv.Error, UnicodeDecodeError) as error:
        raise BadInput(path, "", f"is no table of text: {error}") from None


def _floors(path: Path) -> dict[str, set[str]]:
    """Apartment -> the floors that its areas lie on, in the table's order."""
    floors: dict[str, set[str]] = {}
    for _line, row in _rows(path):
        if row["entity_type"] == "area" and row["apartment_id"]:
            floors.setdefault(row["apartment_id"], set()).add(row["floor_id"])
    return floors


def _of_apartment(path: Path, apartment: str, floor: str) -> tuple[list[_Row], list[_Row]]:
    """An apartment's areas, and the openings beside them."""
    areas, openings = [], []
    for line, row in _rows(path):
        if row["floor_id"] != floor:
            continue
        if row["entity_type"] == "area" and row["apartment_id"] == apartment:
            if row["entity_subtype"].upper() not in _NO_ROOM:
                areas.append(_read(path, line, row))
        elif row["entity_type"] == "opening" and row["entity_subtype"].upper() in _OPENINGS:
            openings.append(_read(path, line, row))
    ground = unary_union([a.shape for a in areas])
    return areas, [o for o in openings if ground.distance(o.shape) < _NEAR_M]


def _read(path: Path, line: int, row: dict[str, str]) -> _Row:
    try:
        shape = shapely.from_wkt(row["geometry"])
    except shapely.errors.ShapelyError:
        shape = None
    if isinstance(shape, MultiPolygon):
        shape = max(shape.geoms, key=lambda part: part.area)
    if not isinstance(shape, Polygon) or shape.is_empty:
        raise BadInput(path, f"line {line}", "has a geometry that is no WKT polygon")
    # North is up: the plan's second coordinate runs downwards.
    ring = [(x, -y) for x, y, *_ in shape.exterior.coords]
    elevation, height = (_number(row.get(key)) for key in ("elevation", "height"))
    subtype = row["entity_subtype"].upper()
    return _Row(row["entity_type"], subtype, Polygon(ring), elevation, height)


def _number(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _value(path: Path, areas: list[_Row], openings: list[_Row]) -> dict[str, Any]:
    types = _room_types(areas)
    x0, z0 = unary_union([a.shape for a in areas]).bounds[:2] if areas else (0.0, 0.0)
    heights = sorted(a.height for a in areas if a.height and 2.0 <= a.height <= 6.0)
    height = heights[len(heights) // 2] if heights else 2.5
    ground = min((a.elevation for a in areas if a.elevation is not None), default=None)
    if not areas:
        raise BadInput(path, "", "has an apartment without rooms")
    rows: dict[str, Any] = {"height": height, "doors": [], "windows": []}
    rows["rooms"] = [
        {"type": kind, "polygon": [[x - x0, z - z0] for x, z in a.shape.exterior.coords[:-1]]}
        for kind, a in zip(types, areas, strict=True)
    ]
    for opening in openings:
        kind = _OPENINGS[opening.subtype]
        rows["windows" if kind == "window" else "doors"].append(
            {"kind": kind, **_placed(opening, (x0, z0), height, ground)}
        )
    return rows


def _room_types(areas: list[_Row]) -> list[str]:
    """The type of each area; where none is to live in, the largest plain room is."""
    types = [_TYPE_OF.get(a.subtype, "hall") for a in areas]
    types = [
        "wc" if kind == "bathroom" and a.shape.area < _SMALL_BATH_M2 else kind
        for kind, a in zip(types, areas, strict=True)
    ]
    plain = [k for k, a in enumerate(areas) if a.subtype == "ROOM"]
    if not {"living", "studio"} & set(types) and plain:
        largest = max(plain, key=lambda k: (areas[k].shape.area, -k))
        types[largest] = "living" if len(plain) > 1 or "bedroom" in types else "studio"
        if "bedroom" not in types:
            types[largest] = "studio"
    return types


def _placed(
    opening: _Row, origin: tuple[float, float], height: float, ground: float | None
) -> dict[str, Any]:
    """Where an opening is and how large: the long side of its polygon, heights where they are told."""
    middle = opening.shape.centroid
    corners = shapely.get_coordinates(opening.shape.minimum_rotated_rectangle).tolist()
    width = max(math.dist(corners[0], corners[1]), math.dist(corners[1], corners[2]))
    row: dict[str, Any] = {
        "at": [middle.x - origin[0], middle.y - origin[1]], "width": round(max(width, 0.3), 3),
    }  # fmt: skip
    tall = opening.height
    if tall is not None and 0.3 <= tall <= height:
        row["height"] = min(tall, height - 0.03)
        if opening.subtype == "WINDOW" and opening.elevation is not None and ground is not None:
            sill = min(max(opening.elevation - ground, 0.0), height - 0.03 - row["height"])
            row |= {"sill": round(max(sill, 0.0), 3), **_french(sill)}
    return row


def _french(sill: float) -> dict[str, str]:
    # A window down to the floor is a door of glass.
    return {"kind": "french_window"} if sill < 0.3 else {}
