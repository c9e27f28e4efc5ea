"""Read a plan of CubiCasa5k (model.svg) as a ParsedPlan. Effects: reads the file.

Group classes give the meaning of polygons: Floorplan (a floor), Space, Wall, Door, Window, Railing,
FixedFurniture. A unit is a centimetre, y runs down. Room outlines end at the walls' faces or centre
lines: the walls' ground is subtracted; rooms without a wall between are merged.
"""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element, ParseError

import shapely
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.parsed_plan import (
    LeftOut,
    ParsedPlan,
    ParsedStorey,
    Thing,
    footprint,
    footprints,
    largest_part,
    opening,
    value_of,
)
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import LEAST_M2, DrawnArea, typed_rooms
from pbrs_farm.generate.plans.usual_sizes import usual_size
from pbrs_farm.home.names import parted
from pbrs_farm.regular_files import read_given

_MOST_BYTES: Final = 12 * 2**20
_MOST_PARTS: Final = 20_000
_MOST_POINTS: Final = 20_000  # of one polygon
_UNIT_M: Final = 0.01
_DOORS_M: Final = (0.5, 1.6)  # the median width of doors; outside, the drawing has another unit
_USUAL_DOOR_M: Final = 0.85
_OPEN_M: Final = 0.5  # two rooms whose sides touch over this length or more are one
_HEIGHT_M: Final = 2.6
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_TRANSFORM: Final = re.compile(r"(matrix|translate|scale)\s*\(([^)]{0,200})\)")
_Matrix = tuple[float, float, float, float, float, float]
_HERE: Final[_Matrix] = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
_NOT_DRAWN: Final = frozenset(
    {"Threshold", "Panel", "Glass", "DimensionMark", "SelectionControls", "Text"}
)


@dataclass
class _Floor:
    """The polygons of one floor by what they are, with the words of their class."""

    parts: dict[str, list[tuple[tuple[str, ...], Polygon]]] = field(default_factory=dict)

    def of(self, kind: str) -> list[tuple[tuple[str, ...], Polygon]]:
        """The polygons of a kind."""
        return self.parts.get(kind, [])


def plan_of_svg(path: Path) -> ParsedPlan:
    """Read the drawing, one storey per floor, aligned at their left and upper edges."""
    floors = _floors(path, _root(path))
    if not floors:
        raise BadInput(
            path, "", "has no group of the class Space with a polygon", hint="CubiCasa5k"
        )
    left_out = LeftOut()
    scale = _scale(floors, left_out)
    return ParsedPlan(
        tuple(_storey_of_drawing(f, scale, left_out) for f in floors), left_out.lines()
    )


def _root(path: Path) -> Element:
    data = read_given(path, _MOST_BYTES)
    try:
        root: Element = fromstring(data)
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise BadInput(
            path, "", f"is not valid SVG: {str(error) or 'entities are not read'}"[:200]
        ) from None
    if not str(root.tag).endswith("svg"):
        raise BadInput(path, "", "is not valid SVG: its first element is not svg")
    return root


def _floors(path: Path, root: Element) -> list[_Floor]:
    """The floors that hold a room, in the drawing's order."""
    floors: list[_Floor] = []
    whole = _Floor()  # of a drawing without groups for its floors
    n_parts = 0
    # Use an explicit stack: groups may be nested arbitrarily deep.
    waiting: list[tuple[Element, _Matrix, _Floor, str, tuple[str, ...]]] = [
        (root, _HERE, whole, "", ())
    ]
    while waiting:
        group, matrix, floor, kind, words = waiting.pop()
        tags = tuple((group.get("class") or "").split())
        matrix = _then(matrix, group.get("transform") or "")
        if tags and tags[0] == "Floorplan":
            floors.append(floor := _Floor())
        elif tags and tags[0] in ("Space", "Wall", "Door", "Window", "Railing", "FixedFurniture"):
            kind, words = tags[0], tags[1:]
        elif tags and tags[0] in _NOT_DRAWN:
            continue
        name = str(group.tag).rpartition("}")[2]
        if name == "polygon" and kind:
            n_parts += 1
            if n_parts > _MOST_PARTS:
                raise BadInput(path, "", f"has over {_MOST_PARTS} polygons")
            shape = _polygon(path, group.get("points") or "", matrix)
            if shape is not None:
                floor.parts.setdefault(kind, []).append((words, shape))
            # Only the outline of an item's drawing matters.
            continue
        children = list(group)
        if kind == "FixedFurniture":
            bounds = [c for c in children if "BoundaryPolygon" in (c.get("class") or "")]
            children = bounds[:1] or children
        waiting += [(c, matrix, floor, kind, words) for c in reversed(children)]
    return [f for f in (floors or [whole]) if f.of("Space")]


def _then(matrix: _Matrix, text: str) -> _Matrix:
    """The matrix followed, on the inside, by a transform attribute."""
    for name, inner in _TRANSFORM.findall(text[:2000]):
        n = [float(x) for x in _NUMBER.findall(inner)]
        if name == "matrix" and len(n) == 6:
            step: _Matrix = (n[0], n[1], n[2], n[3], n[4], n[5])
        elif name == "translate" and n:
            step = (1.0, 0.0, 0.0, 1.0, n[0], n[1] if len(n) > 1 else 0.0)
        elif name == "scale" and n:
            step = (n[0], 0.0, 0.0, n[1] if len(n) > 1 else n[0], 0.0, 0.0)
        else:
            continue
        a, b, c, d, e, f = matrix
        g, h, i, j, k, m = step
        matrix = (
            a * g + c * h,
            b * g + d * h,
            a * i + c * j,
            b * i + d * j,
            a * k + c * m + e,
            b * k + d * m + f,
        )
    return matrix


def _polygon(path: Path, text: str, matrix: _Matrix) -> Polygon | None:
    if len(text) > 40 * _MOST_POINTS:
        raise BadInput(path, "points", f"a polygon has over {_MOST_POINTS} corners")
    if "nan" in text.lower() or "inf" in text.lower():
        raise BadInput(path, "points", "a polygon has an invalid corner")
    n = [float(x) for x in _NUMBER.findall(text)]
    a, b, c, d, e, f = matrix
    ring = [(a * x + c * y + e, b * x + d * y + f) for x, y in zip(n[::2], n[1::2], strict=False)]
    if any(not math.isfinite(v) or abs(v) > 1e7 for p in ring for v in p):
        raise BadInput(path, "points", "a polygon has an invalid corner")
    if len(ring) < 3:
        return None
    return largest_part(shapely.make_valid(Polygon(ring)))


def _scale(floors: list[_Floor], left_out: LeftOut) -> float:
    """Metres a unit: a centimetre, or what makes the median door as wide as doors are."""
    doors = [footprint(s).width * _UNIT_M for f in floors for _, s in f.of("Door")]
    median = statistics.median(doors) if doors else _USUAL_DOOR_M
    if _DOORS_M[0] <= median <= _DOORS_M[1] or median <= 0:
        return _UNIT_M
    left_out.add(
        f"the median door would be {median:.2f} m wide: the scale is made {_USUAL_DOOR_M} m a door"
    )
    return _UNIT_M * _USUAL_DOOR_M / median


def _storey_of_drawing(floor: _Floor, scale: float, left_out: LeftOut) -> ParsedStorey:
    drawn = unary_union([s for _, s in floor.of("Space")])
    x0, y0 = drawn.bounds[:2]

    def metres(shape: Polygon) -> Polygon:
        return Polygon((shapely.get_coordinates(shape.exterior) - [x0, y0]) * scale)

    walls = unary_union([metres(s) for _, s in floor.of("Wall")])
    openings = [opening(footprint(metres(s)), "door", height=2.05) for _, s in floor.of("Door")]
    openings += [opening(footprint(metres(s)), "window") for _, s in floor.of("Window")]
    for row in openings:
        row["width"] = max(row["width"], 0.3)
    things = [
        t for words, s in floor.of("FixedFurniture") for t in _things_of_shape(words, metres(s))
    ]
    areas = []
    for words, s in floor.of("Space"):
        shape = largest_part(shapely.make_valid(metres(s)).difference(walls))
        if shape is not None:
            word = words[0] if words else "Undefined"
            # "Bath Sauna": the second word is the room's name in the drawing.
            areas.append(DrawnArea(shape, word, parted(word) if word != "Undefined" else ""))
    rooms = typed_rooms("cubicasa", areas, things, openings, left_out)
    return ParsedStorey(value_of(_opened(rooms, left_out), openings, _HEIGHT_M), tuple(things))


def _things_of_shape(words: Sequence[str], shape: Polygon) -> list[Thing]:
    name = words[0] if words else "Misc"
    _w, height, _d = usual_size(parted(name)) or usual_size(name) or (0.0, 0.85, 0.0)
    low = 1.4 if name.startswith("WallCabinet") else 0.0
    return [
        Thing("cubicasa-icon", name, b.x, b.z, low, b.width, b.depth, height, b.turn_rad)
        for b in footprints(shape)
        if min(b.width, b.depth) > 0.02
    ]


def _opened(rooms: list[dict[str, Any]], left_out: LeftOut) -> list[dict[str, Any]]:
    """The rooms, those whose sides touch without a wall between made one, of the larger one's type."""
    shapes: list[BaseGeometry] = [Polygon(r["polygon"]) for r in rooms]
    rest = list(range(len(rooms)))
    for i in range(len(rooms)):
        for j in range(i):
            if i not in rest or j not in rest or "balcony" in (rooms[i]["type"], rooms[j]["type"]):
                continue
            touch = shapes[i].buffer(0.02).intersection(shapes[j].boundary)
            if touch.length < _OPEN_M or shapes[i].distance(shapes[j]) > 0.02:
                continue
            joined = largest_part(
                unary_union([shapes[i].buffer(0.01), shapes[j].buffer(0.01)]).buffer(-0.01)
            )
            if joined is None or joined.interiors or joined.area < LEAST_M2:
                continue
            into, merged = (j, i) if shapes[j].area >= shapes[i].area else (i, j)
            joined = largest_part(joined.simplify(0.02)) or joined
            shapes[into] = joined
            rest.remove(merged)
            rooms[into] = rooms[into] | {"polygon": [list(p) for p in joined.exterior.coords[:-1]]}
            left_out.add("two rooms without a wall between are one")
    return [rooms[k] for k in rest]


FORMAT = PlanFormat(
    title="CubiCasa5k",
    files="model.svg",
    order=150,
    brings="rooms, doors, windows, fixtures",
    where="zenodo.org/records/2613548",
    licence="CC BY-NC-SA 4.0",
    suffixes=(".svg",),
    shared_suffixes=frozenset({".svg"}),
    contains=re.compile(rb"class=[\"']Space\b"),
    read=lambda path, _value, _part: plan_of_svg(path),
)
