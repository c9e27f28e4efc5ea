"""A layout as SpatialLM writes it (.txt) -> a ParsedPlan. Effects: reads the file.

One line an entity, metres, z up, any origin:

    wall_0=Wall(ax,ay,az,bx,by,bz,height,thickness)
    door_0=Door(wall_0,x,y,z,width,height)
    window_0=Window(wall_0,x,y,z,width,height)
    bbox_0=Bbox(class,x,y,z,angle_z,sx,sy,sz)
"""

from __future__ import annotations

import math
import re
import statistics
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.closed_rings import Line, closed_rings, passages_between
from pbrs_farm.generate.plans.parsed_plan import LeftOut, ParsedPlan, ParsedStorey, Thing, value_of
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms
from pbrs_farm.regular_files import text_given

_LINE: Final = re.compile(r"\s*(\w{1,40})\s*=\s*(Wall|Door|Window|Bbox)\(([^()]{0,400})\)\s*")
_MOST_LINES: Final = 50_000
_NUMBERS: Final = {"Wall": (7, 8), "Door": (5, 5), "Window": (5, 5), "Bbox": (7, 7)}


def plan_of_layout(path: Path) -> ParsedPlan:
    """Read the layout. Raises BadInput, naming the line, or if the walls enclose no room.

    Empty lines and lines that begin with # or < are skipped. Rooms are the faces enclosed by walls;
    boxes become furniture.
    """
    walls: list[list[float]] = []
    holes: list[tuple[str, list[float]]] = []
    boxes: list[tuple[str, list[float]]] = []
    lines = text_given(path).splitlines()
    if len(lines) > _MOST_LINES:
        raise BadInput(path, "", f"has {len(lines)} lines, at most {_MOST_LINES} are read")
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith(("#", "<")):
            continue
        kind, word, numbers = _entity(path, number, line)
        if kind == "Wall":
            walls.append(numbers)
        elif kind == "Bbox":
            boxes.append((word, numbers))
        else:
            holes.append((kind, numbers))
    if not walls:
        raise BadInput(path, "", "has no line wall_0=Wall(...)")
    left_out = LeftOut()
    floor = statistics.median(min(w[2], w[5]) for w in walls)
    height = max(w[6] for w in walls)
    # Seen from above y runs up the page: the plan's second coordinate is -y.
    outlines: list[Line] = [((w[0], -w[1]), (w[3], -w[4])) for w in walls]
    rooms = closed_rings(path, outlines)
    openings = [_opening_of_numbers(kind, n, floor) for kind, n in holes]
    openings += passages_between(rooms, outlines, openings)
    things = [
        Thing("spatiallm", word, x, -y, z - sz / 2 - floor, sx, sy, sz, angle)
        for word, (x, y, z, angle, sx, sy, sz) in boxes
    ]
    rows = typed_rooms("spatiallm", [DrawnArea(r, "") for r in rooms], things, openings, left_out)
    return ParsedPlan(
        (ParsedStorey(value_of(rows, openings, height), tuple(things)),), left_out.lines()
    )


def _entity(path: Path, number: int, line: str) -> tuple[str, str, list[float]]:
    """(kind, class or wall, numbers) of a line."""
    match = _LINE.fullmatch(line)
    if match is None:
        raise BadInput(path, f"line {number}", "is not a wall, door, window or bbox of a layout")
    kind, fields = match[2], [f.strip() for f in match[3].split(",")]
    word = "" if kind == "Wall" else fields.pop(0).strip("'\"")
    try:
        numbers = [float(f) for f in fields]
    except ValueError:
        raise BadInput(path, f"line {number}", f"has a {kind} without its numbers") from None
    low, high = _NUMBERS[kind]
    if not low <= len(numbers) <= high:
        raise BadInput(path, f"line {number}", f"has a {kind} of {len(numbers)} numbers, not {low}")
    if not all(math.isfinite(n) and abs(n) < 1e9 for n in numbers):
        raise BadInput(path, f"line {number}", "has a number that is not a length")
    return kind, word, numbers


def _opening_of_numbers(kind: str, numbers: list[float], floor: float) -> dict[str, Any]:
    x, y, z, width, height = numbers
    row: dict[str, Any] = {
        "at": [x, -y],
        "width": max(width, 0.3),
        "height": max(height, 0.3),
        "kind": kind.lower(),
    }
    if kind == "Window":
        row["sill"] = max(z - height / 2 - floor, 0.0)
    return row


FORMAT = PlanFormat(
    title="SpatialLM",
    files="*.txt",
    order=130,
    brings="walls, doors, windows, boxes as stand-ins",
    where="huggingface.co/manycore-research",
    licence="CC BY-NC 4.0",
    suffixes=(".txt",),
    shared_suffixes=frozenset({".txt"}),
    contains=re.compile(rb"^\s*\w+\s*=\s*Wall\(", re.MULTILINE),
    read=lambda path, _value, _part: plan_of_layout(path),
)
