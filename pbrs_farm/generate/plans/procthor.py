"""A house of ProcTHOR or Holodeck (JSON) -> a ParsedPlan. Effects: reads the table of assets beside it.

Left-handed, y up, metres: x right, z forward. z is mirrored once, for places and for angles. Rooms share
the lines of their walls. Sizes of objects come from asset-database.json beside the file, else from
usual_sizes.csv.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, Field
from shapely.geometry import Polygon

from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.parsed_plan import LeftOut, ParsedPlan, ParsedStorey, Thing, value_of
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.room_types import DrawnArea, typed_rooms
from pbrs_farm.generate.plans.usual_sizes import usual_size
from pbrs_farm.generate.programme_file import json_from_file

ASSETS: Final = "asset-database.json"
_MOST: Final = 5_000
_Metres = Annotated[Finite, Field(ge=-1e6, le=1e6)]


class _At(BaseModel):
    x: _Metres = 0.0
    y: _Metres = 0.0
    z: _Metres = 0.0


class _Room(BaseModel):
    id: Any = ""
    roomType: Any = ""  # noqa: N815
    floorPolygon: list[_At] = Field(min_length=3, max_length=20_000)  # noqa: N815


class _Wall(BaseModel):
    id: str
    polygon: list[_At] = Field(min_length=3, max_length=100)


class _Box(BaseModel):
    min: _At
    max: _At


class _Opening(BaseModel):
    id: Any = ""
    assetId: Any = ""  # noqa: N815
    wall0: str
    wall1: Any = None
    holePolygon: list[_At] | None = Field(None, min_length=2, max_length=100)  # noqa: N815
    boundingBox: _Box | None = None  # noqa: N815


class _Object(BaseModel):
    id: Any = ""
    assetId: Any = ""  # noqa: N815
    position: _At
    rotation: _At = _At()
    children: list[Any] = Field(default_factory=list)


class _House(BaseModel):
    rooms: list[_Room] = Field(min_length=1, max_length=200)
    walls: list[_Wall] = Field(max_length=_MOST)
    doors: list[_Opening] = Field(default_factory=list, max_length=_MOST)
    windows: list[_Opening] = Field(default_factory=list, max_length=_MOST)
    objects: list[_Object] = Field(default_factory=list, max_length=_MOST)


def plan_of_procthor(path: Path, value: Any) -> ParsedPlan:
    """Read the house. Raises BadInput, naming the place."""
    house = checked(_House, value, path)
    left_out = LeftOut()
    height = max((p.y for w in house.walls for p in w.polygon), default=2.6)
    walls = {w.id: w for w in house.walls}
    openings = [_opening_of_hole(o, "window", walls, left_out) for o in house.windows]
    openings += [_opening_of_hole(o, "door", walls, left_out) for o in house.doors]
    rows = [o for o in openings if o is not None]
    assets = _assets(path)
    things = [t for o in _walk_objects(path, house.objects) if (t := _thing(o, assets, left_out))]
    areas = [
        DrawnArea(Polygon([(p.x, -p.z) for p in r.floorPolygon]), str(r.roomType), _name(r))
        for r in house.rooms
    ]
    rooms = typed_rooms("ai2thor", areas, things, rows, left_out)
    return ParsedPlan(
        (ParsedStorey(value_of(rooms, rows, height), tuple(things)),), left_out.lines()
    )


def _name(room: _Room) -> str:
    # Holodeck's rooms are named freely: "master bedroom".
    text = str(room.id)
    return str(room.roomType) if "|" in text or not text else text


def _opening_of_hole(
    hole: _Opening, kind: str, walls: dict[str, _Wall], left_out: LeftOut
) -> dict[str, Any] | None:
    wall = walls.get(hole.wall0)
    points = hole.holePolygon or (
        [hole.boundingBox.min, hole.boundingBox.max] if hole.boundingBox else []
    )
    if wall is None or not points:
        left_out.add(f"a {kind} names no wall or has no hole", str(hole.id)[:60])
        return None
    # The wall's x runs from the first to the second of its lower points; orders differ by maker.
    a, b = sorted(wall.polygon, key=lambda p: p.y)[:2]
    length = math.hypot(b.x - a.x, b.z - a.z)
    if length < 1e-6:
        left_out.add(f"a {kind} is in a wall without length", str(hole.id)[:60])
        return None
    low, high = min(p.x for p in points), max(p.x for p in points)
    bottom, top = min(p.y for p in points) - a.y, max(p.y for p in points) - a.y
    t = (low + high) / 2 / length
    row: dict[str, Any] = {
        "at": [a.x + t * (b.x - a.x), -(a.z + t * (b.z - a.z))],
        "width": max(high - low, 0.3),
        "height": max(top - bottom, 0.3),
        "kind": kind,
    }
    if kind == "window":
        return row | {"sill": max(bottom, 0.0)}
    is_outer = "exterior" in f"{hole.wall0} {hole.wall1}"
    if is_outer:
        row["kind"] = "entrance"
    elif str(hole.assetId).lower().startswith("doorframe") or not hole.assetId:
        row["kind"] = "passage"
    return row


def _walk_objects(path: Path, objects: list[_Object]) -> Iterator[_Object]:
    """Iterate over all objects including their children, which have absolute positions."""
    waiting, n = [(o, 0) for o in reversed(objects)], 0
    while waiting:
        thing, depth = waiting.pop()
        yield thing
        n += 1 + len(thing.children)
        if n > _MOST or depth > 20:
            raise BadInput(path, "objects", f"has over {_MOST} objects or 20 upon each other")
        children = [
            checked(_Object, c, path, f"children of {thing.id}"[:80]) for c in thing.children
        ]
        waiting += [(c, depth + 1) for c in reversed(children)]


def _thing(
    thing: _Object, assets: dict[str, tuple[float, float, float]], left_out: LeftOut
) -> Thing | None:
    text = str(thing.id)
    # "Fridge|2|1|0" of ProcTHOR, "sofa-0 (living room)" of Holodeck.
    name = (
        text.partition("|")[0]
        if "|" in text
        else text.partition("(")[0].strip().rstrip("-0123456789")
    )
    size = assets.get(str(thing.assetId)) or usual_size(name)
    if size is None:
        left_out.add(f"an object has no size: {ASSETS} is not beside the file, or lacks it")
        return None
    width, height, depth = size
    p = thing.position
    return Thing(
        "ai2thor",
        name,
        p.x,
        -p.z,
        p.y - height / 2,
        width,
        depth,
        height,
        # Clockwise in a left-handed frame; mirrored, its front (sin, cos) becomes (sin, -cos).
        math.pi - math.radians(thing.rotation.y),
        is_front_given=True,
    )


def _assets(path: Path) -> dict[str, tuple[float, float, float]]:
    """Asset id -> width, height, depth, of the table beside the file; a list by type, or one of all."""
    table = path.parent / ASSETS
    if not table.is_file():
        return {}
    value = json_from_file(table)
    rows = value.values() if isinstance(value, dict) else value if isinstance(value, list) else []
    flat = [r for row in rows for r in (row if isinstance(row, list) else [row])]
    sizes = {}
    for row in flat:
        box = row.get("boundingBox") if isinstance(row, dict) else None
        if isinstance(box, dict):
            size = [v for k in "xyz" if isinstance(v := box.get(k), int | float) and 0 < v < 15]
            if len(size) == 3:
                sizes[str(row.get("assetId"))] = (float(size[0]), float(size[1]), float(size[2]))
    return sizes


FORMAT = PlanFormat(
    title="ProcTHOR and Holodeck",
    files="*.json",
    order=120,
    brings="rooms, doors, windows, objects as stand-ins",
    where="github.com/allenai/procthor-10k",
    licence="Apache-2.0",
    keys=(("rooms", "walls", "objects"),),
    beside=(ASSETS,),
    fits=lambda value: {"rooms", "walls", "objects", "doors"} <= set(value),
    read=lambda path, value, _part: plan_of_procthor(path, value),
)
