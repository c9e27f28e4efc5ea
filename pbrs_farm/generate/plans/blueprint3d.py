"""Read a blueprint3d home (its JSON) as a ParsedPlan; no effects.

floorplan holds corners and walls between them, y down the page; items hold furniture, doors and
windows by name and place. Lengths are centimetres; files of newer versions have the corners in metres.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, Field
from shapely.geometry import MultiPoint, Polygon

from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.closed_rings import MAX_LINES, closed_rings, passages_between
from pbrs_farm.generate.plans.parsed_plan import LeftOut, ParsedPlan, ParsedStorey, Thing, value_of
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms
from pbrs_farm.generate.plans.usual_sizes import usual_size
from pbrs_farm.home.names import words_of

_CM: Final = 0.01
_LARGEST_IN_METRES: Final = 100.0  # corners with a larger extent are in centimetres
_IN_WALL: Final = frozenset({3, 7})  # types of items that cut their wall
_MOST: Final = 5_000

_Number = Annotated[Finite, Field(ge=-1e7, le=1e7)]


class _Corner(BaseModel):
    x: _Number
    y: _Number
    elevation: _Number = 0.0


class _Wall(BaseModel):
    corner1: str
    corner2: str


class _Item(BaseModel):
    item_name: str
    item_type: int = 1
    xpos: _Number
    ypos: _Number = 0.0
    zpos: _Number
    rotation: _Number = 0.0
    scale_x: _Number = 1.0
    scale_y: _Number = 1.0
    scale_z: _Number = 1.0


class _FloorPlan(BaseModel):
    corners: dict[str, _Corner] = Field(max_length=4 * MAX_LINES)
    walls: list[_Wall] = Field(max_length=MAX_LINES)
    rooms: dict[str, Any] = Field(default_factory=dict, max_length=_MOST)


class _File(BaseModel):
    floorplan: _FloorPlan
    items: list[Any] = Field(default_factory=list, max_length=_MOST)


def plan_of_blueprint3d(path: Path, value: Any) -> ParsedPlan:
    """Read the plan, one storey. Raises BadInput, naming the place, or if the walls enclose no room."""
    fields = checked(_File, value, path)
    plan, left_out = fields.floorplan, LeftOut()
    extent = max((abs(v) for c in plan.corners.values() for v in (c.x, c.y)), default=0.0)
    unit = _CM if extent > _LARGEST_IN_METRES else 1.0
    points = {key: (c.x * unit, c.y * unit) for key, c in plan.corners.items()}
    lines = []
    for k, wall in enumerate(plan.walls, 1):
        ends = points.get(wall.corner1), points.get(wall.corner2)
        if ends[0] is None or ends[1] is None:
            raise BadInput(path, f"floorplan, wall {k}", "names a corner that does not exist")
        lines.append((ends[0], ends[1]))
    openings, things = [], []
    for row in fields.items:
        try:
            item = _Item.model_validate(row)
        except ValueError:
            left_out.add("an item has no name or place")
            continue
        width, height, depth = usual_size(item.item_name) or (0.6, 0.8, 0.6)
        size = width * abs(item.scale_x), height * abs(item.scale_y), depth * abs(item.scale_z)
        x, y, z = item.xpos * _CM, item.ypos * _CM, item.zpos * _CM
        if item.item_type in _IN_WALL:
            openings.append(_opening(item, x, y, z))
            continue
        low, turn, name = max(y - size[1] / 2, 0.0), item.rotation, item.item_name[:80]
        box = x, z, low, size[0], size[2], size[1], turn
        things.append(Thing("blueprint3d", name, *box, is_front_given=True))
    rings = closed_rings(path, lines)
    names = _names_of_rooms(plan, points)
    areas = [DrawnArea(ring, "", _name_within(ring, names)) for ring in rings]
    openings += passages_between(rings, lines, openings)
    rooms = typed_rooms("blueprint3d", areas, things, openings, left_out)
    height = max((c.elevation * unit for c in plan.corners.values()), default=0.0) or 2.5
    storey = ParsedStorey(value_of(rooms, openings, height), tuple(things))
    return ParsedPlan((storey,), left_out.lines())


def _opening(item: _Item, x: float, y: float, z: float) -> dict[str, Any]:
    """The row of a door or window; the models of blueprint3d have the sizes of its catalogue."""
    is_window = bool(words_of(item.item_name) & {"window", "glass"})
    width, height = (1.0, 1.2) if is_window else (0.9, 2.1)
    row = {"at": [x, z], "width": max(width * abs(item.scale_x), 0.3), "kind": "door"}
    height = min(max(height * abs(item.scale_y), 0.3), 2.4)
    if not is_window:
        return row | {"height": height}
    return row | {"kind": "window", "height": height, "sill": max(y - height / 2, 0.0)}


def _names_of_rooms(
    plan: _FloorPlan, points: dict[str, tuple[float, float]]
) -> list[tuple[MultiPoint, str]]:
    """Corners and names of the rooms that the user named; their keys list the corners."""
    named = []
    for key, row in plan.rooms.items():
        corners = [points[corner] for corner in key.split(",") if corner in points]
        name = row.get("name") if isinstance(row, dict) else None
        if isinstance(name, str) and len(corners) >= 3:
            named.append((MultiPoint(corners), name[:60]))
    return named


def _name_within(ring: Polygon, names: list[tuple[MultiPoint, str]]) -> str:
    return next((name for corners, name in names if ring.buffer(0.2).covers(corners)), "")


FORMAT = PlanFormat(
    title="blueprint3d",
    files="*.json",
    order=180,
    brings="rooms, doors, windows, furniture as stand-ins",
    where="blueprint3d and its descendants",
    licence="yours",
    keys=(("floorplan", "items"),),
    fits=lambda value: isinstance(value.get("floorplan"), dict) and "walls" in value["floorplan"],
    read=lambda path, value, _part: plan_of_blueprint3d(path, value),
)
