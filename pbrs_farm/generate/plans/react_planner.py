"""Read a react-planner home (its JSON) as a ParsedPlan; no effects.

layers.<id> holds vertices, lines (walls), holes, areas and items; y is up on the page, lengths are in the
file's unit (cm). A hole is at `offset`, a fraction of its line, or at its `coordinates`. For plans traced
from a picture, `scale` is square units per square pixel; properties are in units in any case.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Final, TypeGuard

from pydantic import BaseModel, BeforeValidator, Field
from shapely.geometry import Polygon

from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.closed_rings import Line, closed_rings, passages_between
from pbrs_farm.generate.plans.parsed_plan import (
    LeftOut,
    ParsedPlan,
    ParsedStorey,
    Thing,
    footprint,
    value_of,
)
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms
from pbrs_farm.generate.plans.usual_sizes import usual_size

_METRES: Final = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": 0.3048, "mi": 1609.344}
_MOST: Final = 5_000
_LEAST_M2: Final = 1.0  # of all areas together: smaller ones enclose no room


class _Layer(BaseModel):
    vertices: dict[str, Any] = Field(default_factory=dict, max_length=20_000)
    lines: dict[str, Any] = Field(default_factory=dict, max_length=_MOST)
    holes: dict[str, Any] = Field(default_factory=dict, max_length=_MOST)
    items: dict[str, Any] = Field(default_factory=dict, max_length=_MOST)
    areas: dict[str, Any] = Field(default_factory=dict, max_length=_MOST)
    altitude: float = 0.0
    name: Any = ""


def _one_for_none(value: Any) -> Any:
    """Replace null by 1: editors write null as the scale of a plan that was not traced."""
    return 1.0 if value is None else value


class _File(BaseModel):
    unit: str = "cm"
    scale: Annotated[float, BeforeValidator(_one_for_none)] = Field(1.0, gt=1e-12, lt=1e12)
    layers: dict[str, _Layer] = Field(min_length=1, max_length=50)


def plan_of_react_planner(path: Path, value: Any) -> ParsedPlan:
    """Read the plan, one storey per layer. Raises BadInput, naming the place."""
    fields = checked(_File, value, path)
    if fields.unit not in _METRES:
        raise BadInput(path, "unit", f"no such unit: {fields.unit[:20]}", hint=", ".join(_METRES))
    left_out = LeftOut()
    layers = sorted(fields.layers.items(), key=lambda row: row[1].altitude)
    drawn = [
        _Drawing(path, f"layers.{key}"[:60], layer, _METRES[fields.unit], math.sqrt(fields.scale))
        for key, layer in layers
        if layer.lines
    ]
    if not drawn:
        raise BadInput(path, "layers", "has no layer with lines")
    return ParsedPlan(tuple(d.storey(left_out) for d in drawn), left_out.lines())


class _Drawing:
    """A layer in metres. metres: metres per unit. scale: units per drawn length."""

    def __init__(self, path: Path, place: str, layer: _Layer, metres: float, scale: float) -> None:
        self.path, self.place, self.layer = path, place, layer
        self.metres, self.scale = metres, scale

    def storey(self, left_out: LeftOut) -> ParsedStorey:
        """The storey of the layer."""
        lines, walls, heights = {}, [], []
        for key, row in self.layer.lines.items():
            line = self._line(key, row)
            if line is None:
                left_out.add("a line has no two ends", f"{self.place}.lines.{key}"[:80])
                continue
            lines[key] = line
            kind = str(row.get("type", "wall"))
            if kind in ("wall", "area_splitter"):
                heights.append(self._length(row, "height", 2.6))
            elif math.dist(*line) > 0.05:
                walls.append(
                    {
                        "start": list(line[0]),
                        "end": list(line[1]),
                        "thickness": min(max(self._length(row, "thickness", 0.1), 0.04), 2.0),
                        "height": 1.0 if kind == "railing" else None,
                    }
                )
        openings = [
            o
            for k, row in self.layer.holes.items()
            if (o := self._opening(k, row, lines, left_out))
        ]
        things = [t for k, row in self.layer.items.items() if (t := self._thing(k, row, left_out))]
        areas = self._areas(lines, left_out)
        outlines = [area.shape for area in areas]
        openings += passages_between(outlines, list(lines.values()), openings)
        rooms = typed_rooms("react-planner", areas, things, openings, left_out)
        value = value_of(rooms, openings, max(heights, default=2.6), walls)
        return ParsedStorey(value, tuple(things), str(self.layer.name)[:60])

    def _areas(self, lines: dict[str, Line], left_out: LeftOut) -> list[DrawnArea]:
        areas = []
        scale = self._scale_of_outlines()
        for key, row in self.layer.areas.items():
            names = row.get("vertices") if isinstance(row, dict) else None
            points = [self._vertex(n) for n in names] if isinstance(names, list) else []
            ring = [p for p in points if p is not None]
            if not points and isinstance(row, dict):
                ring = [(x * scale, z * scale) for x, z in self._outline(row)]
            if len(ring) < 3 or len(ring) < len(points):
                left_out.add("an area names no three corners", f"{self.place}.areas.{key}"[:80])
                continue
            name = str(row.get("name") or "")
            areas.append(
                DrawnArea(Polygon(ring), "", "" if name.lower().startswith("area") else name)
            )
        if sum(area.shape.area for area in areas) > _LEAST_M2:
            return areas
        return [DrawnArea(p, "") for p in closed_rings(self.path, list(lines.values()))]

    def _outline(self, row: Any) -> list[tuple[float, float]]:
        if not isinstance(row, dict):
            return []
        return self._ring(row.get("coords")) or self._ring(row.get("coordinates"))

    def _scale_of_outlines(self) -> float:
        """By what to multiply the outlines of areas, which some files give in metres.

        Files of traced plans have the vertices in pixels and the areas' coords in metres. The unit is the one
        in which the areas are as large as the lines: that of the vertices, metres, or the file's unit.
        """
        corners = [p for row in self.layer.areas.values() for p in self._outline(row)]
        vertices = [p for name in self.layer.vertices if (p := self._vertex(name)) is not None]
        if min(_extent(corners), _extent(vertices)) <= 0:
            return 1.0
        drawn = self.metres * self.scale
        scales = (1.0, 1 / drawn, self.metres / drawn)
        ratio = _extent(vertices) / _extent(corners)
        return min(scales, key=lambda scale: abs(math.log(scale / ratio)))

    def _line(self, key: str, row: Any) -> Line | None:
        if not isinstance(row, dict):
            raise BadInput(self.path, f"{self.place}.lines.{key}"[:80], "expected an object")
        names = row.get("vertices")
        if isinstance(names, list) and len(names) >= 2:
            a, b = self._vertex(names[0]), self._vertex(names[1])
            return (a, b) if a and b and a != b else None
        points = self._ring(row.get("coordinates"))
        if len(points) < 3:
            return None
        box = footprint(Polygon(points))
        dx, dz = math.cos(box.turn_rad) * box.width / 2, -math.sin(box.turn_rad) * box.width / 2
        return (box.x - dx, box.z - dz), (box.x + dx, box.z + dz)

    def _vertex(self, name: object) -> tuple[float, float] | None:
        return self._point(self.layer.vertices.get(str(name)))

    def _ring(self, given: Any) -> list[tuple[float, float]]:
        """Corners of an outline given as [[x, y], ...] or nested (GeoJSON); [] for anything else."""
        for _ in range(3):
            if not isinstance(given, list) or not given:
                return []
            if self._point(given[0]) is not None:
                break
            given = given[0]
        points = [q for p in given if (q := self._point(p))] if isinstance(given, list) else []
        return points if len(points) == len(given) else []

    def _point(self, given: Any) -> tuple[float, float] | None:
        x, y = (given.get("x"), given.get("y")) if isinstance(given, dict) else (None, None)
        if isinstance(given, list) and len(given) >= 2:
            x, y = given[:2]
        if not _is_number(x) or not _is_number(y):
            return None
        factor = self.metres * self.scale
        return float(x) * factor, -float(y) * factor

    def _length(self, row: Any, name: str, usual: float) -> float:
        """A property in metres: {"length": 20}, {"value": 20, "unit": "cm"} or 20."""
        properties = row.get("properties") if isinstance(row, dict) else None
        value = properties.get(name) if isinstance(properties, dict) else None
        metres = self.metres
        if isinstance(value, dict):
            metres = _METRES.get(str(value.get("unit")), metres)
            value = value.get("length", value.get("value"))
        return float(value) * metres if _is_number(value) else usual

    def _opening(
        self, key: str, row: Any, lines: dict[str, Line], left_out: LeftOut
    ) -> dict[str, Any] | None:
        line = lines.get(str(row.get("line"))) if isinstance(row, dict) else None
        if line is None:
            left_out.add("a hole names no line", f"{self.place}.holes.{key}"[:80])
            return None
        (x0, z0), (x1, z1) = line
        offset, ring = row.get("offset"), self._ring(row.get("coordinates"))
        # Items have a length along the wall; if both are given, width is the thickness.
        width = self._length(row, "length", self._length(row, "width", 0.9))
        if _is_number(offset) and 0 <= offset <= 1:
            t = float(offset)
        elif len(ring) >= 2:
            along = [
                ((x - x0) * (x1 - x0) + (z - z0) * (z1 - z0)) / math.dist(*line) ** 2
                for x, z in ring
            ]
            t = min(max((min(along) + max(along)) / 2, 0.0), 1.0)
            width = (max(along) - min(along)) * math.dist(*line)
        else:
            t = 0.5
            left_out.add(
                "a hole has no place: it is put in the middle of its line, a guess",
                f"{self.place}.holes.{key}"[:80],
            )
        kind = str(row.get("type", "door")).lower()
        fields: dict[str, Any] = {
            "at": [x0 + t * (x1 - x0), z0 + t * (z1 - z0)],
            "width": max(width, 0.3),
            "kind": "door",
        }
        if "window" in kind or "curtain" in kind:
            sill, height = self._sill_and_height(row)
            fields |= {"kind": "window", "height": max(height, 0.3), "sill": max(sill, 0.0)}
        elif "entrance" in kind:
            fields["kind"] = "entrance"
        else:
            fields["height"] = max(min(self._length(row, "height", 2.05), 2.4), 1.6)
        return fields

    def _sill_and_height(self, row: dict[str, Any]) -> tuple[float, float]:
        """Of a window: by its edges where it has a property for them, else as react-planner has it."""
        properties = row.get("properties")
        edges = properties.get("heights") if isinstance(properties, dict) else None
        if not isinstance(edges, dict):
            return self._length(row, "altitude", 0.9), self._length(row, "height", 1.3)
        low, high = edges.get("lower_edge"), edges.get("upper_edge")
        sill = float(low) * self.metres if _is_number(low) else 0.9
        return sill, float(high) * self.metres - sill if _is_number(high) else 1.3

    def _thing(self, key: str, row: Any, left_out: LeftOut) -> Thing | None:
        position = self._point(row)
        ring = self._ring(row.get("coordinates")) if isinstance(row, dict) else []
        if position is None and len(ring) >= 3:
            box = footprint(Polygon(ring))
            position = box.x, box.z
        name = str(row.get("type", "")) if isinstance(row, dict) else ""
        size = usual_size(name) or (0.6, 0.8, 0.6)
        if position is None or name.lower() in ("stairs", "elevator", "shaft"):
            left_out.add(
                "an item has no place, or is stairs or a shaft", f"{self.place}.items.{key}"[:80]
            )
            return None
        width = self._length(row, "width", self._length(row, "length", size[0]))
        turn = row.get("rotation", 0)
        return Thing(
            "cubicasa-icon",
            name,
            *position,
            max(self._length(row, "altitude", 0.0), 0.0),
            max(width, 0.05),
            max(self._length(row, "depth", size[2]), 0.05),
            max(self._length(row, "height", size[1]), 0.05),
            math.radians(float(turn)) if _is_number(turn) else 0.0,
        )


def _extent(points: list[tuple[float, float]]) -> float:
    """The longer side of the points' box; 0 without points."""
    axes = list(zip(*points, strict=True))
    return max((max(axis) - min(axis) for axis in axes), default=0.0)


def _is_number(value: object) -> TypeGuard[int | float]:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and abs(value) < 1e9
    )


FORMAT = PlanFormat(
    title="react-planner",
    files="*.json",
    order=170,
    brings="rooms, doors, windows, fixtures",
    where="react-planner's own export",
    licence="yours",
    keys=(("layers", "unit"),),
    fits=lambda value: "layers" in value,
    read=lambda path, value, _part: plan_of_react_planner(path, value),
)
