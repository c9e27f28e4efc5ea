"""One realistic home as a file of each format of floor plans; effects: each writer writes its file.

The home is the same in all: a living room with a kitchen beside it, a bedroom, a bathroom and a hall,
8.4 m by 7 m, five doors and four windows, and furniture. x runs right, z down the page.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

HEIGHT: Final = 2.6


class SampleRoom(NamedTuple):
    """A rectangle; sides of neighbours coincide."""

    type: str
    box: tuple[float, float, float, float]  # x0, z0, x1, z1


class SampleHole(NamedTuple):
    """A door or window: its middle on a wall's line, whether that wall runs along x."""

    kind: str  # door, entrance, window
    at: tuple[float, float]
    width: float
    along_x: bool
    rooms: tuple[int, ...]  # adjacent rooms; a single one: the outdoors is on the other side


class SampleThing(NamedTuple):
    """A piece of furniture; its front faces `front` (x, z)."""

    name: str  # in SpatialLM's words
    at: tuple[float, float]
    low: float
    size: tuple[float, float, float]  # width, depth, height
    front: tuple[int, int]


ROOMS: Final = (
    SampleRoom("living", (0.0, 0.0, 5.0, 4.0)),
    SampleRoom("kitchen", (5.0, 0.0, 8.4, 4.0)),
    SampleRoom("hall", (0.0, 4.0, 8.4, 5.4)),
    SampleRoom("bedroom", (0.0, 5.4, 5.0, 9.0)),
    SampleRoom("bathroom", (5.0, 5.4, 8.4, 9.0)),
)
HOLES: Final = (
    SampleHole("entrance", (0.0, 4.7), 0.95, False, (2,)),
    SampleHole("door", (2.0, 4.0), 0.9, True, (0, 2)),
    SampleHole("door", (6.5, 4.0), 0.8, True, (1, 2)),
    SampleHole("door", (2.0, 5.4), 0.85, True, (3, 2)),
    SampleHole("door", (6.5, 5.4), 0.8, True, (4, 2)),
    SampleHole("window", (2.5, 0.0), 1.6, True, (0,)),
    SampleHole("window", (6.7, 0.0), 1.2, True, (1,)),
    SampleHole("window", (2.5, 9.0), 1.4, True, (3,)),
    SampleHole("window", (8.4, 7.2), 0.8, False, (4,)),
)
THINGS: Final = (
    SampleThing("sofa", (0.6, 2.2), 0.0, (1.9, 0.85, 0.85), (1, 0)),
    SampleThing("coffee_table", (1.9, 2.2), 0.0, (1.0, 0.6, 0.45), (0, 1)),
    SampleThing("tv_cabinet", (4.65, 1.6), 0.0, (1.4, 0.45, 0.5), (-1, 0)),
    SampleThing("dining_table", (7.0, 2.4), 0.0, (1.4, 0.8, 0.75), (0, 1)),
    SampleThing("dining_chair", (7.0, 3.1), 0.0, (0.45, 0.5, 0.9), (0, -1)),
    SampleThing("refrigerator", (8.0, 0.5), 0.0, (0.65, 0.65, 1.8), (-1, 0)),
    SampleThing("bed", (1.3, 7.2), 0.0, (1.6, 2.1, 0.9), (1, 0)),
    SampleThing("nightstand", (0.3, 8.4), 0.0, (0.45, 0.4, 0.5), (1, 0)),
    SampleThing("wardrobe", (4.4, 8.6), 0.0, (1.0, 0.58, 2.0), (0, -1)),
    SampleThing("toilet", (5.45, 8.2), 0.0, (0.38, 0.65, 0.77), (1, 0)),
    SampleThing("tub", (7.4, 8.55), 0.0, (1.65, 0.73, 0.57), (0, -1)),
)


def write_own(folder: Path) -> Path:
    """A user's plan."""
    value = {"height": HEIGHT, "rooms": [{"type": r.type, "polygon": _ring(r)} for r in ROOMS],
             "doors": [_own(h) for h in HOLES if h.kind != "window"],
             "windows": [_own(h) for h in HOLES if h.kind == "window"]}  # fmt: skip
    return _json(folder / "plan.json", value)


def write_geojson(folder: Path) -> Path:
    """The same as GeoJSON."""
    features: list[Any] = [
        {"properties": {"type": r.type},
         "geometry": {"type": "Polygon", "coordinates": [[*_ring(r), _ring(r)[0]]]}}
        for r in ROOMS
    ]  # fmt: skip
    features += [
        {"properties": {"kind": h.kind, "width": h.width},
         "geometry": {"type": "Point", "coordinates": list(h.at)}}
        for h in HOLES
    ]  # fmt: skip
    return _json(folder / "plan.geojson", {"type": "FeatureCollection", "features": features})


def write_swiss(folder: Path, name: str = "geometries.csv") -> Path:
    """Rows of Swiss Dwellings: areas between walls of 0.2 m, a sliver, NOT_DEFINED areas, fixtures."""
    columns = (
        "apartment_id",
        "floor_id",
        "entity_type",
        "entity_subtype",
        "geometry",
        "elevation",
        "height",
    )
    rows: list[tuple[Any, ...]] = []
    words = ("NOT_DEFINED", "NOT_DEFINED", "CORRIDOR", "ROOM", "NOT_DEFINED")
    for room, word in zip(ROOMS, words, strict=True):
        x0, z0, x1, z1 = room.box
        rows.append(
            ("a1", "7", "area", word, _wkt(x0 + 0.1, z0 + 0.1, x1 - 0.1, z1 - 0.1), 404.0, HEIGHT)
        )
    rows.append(("a1", "7", "area", "NOT_DEFINED", _wkt(8.5, 0.2, 8.6, 1.8), 404.0, HEIGHT))
    rows.append(("", "7", "separator", "WALL", _wkt(0.1, 3.9, 8.3, 4.1), 404.0, HEIGHT))
    rows.append(("", "7", "separator", "COLUMN", _wkt(3.0, 1.0, 3.3, 1.3), 404.0, HEIGHT))
    for hole in HOLES:
        kind = {"door": "DOOR", "entrance": "ENTRANCE_DOOR", "window": "WINDOW"}[hole.kind]
        x, z = hole.at
        dx, dz = (hole.width / 2, 0.1) if hole.along_x else (0.1, hole.width / 2)
        low, tall = (404.9, 1.4) if kind == "WINDOW" else (404.0, 2.05)
        rows.append(("", "7", "opening", kind, _wkt(x - dx, z - dz, x + dx, z + dz), low, tall))
    for word, box in (
        ("KITCHEN", (5.2, 0.15, 7.6, 0.75)), ("SINK", (6.0, 0.2, 6.5, 0.7)), ("TOILET", (5.15, 8.0, 5.8, 8.4)),
        ("BATHTUB", (6.55, 8.2, 8.2, 8.85)), ("BUILT_IN_FURNITURE", (3.8, 8.25, 4.85, 8.85)),
    ):  # fmt: skip
        rows.append(("a1", "7", "feature", word, _wkt(*box), 404.0, HEIGHT))
    path = folder / name
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    return path


def write_spatial_lm(folder: Path) -> Path:
    """A layout of all rooms; floors at z = 4.85, unordered walls with ends some centimetres apart."""
    lines, up = [], 4.85
    walls = _walls()
    for k, (a, b) in enumerate(walls):
        slip = 0.03 * (k % 2)
        lines.append(
            f"wall_{k}=Wall({a[0] + slip:.3f},{-a[1]:.3f},{up},{b[0]:.3f},{-b[1] + slip:.3f},{up},{HEIGHT},0)"
        )
    doors = [h for h in HOLES if h.kind != "window"]
    windows = [h for h in HOLES if h.kind == "window"]
    for k, h in enumerate(doors):
        lines.append(f"door_{k}=Door(wall_0,{h.at[0]},{-h.at[1]},{up + 1.025},{h.width},2.05)")
    for k, h in enumerate(windows):
        lines.append(f"window_{k}=Window(wall_0,{h.at[0]},{-h.at[1]},{up + 1.6},{h.width},1.4)")
    for k, t in enumerate(THINGS):
        w, d, h = t.size
        angle = math.atan2(t.front[0], t.front[1])
        lines.append(
            f"bbox_{k}=Bbox({t.name},{t.at[0]},{-t.at[1]},{up + t.low + h / 2},{angle:.4f},{w},{d},{h})"
        )
    path = folder / "scene_00001_1_0.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def write_procthor(folder: Path) -> Path:
    """A house of schema 1.0.0, left-handed, beside the table of its assets' sizes."""
    rooms, walls = [], []
    types = {"living": "LivingRoom", "hall": "LivingRoom"}
    for k, room in enumerate(ROOMS):
        rooms.append({
            "id": f"room|{k}", "roomType": types.get(room.type, room.type.capitalize()),
            "floorPolygon": [{"x": x, "y": 0, "z": -z} for x, z in _ring(room)], "children": [],
        })  # fmt: skip
        ring = _ring(room)
        walls += [_unity_wall(f"wall|{k}|{j}", ring[j], ring[(j + 1) % 4]) for j in range(4)]
    doors, windows = [], []
    for k, hole in enumerate(HOLES):
        number = next(j for j in range(4) if _lies_on(hole.at, _ring(ROOMS[hole.rooms[0]]), j))
        a = _ring(ROOMS[hole.rooms[0]])[number]
        along, half = math.dist(a, hole.at), hole.width / 2
        low, high = (0.9, 2.3) if hole.kind == "window" else (0.0, 2.05)
        row = {
            "id": f"{hole.kind}|{k}", "assetId": "Window_1" if hole.kind == "window" else "Doorway_1",
            "wall0": f"wall|{hole.rooms[0]}|{number}",
            "wall1": f"wall|exterior|{k}" if len(hole.rooms) == 1 else f"wall|{hole.rooms[1]}|0",
            "holePolygon": [{"x": along - half, "y": low, "z": 0}, {"x": along + half, "y": high, "z": 0}],
        }  # fmt: skip
        (windows if hole.kind == "window" else doors).append(row)
    names = {
        "sofa": "Sofa", "coffee_table": "CoffeeTable", "tv_cabinet": "TVStand", "dining_table": "DiningTable",
        "dining_chair": "Chair", "refrigerator": "Fridge", "bed": "Bed", "nightstand": "SideTable",
        "wardrobe": "ShelvingUnit", "toilet": "Toilet", "tub": "Bathtub",
    }  # fmt: skip
    objects, assets = [], []
    for k, t in enumerate(THINGS):
        w, d, h = t.size
        assets.append({"assetId": f"{names[t.name]}_{k}", "boundingBox": {"x": w, "y": h, "z": d}})
        objects.append({
            "id": f"{names[t.name]}|1|{k}", "assetId": f"{names[t.name]}_{k}",
            "position": {"x": t.at[0], "y": t.low + h / 2, "z": -t.at[1]},
            "rotation": {"x": 0, "y": math.degrees(math.atan2(t.front[0], -t.front[1])), "z": 0},
        })  # fmt: skip
    _json(folder / "asset-database.json", {"All": assets})
    value = {"rooms": rooms, "walls": walls, "doors": doors, "windows": windows, "objects": objects,
             "proceduralParameters": {}}  # fmt: skip
    return _json(folder / "train_1.json", value)


def write_room_plan(folder: Path) -> Path:
    """A scan with column-major transforms; walls end 4 cm short of each other."""
    surfaces: dict[str, list[Any]] = {"walls": [], "doors": [], "windows": [], "openings": []}
    for a, b in _walls():
        length = math.dist(a, b) - 0.08
        surfaces["walls"].append(
            surface("wall", a, b, length, 0.0, HEIGHT) | {"completedEdges": []}
        )
    for hole in HOLES:
        ends = ((hole.at[0] - 1, hole.at[1]), (hole.at[0] + 1, hole.at[1])) if hole.along_x else (
            (hole.at[0], hole.at[1] - 1), (hole.at[0], hole.at[1] + 1))  # fmt: skip
        low, high = (0.9, 2.3) if hole.kind == "window" else (0.0, 2.05)
        key = "window" if hole.kind == "window" else "door"
        surfaces[f"{key}s"].append(surface(key, *ends, hole.width, low, high))
    names = {
        "coffee_table": "table", "tv_cabinet": "storage", "dining_table": "table", "dining_chair": "chair",
        "nightstand": "storage", "wardrobe": "storage", "tub": "bathtub",
    }  # fmt: skip
    objects = []
    for t in THINGS:
        (w, d, h), (fx, fz) = t.size, t.front
        columns = [fz, 0, -fx, 0, 0, 1, 0, 0, fx, 0, fz, 0, t.at[0], t.low + h / 2, t.at[1], 1]
        objects.append({
            "category": {names.get(t.name, t.name): {}}, "dimensions": [w, h, d],
            "transform": [float(c) for c in columns], "confidence": {"high": {}},
        })  # fmt: skip
    labels = {"living": "livingRoom", "hall": "unidentified"}
    sections = [
        {"label": labels.get(r.type, r.type), "center": [(r.box[0] + r.box[2]) / 2, 0.0, (r.box[1] + r.box[3]) / 2]}
        for r in ROOMS
    ]  # fmt: skip
    value = {
        "version": 2,
        "story": 0,
        **surfaces,
        "objects": objects,
        "sections": sections,
        "floors": [],
    }
    return _json(folder / "room.json", value)


def write_cubicasa(folder: Path) -> Path:
    """A drawing in centimetres: rooms drawn to the walls' middles, walls with their doors and windows."""
    parts = []
    types = {"living": "LivingRoom", "kitchen": "Kitchen", "hall": "Entry Lobby", "bedroom": "Bedroom",
             "bathroom": "Undefined"}  # fmt: skip
    for a, b in _walls():
        dx = dz = 0.06
        box = (
            min(a[0], b[0]) - dx,
            min(a[1], b[1]) - dz,
            max(a[0], b[0]) + dx,
            max(a[1], b[1]) + dz,
        )
        inside = "".join(_svg_hole(h) for h in HOLES if box[0] <= h.at[0] <= box[2] and box[1] <= h.at[1] <= box[3]
                         and h.along_x == (a[1] == b[1]))  # fmt: skip
        parts.append(f'<g id="Wall" class="Wall">{_svg_box(*box)}{inside}</g>')
    for room in ROOMS:
        parts.append(f'<g class="Space {types[room.type]}">{_svg_box(*room.box)}</g>')
    for name, box in (
        ("BaseCabinet", (5.2, 0.1, 7.5, 0.7)), ("Toilet", (5.15, 8.0, 5.8, 8.4)),
        ("Bathtub", (6.55, 8.2, 8.2, 8.85)),
    ):  # fmt: skip
        parts.append(
            f'<g class="FixedFurniture {name}" transform="matrix(1,0,0,1,0,0)">'
            f'<g class="BoundaryPolygon">{_svg_box(*box)}</g></g>'
        )
    path = folder / "model.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="1000" height="1000"><g id="Model" class="Model v1-1">'
        f'<g class="Floor"><g id="Floor-1" class="Floorplan Floor-1">{"".join(parts)}</g></g></g></svg>'
    )
    return path


def write_zind(folder: Path, n_floors: int = 1) -> Path:
    """Redrawn floors in units of 2.5 m, y up."""
    unit = 2.5
    rooms = {}
    labels = {"living": "living room", "bathroom": "bathroom", "hall": "hallway"}
    for k, room in enumerate(ROOMS):
        x0, z0, x1, z1 = room.box
        ring = [
            (x0 + 0.05, z0 + 0.05),
            (x1 - 0.05, z0 + 0.05),
            (x1 - 0.05, z1 - 0.05),
            (x0 + 0.05, z1 - 0.05),
        ]
        holes: dict[str, list[Any]] = {"doors": [], "windows": []}
        for h in HOLES:
            if k in h.rooms:
                dx, dz = (h.width / 2, 0.0) if h.along_x else (0.0, h.width / 2)
                ends = [
                    [(h.at[0] - dx) / unit, -(h.at[1] - dz) / unit],
                    [(h.at[0] + dx) / unit, -(h.at[1] + dz) / unit],
                ]
                holes["windows" if h.kind == "window" else "doors"].append(ends)
        rooms[f"room_{k:02d}"] = {
            "vertices": [[x / unit, -z / unit] for x, z in ring], **holes,
            "pins": [{"position": [0, 0], "label": labels.get(room.type, room.type)}],
        }  # fmt: skip
    floors = {f"floor_{k:02d}": rooms for k in range(1, n_floors + 1)}
    value = {"redraw": floors, "scale_meters_per_coordinate": dict.fromkeys(floors, unit)}
    return _json(folder / "zind_data.json", value)


def write_blueprint3d(folder: Path, *, per_metre: float = 100.0) -> Path:
    """A home of blueprint3d: corners, walls and items in centimetres, or corners in metres."""
    points = [p for wall in _walls() for p in wall] + [tuple(p) for r in ROOMS for p in _ring(r)]
    names = {p: f"{k:08x}-9e0e" for k, p in enumerate(dict.fromkeys(points))}
    corners = {name: {"x": x * per_metre, "y": z * per_metre} for (x, z), name in names.items()}
    paper = {"url": "rooms/textures/wallmap.png", "stretch": True, "scale": 0}
    walls = [{"corner1": names[a], "corner2": names[b], "frontTexture": paper} for a, b in _walls()]
    items = [
        {"item_name": "Window" if h.kind == "window" else "Closed Door",
         "item_type": 3 if h.kind == "window" else 7, "xpos": h.at[0] * 100, "zpos": h.at[1] * 100,
         "ypos": 150 if h.kind == "window" else 110.8, "rotation": 0,
         "scale_x": h.width / (1.0 if h.kind == "window" else 0.9)}
        for h in HOLES
    ]  # fmt: skip
    items.append({"item_name": "Full Bed", "item_type": 1, "xpos": 120, "ypos": 45, "zpos": 130,
                  "rotation": -1.5707963, "scale_x": 1, "scale_y": 1, "scale_z": 1})  # fmt: skip
    rooms = {
        ",".join(names[tuple(p)] for p in _ring(room)): {"name": room.type.capitalize()}
        for room in ROOMS
    }
    plan = {"corners": corners, "walls": walls, "rooms": rooms, "wallTextures": []}
    return _json(folder / "plan.json", {"floorplan": plan, "items": items})


def write_react_planner(folder: Path) -> Path:
    """A drawing in centimetres, y up, walls by their vertices."""
    points: dict[tuple[float, float], str] = {}
    for room in ROOMS:
        for x, z in _ring(room):
            points.setdefault((x, z), f"v{len(points)}")
    lines, holes = {}, {}
    for k, (a, b) in enumerate(_walls()):
        for p in (a, b):
            points.setdefault(p, f"v{len(points)}")
        on = [h for h in HOLES if h.along_x == (a[1] == b[1]) and _between(h.at, a, b)]
        lines[f"l{k}"] = {
            "id": f"l{k}", "type": "wall", "vertices": [points[a], points[b]],
            "holes": [f"h{HOLES.index(h)}" for h in on],
            "properties": {"height": {"length": HEIGHT * 100}, "thickness": {"length": 20}},
        }  # fmt: skip
        for h in on:
            kind = {"window": "window", "entrance": "entrance_door"}.get(h.kind, "door")
            holes[f"h{HOLES.index(h)}"] = {
                "type": kind, "line": f"l{k}", "offset": math.dist(a, h.at) / math.dist(a, b),
                "properties": {"width": {"length": h.width * 100}, "altitude": {"length": 90 if h.kind == "window" else 0},
                               "height": {"length": 140 if h.kind == "window" else 205}},
            }  # fmt: skip
    names = {"sofa": "sofa", "bed": "bed", "toilet": "toilet", "tub": "bathtub", "refrigerator": "fridge",
             "dining_table": "table", "wardrobe": "wardrobe"}  # fmt: skip
    items = {
        f"i{k}": {
            "type": names[t.name], "x": t.at[0] * 100, "y": -t.at[1] * 100,
            "rotation": math.degrees(math.atan2(t.front[0], t.front[1])),
            "properties": {"width": {"length": t.size[0] * 100}, "depth": {"length": t.size[1] * 100},
                           "height": {"length": t.size[2] * 100}},
        }
        for k, t in enumerate(THINGS) if t.name in names
    }  # fmt: skip
    areas = {
        f"a{k}": {
            "name": r.type.capitalize(),
            "vertices": [points[x, z] for x, z in map(tuple, _ring(r))],
        }
        for k, r in enumerate(ROOMS)
    }
    vertices = {name: {"id": name, "x": x * 100, "y": -z * 100} for (x, z), name in points.items()}
    layer = {"id": "layer-1", "altitude": 0, "vertices": vertices, "lines": lines, "holes": holes, "areas": areas, "items": items}  # fmt: skip
    value = {"unit": "cm", "layers": {"layer-1": layer}, "width": 3000, "height": 2000}
    return _json(folder / "home.json", value)


WRITERS: Final[dict[str, Callable[[Path], Path]]] = {
    "own": write_own, "geojson": write_geojson, "swiss": write_swiss, "spatiallm": write_spatial_lm,
    "procthor": write_procthor, "roomplan": write_room_plan, "cubicasa": write_cubicasa, "zind": write_zind,
    "react-planner": write_react_planner,
    "blueprint3d": write_blueprint3d,
}  # fmt: skip
TELLING: Final = ("swiss", "spatiallm", "procthor", "roomplan", "cubicasa", "react-planner")
"""Formats with furniture."""


def traced(value: dict[str, Any], px_per_cm: float) -> dict[str, Any]:
    """The react-planner home as if traced: pixels, outlines, an area for the scale."""
    layer = value["layers"]["layer-1"]
    points = {
        name: (v["x"] * px_per_cm, v["y"] * px_per_cm) for name, v in layer["vertices"].items()
    }
    for name, (x, y) in points.items():
        layer["vertices"][name] |= {"x": x, "y": y}
    for hole in layer["holes"].values():
        a, b = (np.array(points[n]) for n in layer["lines"][hole["line"]]["vertices"])
        along = (b - a) / np.linalg.norm(b - a)
        middle = a + hole.pop("offset") * (b - a)
        half = along * hole["properties"]["width"]["length"] * px_per_cm / 2
        across = np.array([-along[1], along[0]]) * 8
        corners = [
            middle - half - across,
            middle + half - across,
            middle + half + across,
            middle - half + across,
        ]
        hole["coordinates"] = [[c.tolist() for c in (*corners, corners[0])]]
        hole["properties"] = {
            "length": {"value": hole["properties"]["width"]["length"], "unit": "cm"},
            "width": {"value": 13, "unit": "cm"}, "altitude": {"value": 0, "unit": "cm"},
            "heights": {"lower_edge": None, "upper_edge": None},
        }  # fmt: skip
    for area in layer["areas"].values():
        area["coords"] = [[list(points[n]) for n in area.pop("vertices")]]
    layer["items"] = {}
    return value | {"scale": px_per_cm**-2}


def with_a_stub(value: dict[str, Any]) -> tuple[dict[str, Any], list[tuple[float, float]]]:
    """A ZInD home of one room with a stub of wall from above; and the room's corners.

    It is 11 cm thick and 1.2 m long; the file's ring is closed, except for rounding.
    """
    ring = [
        (0.0, 0.0),
        (5.0, 0.0),
        (5.0, 4.0),
        (2.11, 4.0),
        (2.11, 2.8),
        (2.0, 2.8),
        (2.0, 4.0),
        (0.0, 4.0),
    ]
    scale = value["scale_meters_per_coordinate"]["floor_01"]
    points = [*ring, (1e-9, 2e-9)]
    room = {"vertices": [[x / scale, -z / scale] for x, z in points]}
    return value | {"redraw": {"floor_01": {"room_00": room}}}, ring


def _json(path: Path, value: object) -> Path:
    path.write_text(json.dumps(value))
    return path


def _ring(room: SampleRoom) -> list[tuple[float, float]]:
    x0, z0, x1, z1 = room.box
    return [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]


def _own(hole: SampleHole) -> dict[str, Any]:
    return {"at": list(hole.at), "width": hole.width, "kind": hole.kind}


def _walls() -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """The middle lines of the home's walls, each once."""
    return [
        ((0.0, 0.0), (8.4, 0.0)), ((0.0, 4.0), (8.4, 4.0)), ((0.0, 5.4), (8.4, 5.4)),
        ((0.0, 9.0), (8.4, 9.0)), ((0.0, 0.0), (0.0, 9.0)), ((8.4, 0.0), (8.4, 9.0)),
        ((5.0, 0.0), (5.0, 4.0)), ((5.0, 5.4), (5.0, 9.0)),
    ]  # fmt: skip


def _between(p: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> bool:
    return abs(math.dist(a, p) + math.dist(p, b) - math.dist(a, b)) < 1e-6


def _lies_on(p: tuple[float, float], ring: list[tuple[float, float]], side: int) -> bool:
    return _between(p, ring[side], ring[(side + 1) % 4])


def _wkt(x0: float, z0: float, x1: float, z1: float) -> str:
    ring = [(x0, z0), (x1, z0), (x1, z1), (x0, z1), (x0, z0)]
    return f"POLYGON (({', '.join(f'{x + 100} {50 - z}' for x, z in ring)}))"


def _unity_wall(name: str, a: tuple[float, float], b: tuple[float, float]) -> dict[str, Any]:
    points = [(a, 0.0), (b, 0.0), (b, HEIGHT), (a, HEIGHT)]
    return {"id": name, "polygon": [{"x": p[0], "y": y, "z": -p[1]} for p, y in points]}


def surface(
    kind: str, a: tuple[float, float], b: tuple[float, float], width: float, low: float, high: float
) -> dict[str, Any]:
    ux, uz = (b[0] - a[0]) / math.dist(a, b), (b[1] - a[1]) / math.dist(a, b)
    x, z = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
    columns = [ux, 0, uz, 0, 0, 1, 0, 0, -uz, 0, ux, 0, x, (low + high) / 2, z, 1]
    category = {kind: {"isOpen": False} if kind == "door" else {}}
    return {
        "category": category,
        "dimensions": [width, high - low, 0.0],
        "transform": [float(c) for c in columns],
    }


def _svg_box(x0: float, z0: float, x1: float, z1: float) -> str:
    ring = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]
    return f'<polygon points="{" ".join(f"{100 * x:.1f},{100 * z:.1f}" for x, z in ring)}"/>'


def _svg_hole(hole: SampleHole) -> str:
    dx, dz = (hole.width / 2, 0.06) if hole.along_x else (0.06, hole.width / 2)
    name = "Window Regular" if hole.kind == "window" else "Door Swing Beside"
    x, z = hole.at
    return f'<g class="{name}">{_svg_box(x - dx, z - dz, x + dx, z + dz)}</g>'
