"""Read a floor plan in any supported format as storeys of a Plan with named items. Effects: reads the file.

This project's own format:

    {"height": 2.5,
     "rooms": [{"type": "living", "name": "Salon", "polygon": [[0, 0], [5, 0], [5, 4], [0, 4]]}],
     "doors": [{"at": [5, 2], "width": 0.9}, {"at": [0, 2], "entrance": true}],
     "windows": [{"at": [2.5, 0], "width": 1.3, "height": 1.3, "sill": 0.9}]}

GeoJSON is equivalent: polygons with the properties `type` and `name` are rooms, points with `kind`
(door, entrance, passage, window, french_window) and the sizes are openings. x runs to the right and the
second coordinate downwards on the page. Rooms may touch or leave space for the walls between. Each
other format is a module in this folder that ends with its entry FORMAT.
"""

from __future__ import annotations

import math
import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field

from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate import plans
from pbrs_farm.generate.floor_plan import OpeningKind, Plan, turned_by, upright_angle
from pbrs_farm.generate.plans.parsed_plan import MAX_THINGS, ParsedPlan, Thing
from pbrs_farm.generate.plans.plan_format import Part, PlanFormat
from pbrs_farm.generate.plans.plan_value import plan_of_value
from pbrs_farm.generate.programme_file import json_from_file


@dataclass(frozen=True, slots=True)
class PlanStorey:
    """A storey: its plan and the items in the file."""

    plan: Plan
    things: tuple[Thing, ...] = ()
    name: str = ""


@dataclass(frozen=True, slots=True)
class PlanFile:
    """Contents of a file, storeys from below, and notes about omissions, one line each."""

    storeys: tuple[PlanStorey, ...]
    left_out: tuple[str, ...] = ()

    @property
    def plan(self) -> Plan:
        """Of the lowest storey."""
        return self.storeys[0].plan


@cache
def plan_formats() -> tuple[PlanFormat, ...]:
    """The formats of plans, each the entry of a module beside this one, all of which it imports."""
    names = [module.name for module in pkgutil.iter_modules(plans.__path__)]
    modules = [import_module(f"{plans.__name__}.{name}") for name in names]
    formats = [m.FORMAT for m in modules if isinstance(getattr(m, "FORMAT", None), PlanFormat)]
    return tuple(sorted(formats, key=lambda one: one.order))


def plan_from_file(path: Path, part: Part | str = "", value: Any = None) -> PlanFile:
    """The plan of a file, its value (JSON) or a part, walls along x and z; BadInput names the place."""
    part = Part(apartment=part) if isinstance(part, str) else part
    suffix = path.suffix.lower()
    if part.apartment and suffix != ".csv":
        raise BadInput("--apartment", part.apartment, "names a row of a .csv", hint="leave it out")
    by_suffix = next((f for f in plan_formats() if suffix in f.suffixes), None)
    if value is None and by_suffix is not None and by_suffix.read is not None:
        return _of_machine(path, by_suffix.read(path, None, part), part)
    value = json_from_file(path) if value is None else value
    if isinstance(value, dict) and not _is_own(value):
        for plan_format in plan_formats():
            if plan_format.read is not None and plan_format.fits(value):
                return _of_machine(path, plan_format.read(path, value, part), part)
    if isinstance(value, dict) and value.get("type") == "FeatureCollection":
        value = _from_geojson(path, value)
    plan = plan_of_value(path, value)
    return _choose_storeys(path, (PlanStorey(plan),), (), part)


def _first_rows(value: object) -> list[Any]:
    return value[:1] if isinstance(value, list) else []


def _is_own(value: dict[str, Any]) -> bool:
    """True if the first room has the form of this project's plan format."""
    return any(
        isinstance(room, dict) and "polygon" in room for room in _first_rows(value.get("rooms"))
    )


def _of_machine(path: Path, parsed: ParsedPlan, part: Part) -> PlanFile:
    from pbrs_farm.generate.plans.parsed_plan import LeftOut

    left_out = LeftOut()
    storeys = []
    x, z = _origin(parsed)
    for storey in parsed.storeys:
        tops = [top.moved(-x, -z) for top in storey.tops]
        plan = plan_of_value(path, _moved_value(storey.value, -x, -z), left_out, tops)
        things = [t._replace(x=t.x - x, z=t.z - z) for t in storey.things if _is_sound(t)]
        n_lost = len(storey.things) - len(things[:MAX_THINGS])
        for _ in range(min(n_lost, 1)):
            left_out.add(f"{n_lost} items have no valid box, or exceed {MAX_THINGS}")
        storeys.append(PlanStorey(plan, tuple(things[:MAX_THINGS]), storey.name))
    return _choose_storeys(path, tuple(storeys), (*parsed.left_out, *left_out.lines()), part)


def _is_sound(thing: Thing) -> bool:
    return all(
        math.isfinite(v) and abs(v) < 1e9
        for v in (
            thing.x,
            thing.z,
            thing.low,
            thing.width,
            thing.depth,
            thing.height,
            thing.turn_rad,
        )
    )


def _origin(parsed: ParsedPlan) -> tuple[float, float]:
    """The least corner of all rooms: machines draw far from any origin."""
    points = [p for s in parsed.storeys for room in s.value["rooms"] for p in room["polygon"]]
    finite = [p for p in points if math.isfinite(p[0]) and math.isfinite(p[1])]
    if not finite:
        return 0.0, 0.0
    return min(p[0] for p in finite), min(p[1] for p in finite)


def _moved_value(value: dict[str, Any], dx: float, dz: float) -> dict[str, Any]:
    def at(p: Any) -> list[float]:
        return [p[0] + dx, p[1] + dz]

    rooms = [room | {"polygon": [at(p) for p in room["polygon"]]} for room in value["rooms"]]
    moved = {
        key: [row | {"at": at(row["at"])} for row in value[key]] for key in ("doors", "windows")
    }
    walls = [w | {"start": at(w["start"]), "end": at(w["end"])} for w in value.get("walls", ())]
    return value | moved | {"rooms": rooms, "walls": walls}


def _choose_storeys(
    path: Path, storeys: tuple[PlanStorey, ...], left_out: tuple[str, ...], part: Part
) -> PlanFile:
    if part.floor is not None and part.floor >= len(storeys):
        n = len(storeys)
        text = f"has {n} storey{'s' * (n > 1)}, no floor {part.floor}"
        raise BadInput(path, "", text, hint=f"#floor={n - 1} is the highest")
    if part.floor is not None:
        storeys = storeys[part.floor : part.floor + 1]
    return PlanFile(storeys, left_out)


def upright(file: PlanFile) -> PlanFile:
    """The storeys turned about their origin by one angle, so that most walls of the home run along x or z."""
    angle = upright_angle([room for storey in file.storeys for room in storey.plan.rooms])
    cos, sin = math.cos(angle), math.sin(angle)

    def turned(t: Thing) -> Thing:
        return t._replace(
            x=t.x * cos - t.z * sin, z=t.x * sin + t.z * cos, turn_rad=t.turn_rad - angle
        )

    return replace(
        file,
        storeys=tuple(
            replace(s, plan=turned_by(s.plan, angle), things=tuple(map(turned, s.things)))
            for s in file.storeys
        ),
    )


class _Geometry(BaseModel):
    type: Literal["Polygon", "Point"]
    coordinates: list[Any] = Field(min_length=1)


class _Feature(BaseModel):
    properties: dict[str, Any] | None
    geometry: _Geometry


def _from_geojson(path: Path, value: dict[str, Any]) -> dict[str, Any]:
    plan: dict[str, Any] = {"rooms": [], "doors": [], "windows": []}
    for place, feature in _features(path, value):
        row, coordinates = feature.properties or {}, feature.geometry.coordinates
        if feature.geometry.type == "Polygon":
            plan["rooms"].append(row | {"polygon": coordinates[0]})
            continue
        kind = checked(OpeningKind, row.get("kind"), path, f"{place}, kind")
        is_window = kind in (OpeningKind.WINDOW, OpeningKind.FRENCH_WINDOW)
        plan["windows" if is_window else "doors"].append(row | {"at": coordinates})
    return plan if value.get("height") is None else plan | {"height": value["height"]}


def _features(path: Path, value: dict[str, Any]) -> Iterator[tuple[str, _Feature]]:
    for k, feature in enumerate(checked(list, value.get("features"), path, "features"), 1):
        yield f"feature {k}", checked(_Feature, feature, path, f"feature {k}")
