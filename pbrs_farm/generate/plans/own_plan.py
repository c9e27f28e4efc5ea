"""A plan of one's own: rooms, doors and windows in metres -> Plan with walls. Effects: reads the file.

    {"height": 2.5,
     "rooms": [{"type": "living", "name": "Salon", "polygon": [[0, 0], [5, 0], [5, 4], [0, 4]]}],
     "doors": [{"at": [5, 2], "width": 0.9}, {"at": [0, 2], "entrance": true}],
     "windows": [{"at": [2.5, 0], "width": 1.3, "height": 1.3, "sill": 0.9}]}

GeoJSON says the same: polygons with the properties `type` and `name` are rooms, points with
`kind` (door, entrance, window, french_window) and the sizes are openings. x runs to the right and
the second coordinate downwards on the page. Rooms may touch or leave room for the walls between.
A .csv is a table of dwellings with WKT polygons (dwelling_rows.py).
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import shapely
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.ops import unary_union

from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    Point,
    RoomType,
)
from pbrs_farm.generate.plan_walls import INNER_M, OUTER_M, PARAPET_HEIGHT_M, PARAPET_M, corners
from pbrs_farm.generate.programme import json_from_file
from pbrs_farm.regular_files import MAX_DIGEST_BYTES, fault_of, open_regular

# An apartment of a table of dwellings with WKT polygons -> a plan's rooms and openings. Effects:
# reads the file.
# The columns are those of geometries.csv of Swiss Dwellings (Archilyse, doi
# 10.5281/zenodo.7788422): entity_type (area, separator, opening, feature), entity_subtype,
# geometry (WKT in metres, +y north), apartment_id, floor_id, and where they are there elevation
# and height. Walls follow from the areas.


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


# A plan of one's own.


MAX_ROOMS: Final = 60
_FAR_M: Final = 200.0
_TOUCH_M: Final = 0.02  # rooms nearer than this share a side
_THICKEST_M: Final = 0.6  # of a wall between rooms
_LEAST_M2: Final = 0.5
_REACH_M: Final = 0.6  # from an opening to its wall
_SIZES: Final = {
    OpeningKind.DOOR: (0.9, 2.1, 0.0), OpeningKind.ENTRANCE: (0.95, 2.1, 0.0),
    OpeningKind.WINDOW: (1.3, 1.3, 0.9), OpeningKind.FRENCH_WINDOW: (1.6, 2.1, 0.1),
}  # fmt: skip


def _in_plan(value: object) -> object:
    # Drop what GeoJSON may have behind the plan's two coordinates: a height.
    if not isinstance(value, list) or len(value) < 2:
        raise ValueError("expected a point [x, y]")
    return value[:2]


_Metres = Annotated[Finite, Field(ge=-1e5, le=1e5), AfterValidator(lambda value: round(value, 4))]
_Point = Annotated[tuple[_Metres, _Metres], BeforeValidator(_in_plan)]
_Length = Annotated[Finite, Field(ge=0, lt=20)]


class _RoomFields(BaseModel):
    type: RoomType
    name: Any = None
    polygon: list[_Point] = Field(min_length=3, fail_fast=True)


class _OpeningFields(BaseModel):
    at: _Point
    kind: Any = None
    entrance: Any = None
    width: Annotated[_Length, Field(ge=0.3)] = 0.9
    height: Annotated[_Length, Field(ge=0.3)] = 2.1
    sill: _Length = 0.0


class _PlanFields(BaseModel):
    rooms: list[Any] = Field(min_length=1, max_length=MAX_ROOMS)
    height: Finite = Field(2.5, ge=2, le=6)
    doors: list[Any] = Field(default_factory=list)
    windows: list[Any] = Field(default_factory=list)


class _Geometry(BaseModel):
    type: Literal["Polygon", "Point"]
    coordinates: list[Any] = Field(min_length=1)


class _Feature(BaseModel):
    properties: dict[str, Any] | None
    geometry: _Geometry


@dataclass(frozen=True, slots=True)
class OwnPlan:
    """A plan that was read, and what of a table it leaves out, a line each."""

    plan: Plan
    left_out: tuple[str, ...] = ()


def plan_from_file(path: Path, apartment: str = "") -> OwnPlan:
    """The plan of a JSON or GeoJSON file, or of an apartment of a table of dwellings (.csv).

    Raises BadInput, naming the room or opening. An opening of a table that fits no wall is left out.
    """
    if path.suffix.lower() == ".csv":
        return _plan_of(path, plan_value_of_rows(path, apartment), is_table=True)
    if apartment:
        raise BadInput("--apartment", apartment, "names a row of a .csv", hint="leave it out")
    return _plan_of(path, json_from_file(path))


def _plan_of(path: Path, value: Any, *, is_table: bool = False) -> OwnPlan:
    if isinstance(value, dict) and value.get("type") == "FeatureCollection":
        value = _from_geojson(path, value)
    given = checked(_PlanFields, value, path, hint='{"rooms": [...], "doors": [...]}')
    # Walls stand between the drawn rooms; openings then find their wall.
    drawn = [_room(path, k, row) for k, row in enumerate(given.rooms)]
    _check_apart(path, drawn)
    walls, rooms = _walled(path, drawn)
    openings: list[PlanOpening] = []
    left_out = []
    # A table lists what it cannot place; a file written for us must be right.
    told = [(f"door {k}", row, OpeningKind.DOOR) for k, row in enumerate(given.doors, 1)]
    told += [(f"window {k}", row, OpeningKind.WINDOW) for k, row in enumerate(given.windows, 1)]
    for place, row, kind in told:
        try:
            openings.append(_opening(path, place, row, kind, walls, rooms, given.height))
        except BadInput as error:
            if not is_table:
                raise
            left_out.append(str(error))
    return OwnPlan(Plan(rooms, walls, tuple(openings), given.height), tuple(left_out))


def _from_geojson(path: Path, value: dict[str, Any]) -> dict[str, Any]:
    plan: dict[str, Any] = {"rooms": [], "doors": [], "windows": []}
    for k, feature in enumerate(checked(list, value.get("features"), path, "features"), 1):
        given = checked(_Feature, feature, path, f"feature {k}")
        row, at = given.properties or {}, given.geometry.coordinates
        if given.geometry.type == "Polygon":
            plan["rooms"].append(row | {"polygon": at[0]})
            continue
        kind = checked(OpeningKind, row.get("kind"), path, f"feature {k}, kind")
        is_door = kind in (OpeningKind.DOOR, OpeningKind.ENTRANCE)
        plan["doors" if is_door else "windows"].append(row | {"at": at})
    return plan if value.get("height") is None else plan | {"height": value["height"]}


def _room(path: Path, number: int, row: object) -> tuple[RoomType, str, Polygon]:
    place = f"room {number + 1}"
    room = checked(_RoomFields, row, path, place)
    shape = Polygon(room.polygon)
    if not shape.is_valid or shape.area < _LEAST_M2:
        why = "crosses itself" if not shape.is_valid else f"has {shape.area:.2f} m2"
        raise BadInput(path, place, f"{why}; simple polygons of {_LEAST_M2} m2 or more work")
    return room.type, str(room.name or room.type.label)[:60], _oriented(shape)


def _oriented(shape: Polygon) -> Polygon:
    """The polygon as PlanRoom has it, without corners on straight sides."""
    return Polygon(corners(shape.simplify(1e-3)))


def _check_apart(path: Path, drawn: list[tuple[RoomType, str, Polygon]]) -> None:
    bounds = unary_union([d[2] for d in drawn]).bounds
    if max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > _FAR_M:
        raise BadInput(path, "", f"is over {_FAR_M:g} m wide", hint="coordinates in metres")
    for i, (_, name, shape) in enumerate(drawn):
        for j in range(i):
            shared = shape.intersection(drawn[j][2]).area
            if shared > 0.05:
                text = f"overlaps {drawn[j][1]!r} by {shared:.2f} m2"
                raise BadInput(path, f"room {i + 1} ({name})", text)


def _walled(
    path: Path, drawn: list[tuple[RoomType, str, Polygon]]
) -> tuple[tuple[PlanWall, ...], tuple[PlanRoom, ...]]:
    """Walls between rooms and around them; rooms without what the walls stand on."""
    shapes = [d[2] for d in drawn]
    walls: list[PlanWall] = []
    for number, shape in enumerate(shapes):
        is_open_air = drawn[number][0] is RoomType.BALCONY
        walls += _walls_of(number, shape, shapes, is_open_air=is_open_air)
    ground = unary_union([_ground(wall) for wall in walls])
    rooms = []
    for number, (type_, name, shape) in enumerate(drawn):
        polygon = corners(shape.difference(ground))
        if len(polygon) < 3:
            raise BadInput(path, f"room {number + 1} ({name})", "has no floor beside its walls")
        rooms.append(PlanRoom(type_, name, polygon))
    return tuple(walls), tuple(rooms)


def _ground(wall: PlanWall) -> Polygon:
    line = LineString([wall.start, wall.end])
    return line.buffer(wall.thickness / 2, cap_style="flat")


def _walls_of(
    number: int, shape: Polygon, shapes: list[Polygon], *, is_open_air: bool
) -> list[PlanWall]:
    """The walls that a room adds: to rooms of higher number, and outer ones (a balcony: parapets)."""
    outer, height = (PARAPET_M, PARAPET_HEIGHT_M) if is_open_air else (OUTER_M, None)
    ring: list[Point] = [(x, z) for x, z, *_ in shape.exterior.coords[:-1]]
    found = []
    for k, a in enumerate(ring):
        b, before, after = ring[(k + 1) % len(ring)], ring[k - 1], ring[(k + 2) % len(ring)]
        side = _Side(a, b)
        free = [(0.0, side.length)]
        for other, theirs in enumerate(shapes):
            if other == number:
                continue
            for low, high, gap in side.shared(theirs):
                free = _without(free, low, high)
                if other > number:
                    found.append(side.wall(low, high, max(gap, INNER_M), gap / 2))
        for low, high in free:
            if high - low < _TOUCH_M:
                continue
            # Draw an outer wall out to where the next one's outer face is.
            start = outer * _mitre(before, a, b) if low == 0.0 else INNER_M / 2
            end = outer * _mitre(a, b, after) if high == side.length else INNER_M / 2
            wall = side.wall(low - start, high + end, outer, outer / 2, is_outer=True)
            found.append(replace(wall, height=height))
    return found


def _mitre(a: Point, b: Point, c: Point) -> float:
    """How far a wall outside a..b goes on beyond b, in thicknesses: 0 where the room turns inwards."""
    turn = math.atan2(c[1] - b[1], c[0] - b[0]) - math.atan2(b[1] - a[1], b[0] - a[0])
    turn = (turn + math.pi) % (2 * math.pi) - math.pi
    return min(math.tan(turn / 2), 2.0) if turn > 0 else 0.0


def _without(
    spans: list[tuple[float, float]], low: float, high: float
) -> list[tuple[float, float]]:
    left = [(a, min(b, low)) for a, b in spans] + [(max(a, high), b) for a, b in spans]
    return sorted({(a, b) for a, b in left if b - a > 1e-6})


class _Side:
    """A side of a room: its direction and the normal that looks out of the room."""

    def __init__(self, a: Point, b: Point) -> None:
        self.start = np.array(a)
        self.length = math.dist(a, b)
        self.along = (np.array(b) - self.start) / self.length
        self.out = np.array([self.along[1], -self.along[0]])

    def shared(self, shape: Polygon) -> list[tuple[float, float, float]]:
        """(from, to, gap) where a side of another room faces this one, metres along it."""
        found = []
        for p, q in pairwise(np.array(shape.exterior.coords)):
            way = (q - p) / max(float(np.linalg.norm(q - p)), 1e-9)
            gap = float(((p + q) / 2 - self.start) @ self.out)
            if way @ self.along > -0.999 or not -_TOUCH_M <= gap <= _THICKEST_M:
                continue
            low, high = sorted(float((x - self.start) @ self.along) for x in (p, q))
            low, high = max(low, 0.0), min(high, self.length)
            if high - low > 0.05:
                found.append((low, high, max(gap, 0.0) if gap > _TOUCH_M else 0.0))
        return found

    def wall(
        self, low: float, high: float, thickness: float, out: float, *, is_outer: bool = False
    ) -> PlanWall:
        """The wall along low..high of this side, its middle line that far out."""
        if not is_outer:
            # Reach into the walls at its ends.
            low, high = low - OUTER_M / 4, high + OUTER_M / 4
        ends = [self.start + self.along * t + self.out * out for t in (low, high)]
        a, b = ((round(float(x), 4), round(float(z), 4)) for x, z in ends)
        return PlanWall(a, b, round(thickness, 4), is_outer)


def _opening(
    path: Path, place: str, row: object, kind: OpeningKind,
    walls: tuple[PlanWall, ...], rooms: tuple[PlanRoom, ...], height: float,
) -> PlanOpening:  # fmt: skip
    """A door or window in the wall nearest to where it is said to be."""
    given = checked(_OpeningFields, row, path, place)
    if given.entrance or given.kind == "entrance":
        kind = OpeningKind.ENTRANCE
    if given.kind == "french_window":
        kind = OpeningKind.FRENCH_WINDOW
    at = shapely.Point(given.at)
    lines = [LineString([w.start, w.end]) for w in walls]
    wall = min(range(len(walls)), key=lambda k: (lines[k].distance(at), k))
    if lines[wall].distance(at) > _REACH_M:
        text = f"is {lines[wall].distance(at):.1f} m from the nearest wall"
        raise BadInput(path, place, text, hint=f"within {_REACH_M} m of one")
    usual = dict(zip(("width", "height", "sill"), _SIZES[kind], strict=True))
    width, tall, sill = (usual | given.model_dump(include=set(usual), exclude_unset=True)).values()
    if sill + tall > height - 0.02:
        raise BadInput(path, place, f"is higher than the room: {height - 0.02 - sill:.2f} m works")
    along = min(
        max(lines[wall].project(at), width / 2 + 0.02), walls[wall].length - width / 2 - 0.02
    )
    if walls[wall].length < width + 0.04:
        text = f"is wider than its wall of {walls[wall].length:.2f} m"
        raise BadInput(path, place, text, hint=f"{max(walls[wall].length - 0.05, 0.3):.2f} m works")
    hole = shapely.Point(walls[wall].at(along)).buffer(walls[wall].thickness / 2 + 0.15)
    beside = [k for k, r in enumerate(rooms) if Polygon(r.polygon).intersects(hole)]
    if not beside:
        raise BadInput(path, place, "touches no room")
    # A door swings into the smaller need: out of halls, into rooms.
    beside.sort(key=lambda k: (rooms[k].type is RoomType.HALL, -rooms[k].area))
    other = beside[1] if len(beside) > 1 else None
    return PlanOpening(
        kind, wall, round(along, 4), width, tall, sill, beside[0], other,
        hinge_at_start=along < walls[wall].length / 2,
    )  # fmt: skip
