"""Floors of ZInD (zind_data.json, its redrawn plans) -> a ParsedPlan; no effects.

redraw.floor_0k.room_nn holds vertices, doors and windows as pairs of ends, and pins with labels; y is up
on the page, scale_meters_per_coordinate says how long a unit is.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, Field
from shapely.geometry import Polygon

from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.parsed_plan import LeftOut, ParsedPlan, ParsedStorey, value_of
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.plan_value import MAX_ROOMS
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms

_SAME_M: Final = 0.4  # both rooms of a door list it
_Pair = list[Finite]


class _Pin(BaseModel):
    label: Any = ""


class _Room(BaseModel):
    vertices: list[_Pair] = Field(min_length=3, max_length=20_000)
    doors: list[Any] = Field(default_factory=list, max_length=500)
    windows: list[Any] = Field(default_factory=list, max_length=500)
    pins: list[_Pin] = Field(default_factory=list, max_length=500)


def plan_of_zind(path: Path, value: Any) -> ParsedPlan:
    """Read the plan, one storey per floor. Raises BadInput, naming the place."""
    redraw = checked(dict[str, dict[str, Any]], value["redraw"], path, "redraw")
    for name, rooms in redraw.items():
        if len(rooms) > MAX_ROOMS:
            text = f"has {len(rooms)} rooms, at most {MAX_ROOMS} are read"
            raise BadInput(path, f"redraw.{name}"[:80], text)
    floors = checked(dict[str, dict[str, _Room]], redraw, path, "redraw")
    scales = value.get("scale_meters_per_coordinate")
    left_out = LeftOut()
    storeys = []
    for name in sorted(floors):
        if not floors[name]:
            continue
        scale = scales.get(name) if isinstance(scales, dict) else None
        if not isinstance(scale, int | float) or not 1e-6 < scale < 1e6:
            raise BadInput(path, f"scale_meters_per_coordinate.{name}", "expected metres a unit")
        storeys.append(_storey_of_rooms(path, name, floors[name], float(scale), left_out))
    if not storeys:
        raise BadInput(path, "redraw", "has no floor with a room")
    return ParsedPlan(tuple(storeys), left_out.lines())


def _storey_of_rooms(
    path: Path, name: str, rooms: dict[str, _Room], scale: float, left_out: LeftOut
) -> ParsedStorey:
    areas, openings = [], []
    for key, room in rooms.items():
        place = f"redraw.{name}.{key}"[:80]
        points = [_point(path, place, p, scale) for p in room.vertices]
        label = next((str(pin.label) for pin in room.pins if pin.label), "")
        areas.append(DrawnArea(Polygon(points), "", label))
        for kind, pairs in (("door", room.doors), ("window", room.windows)):
            for a, b in _pair_ends(path, f"{place}, {kind}s", pairs):
                ends = [_point(path, place, p, scale) for p in (a, b)]
                openings.append(_opening_between(kind, *ends))
    once: list[dict[str, Any]] = []
    for row in openings:
        if not any(
            o["kind"] == row["kind"] and math.dist(o["at"], row["at"]) < _SAME_M for o in once
        ):
            once.append(row)
    return ParsedStorey(
        value_of(typed_rooms("zind", areas, (), once, left_out), once, 2.6), name=name
    )


def _pair_ends(path: Path, place: str, given: list[Any]) -> list[tuple[_Pair, _Pair]]:
    """Ends by pairs: [[a, b], ...], or the ends of all in one row."""
    points = checked(list[list[Any]], given, path, place)
    is_flat = all(len(p) == 2 and not isinstance(p[0], list) for p in points)
    if not is_flat:
        points = [q for p in points for q in p[:2]]
    flat = [checked(_Pair, p, path, place) for p in points]
    return list(zip(flat[::2], flat[1::2], strict=False))


def _point(path: Path, place: str, point: _Pair, scale: float) -> tuple[float, float]:
    if len(point) < 2 or not all(abs(c) < 1e9 for c in point[:2]):
        raise BadInput(path, place, "expected points [x, y]")
    return point[0] * scale, -point[1] * scale


def _opening_between(kind: str, a: tuple[float, float], b: tuple[float, float]) -> dict[str, Any]:
    middle = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]
    row: dict[str, Any] = {"at": middle, "width": max(math.dist(a, b), 0.3), "kind": kind}
    if kind == "door":
        row["height"] = 2.05
    return row


FORMAT = PlanFormat(
    title="ZInD",
    files="zind_data.json",
    order=160,
    brings="rooms, doors, windows",
    where="github.com/zillow/zind",
    licence="academic, on request",
    keys=(("redraw",),),
    fits=lambda value: "redraw" in value,
    read=lambda path, value, _part: plan_of_zind(path, value),
)
