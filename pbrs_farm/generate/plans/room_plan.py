"""A scan of Apple's RoomPlan (CapturedRoom or CapturedStructure) -> a ParsedPlan; no effects.

Its value is that of a JSON export, or what read/usd makes of a USD export.

Metres, y up. A surface: dimensions [w, h, 0] and a transform, 16 numbers by column, its x along the
wall, y up, its origin the middle. Older exports write the category as text and the transform as 4 rows.
"""

from __future__ import annotations

import math
import re
import statistics
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from pydantic import BaseModel, Field
from shapely.geometry import LineString, Point, Polygon
from shapely.ops import unary_union

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import transform_points
from pbrs_farm.generate.plans.closed_rings import Line, closed_rings, passages_between
from pbrs_farm.generate.plans.parsed_plan import (
    LeftOut,
    ParsedPlan,
    ParsedStorey,
    Thing,
    largest_part,
    value_of,
)
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms
from pbrs_farm.generate.plans.wall_tops import WallTop, upper_edge
from pbrs_farm.geometry.doorways import rooms_by_walls

STAGES: Final = (".usdz", ".usda", ".usdc", ".usd")
"""Suffixes of the other export, whose value `prepare` reads."""
_MOST: Final = 3_000
_JOIN_M: Final = 0.25  # scanned walls do not meet exactly
_IN_WALL_M: Final = (
    0.15  # maximum distance from a wall's line for an item to be part of the wall, metres
)
_SPURIOUS_M: Final = 12.0
_SAME_HEIGHT_M: Final = 0.15  # maximum difference in wall height without a note, metres
_UPRIGHT: Final = 0.98  # y of a wall's own up, at least: others lean
# Names of rooms by their sections' labels, the most specific first.
_NAMES: Final = {
    "kitchen": "Kitchen",
    "bathroom": "Bathroom",
    "bedroom": "Bedroom",
    "diningRoom": "Dining room",
    "livingRoom": "Living room",
}
_KINDS: Final = {"door": "door", "window": "window", "opening": "passage"}


class _Surface(BaseModel):
    category: Any = None
    dimensions: list[Finite] = Field(min_length=2, max_length=3)
    transform: list[Any] = Field(min_length=4, max_length=16)
    polygonCorners: list[list[Finite]] | None = Field(None, max_length=20_000)  # noqa: N815
    completedEdges: list[Any] | None = None  # noqa: N815
    story: Any = 0


class _Section(BaseModel):
    label: Any = ""
    center: list[Finite] = Field(min_length=3, max_length=3)
    story: Any = 0


class _Scan(BaseModel):
    walls: list[_Surface] = Field(default_factory=list, max_length=_MOST)
    doors: list[_Surface] = Field(default_factory=list, max_length=_MOST)
    windows: list[_Surface] = Field(default_factory=list, max_length=_MOST)
    openings: list[_Surface] = Field(default_factory=list, max_length=_MOST)
    objects: list[_Surface] = Field(default_factory=list, max_length=_MOST)
    floors: list[_Surface] = Field(default_factory=list, max_length=_MOST)
    sections: list[_Section] = Field(default_factory=list, max_length=_MOST)


def plan_of_room_plan(path: Path, value: Any) -> ParsedPlan:
    """Read the scan, one storey per `story`. Raises BadInput, naming the place."""
    if not value.get("walls") and isinstance(value.get("rooms"), list):
        # A structure of several scans: what each of them holds.
        names = _Scan.model_fields
        rooms = [r for r in value["rooms"] if isinstance(r, dict)]
        value = {n: [x for r in rooms if isinstance(r.get(n), list) for x in r[n]] for n in names}
    scan = checked(_Scan, value, path)
    left_out = LeftOut()
    stories = sorted({_story(s.story) for s in (*scan.walls, *scan.floors)})
    if not scan.walls:
        raise BadInput(path, "walls", "has no wall")
    storeys = [
        _storey_of_scan(path, _of(scan, story), left_out, is_top=story == stories[-1])
        for story in stories
    ]
    return ParsedPlan(tuple(storeys), left_out.lines())


def _story(value: object) -> int:
    return value if isinstance(value, int) and abs(value) < 100 else 0


def _of(scan: _Scan, story: int) -> _Scan:
    parts = {
        name: [s for s in getattr(scan, name) if _story(s.story) == story]
        for name in _Scan.model_fields
    }
    return scan.model_copy(update=parts)


def _storey_of_scan(path: Path, scan: _Scan, left_out: LeftOut, *, is_top: bool) -> ParsedStorey:
    walls, lines, tops = [], [], []
    for k, surface in enumerate(scan.walls, 1):
        pose = _parse_pose(path, f"wall {k}", surface)
        edges = surface.completedEdges
        if surface.dimensions[0] > _SPURIOUS_M and edges is not None and len(edges) < 2:
            left_out.add(f"a wall over {_SPURIOUS_M:g} m with fewer than two edges is not a wall")
            continue
        if abs(pose[1, 1]) < _UPRIGHT:
            left_out.add("a leaning wall is made upright")
        walls.append((surface, pose))
        top = _upper_edge_of(surface, pose)
        tops.append(top)
        lines.append((top.places[0], top.places[-1]))
    floor = _floor_height(path, scan, walls)
    height = statistics.median([w.dimensions[1] for w, _ in walls] or [2.6])
    tops = [t._replace(heights=tuple(y - floor for y in t.heights)) for t in tops]
    if not any(top.is_sloped for top in tops):
        _note_heights(tops, height, left_out)
        tops = []
    elif not is_top:
        left_out.add("walls rise to a roof below another storey: its ceilings are level")
        tops = []
    else:
        height = max(y for top in tops for y in top.heights)
    outlines = [
        shape
        for k, f in enumerate(scan.floors, 1)
        if len(f.polygonCorners or ()) >= 3
        and (shape := _outline_of_floor(path, f"floor {k}", f)).area >= 0.5
    ]
    lines += _lines_in_gaps(path, scan, lines)
    walls_of_plan = [LineString(line) for line in lines if line[0] != line[1]]
    outlines = [room for o in outlines for room in rooms_by_walls(o, walls_of_plan) or [o]]
    outlines = outlines or closed_rings(path, lines, _JOIN_M)
    openings = [
        _opening_of_surface(s, _parse_pose(path, f"{kind} {k}", s), kind, floor)
        for kind, surfaces in (
            ("door", scan.doors),
            ("window", scan.windows),
            ("opening", scan.openings),
        )
        for k, s in enumerate(surfaces, 1)
    ]
    things = [
        _thing(s, _parse_pose(path, f"object {k}", s), floor) for k, s in enumerate(scan.objects, 1)
    ]
    openings += passages_between(outlines, lines, openings)
    labels = [_section_label(shape, scan.sections) for shape in outlines]
    areas = [
        DrawnArea(s, word, _NAMES.get(word, "")) for s, word in zip(outlines, labels, strict=True)
    ]
    rooms = typed_rooms("roomplan", areas, things, openings, left_out)
    return ParsedStorey(value_of(rooms, openings, height), tuple(things), tops=tuple(tops))


def _parse_pose(path: Path, place: str, surface: _Surface) -> F64:
    """(4, 4) world from local, of 16 numbers by column or of 4 rows."""
    rows = surface.transform
    flat = rows if len(rows) == 16 else [x for row in rows if isinstance(row, list) for x in row]
    is_number = [isinstance(x, int | float) and math.isfinite(x) and abs(x) < 1e6 for x in flat]
    if len(flat) != 16 or not all(is_number):
        raise BadInput(path, f"{place}, transform", "expected 16 numbers")
    pose = np.array(flat, np.float64).reshape(4, 4)
    # The row 0 0 0 1 shows whether the matrix is row-major.
    return pose if np.allclose(pose[3], [0, 0, 0, 1]) and pose[:3, 3].any() else pose.T


def _upper_edge_of(surface: _Surface, pose: F64) -> WallTop:
    """The upper edge in the plan, heights in the scan's own y: of its outline, else of its rectangle."""
    half_width, half_height = (v / 2 for v in surface.dimensions[:2])
    edge = [(-half_width, half_height), (half_width, half_height)]
    corners = [(*c, 0.0, 0.0)[:2] for c in surface.polygonCorners or ()]
    outline = largest_part(shapely.make_valid(Polygon(corners))) if len(corners) >= 3 else None
    if outline is not None:
        outline_edge = upper_edge(outline)
        edge = outline_edge if len(outline_edge) >= 2 else edge
    world = transform_points(pose, np.array([(x, y, 0.0) for x, y in edge]))
    places = tuple((float(x), float(z)) for x, _, z in world)
    return WallTop(places, tuple(float(y) for y in world[:, 1]))


def _lines_in_gaps(path: Path, scan: _Scan, lines: list[Line]) -> list[Line]:
    """Centre lines of doors, windows and openings between walls instead of in one."""
    standing = unary_union([LineString(line).buffer(_IN_WALL_M) for line in lines])
    gap_lines = []
    for kind in ("doors", "windows", "openings"):
        for k, surface in enumerate(getattr(scan, kind), 1):
            top = _upper_edge_of(surface, _parse_pose(path, f"{kind} {k}", surface))
            line = (top.places[0], top.places[-1])
            if LineString(line).difference(standing).length > surface.dimensions[0] / 2:
                gap_lines.append(line)
    return gap_lines


def _note_heights(tops: list[WallTop], height: float, left_out: LeftOut) -> None:
    """A note where walls of one storey have no one height: its ceiling has."""
    heights = [max(top.heights) for top in tops]
    if max(heights, default=0.0) - min(heights, default=0.0) > _SAME_HEIGHT_M:
        low, high = min(heights), max(heights)
        text = f"walls of {low:.2f} to {high:.2f} m have one ceiling, at {height:.2f} m"
        left_out.add(f"{text}: the scan has no slope between them")


def _floor_height(path: Path, scan: _Scan, walls: list[tuple[_Surface, F64]]) -> float:
    lows = [float(pose[1, 3]) - w.dimensions[1] / 2 for w, pose in walls]
    floors = [float(_parse_pose(path, "floor", f)[1, 3]) for f in scan.floors]
    return statistics.median(floors or lows or [0.0])


def _outline_of_floor(path: Path, place: str, floor: _Surface) -> Polygon:
    pose = _parse_pose(path, place, floor)
    local = np.array([(*c, 0.0, 0.0, 0.0)[:3] for c in floor.polygonCorners or ()])
    world = transform_points(pose, local)
    return Polygon(world[:, [0, 2]])


def _category(surface: _Surface) -> str:
    """{"bed": {}} or "bed" -> "bed"."""
    value = surface.category
    return str(next(iter(value), "")) if isinstance(value, dict) else str(value or "")


def _opening_of_surface(surface: _Surface, pose: F64, kind: str, floor: float) -> dict[str, Any]:
    width, height = surface.dimensions[:2]
    low = float(pose[1, 3]) - height / 2 - floor
    row: dict[str, Any] = {
        "at": [float(pose[0, 3]), float(pose[2, 3])],
        "width": max(width, 0.3),
        "height": max(height, 0.3),
        "kind": _KINDS[kind],
    }
    if kind == "window":
        row["sill"] = max(low, 0.0)
    return row


def _thing(surface: _Surface, pose: F64, floor: float) -> Thing:
    width, height, depth = (*surface.dimensions, 0.5)[:3]
    right = pose[:3, 0]
    return Thing(
        "roomplan",
        _category(surface),
        float(pose[0, 3]),
        float(pose[2, 3]),
        float(pose[1, 3]) - height / 2 - floor,
        width,
        max(depth, 0.02),
        height,
        math.atan2(-float(right[2]), float(right[0])),
    )


def _section_label(shape: Polygon, sections: list[_Section]) -> str:
    """The label of the sections in a room, of several the one that its fixtures need."""
    inside = [s for s in sections if shape.contains(Point(s.center[0], s.center[2]))]
    labels = [str(s.label) for s in inside]
    return next((word for word in _NAMES if word in labels), next(iter(labels), ""))


def _is_scan(value: dict[str, Any]) -> bool:
    """A scan, or a structure of several scans, which keeps the walls in its rooms alone."""
    rooms = value.get("rooms")
    first = rooms[0] if isinstance(rooms, list) and rooms else None
    has_scans = isinstance(first, dict) and {"walls", "objects"} <= set(first)
    return {"walls", "objects"} <= set(value) or has_scans


FORMAT = PlanFormat(
    title="RoomPlan",
    files="*.json or .usdz",
    order=140,
    brings="walls, doors, windows, boxes as stand-ins",
    where="a phone's own scan",
    licence="yours",
    suffixes=STAGES,
    shared_suffixes=frozenset(STAGES),
    contains=re.compile(rb"\bArch_grp\b"),
    keys=(("walls", "doors", "windows", "objects"),),
    fits=_is_scan,
    read=lambda path, value, _part: plan_of_room_plan(path, value),
)
