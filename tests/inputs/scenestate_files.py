"""sceneState files written in code, in the style of HSSD, Rent3D++ and a generator. Effects: writes files."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

HEIGHT, DEPTH, BELOW = 2.75, 0.15, 0.05
# (x0, y0, x1, y1), type: two bedrooms and a bath at the back, living and kitchen in front, a hall
# between.
ROOMS = {
    "living": ((0.0, 0.0, 5.0, 4.0), "living room"),
    "kitchen": ((5.0, 0.0, 8.0, 4.0), "kitchen"),
    "hall": ((0.0, 4.0, 8.0, 5.4), "hallway"),
    "bedroom": ((0.0, 5.4, 4.0, 9.0), "bedroom"),
    "bath": ((4.0, 5.4, 6.0, 9.0), "bathroom"),
    "study": ((6.0, 5.4, 8.0, 9.0), "office"),
}
# (start, end), rooms, holes as (type, along, up, width, height).
_WALLS: list[tuple[tuple[float, float], tuple[float, float], list[str], list[tuple[str, float, float, float, float]]]] = [
    ((0, 0), (5, 0), ["living"], [("window", 1.5, 0.9, 1.8, 1.3)]),
    ((5, 0), (8, 0), ["kitchen"], [("Window", 0.9, 1.0, 1.2, 1.2)]),
    ((8, 0), (8, 4), ["kitchen"], []),
    ((8, 4), (8, 5.4), ["hall"], [("door", 0.2, 0.0, 1.0, 2.1)]),
    ((8, 5.4), (8, 9), ["study"], [("window", 1.0, 0.9, 1.4, 1.3)]),
    ((8, 9), (6, 9), ["study"], []),
    ((6, 9), (4, 9), ["bath"], [("window", 0.7, 1.4, 0.6, 0.7)]),
    ((4, 9), (0, 9), ["bedroom"], [("window", 1.2, 0.9, 1.6, 1.3)]),
    ((0, 9), (0, 5.4), ["bedroom"], []),
    ((0, 5.4), (0, 4), ["hall"], []),
    ((0, 4), (0, 0), ["living"], []),
    ((5, 0), (5, 4), ["living", "kitchen"], [("Door", 2.5, 0.0, 0.9, 2.05)]),
    ((5, 4), (0, 4), ["living"], [("door", 1.0, 0.0, 0.9, 2.05)]),
    ((8, 4), (5, 4), ["kitchen"], []),
    ((0, 4), (8, 4), ["hall"], [("door", 3.1, 0.0, 0.9, 2.05)]),
    ((0, 5.4), (4, 5.4), ["hall", "bedroom"], [("door", 2.5, 0.0, 0.85, 2.05)]),
    ((4, 5.4), (6, 5.4), ["hall", "bath"], [("door", 0.6, 0.0, 0.8, 2.05)]),
    ((6, 5.4), (8, 5.4), ["hall", "study"], [("door", 0.6, 0.0, 0.8, 2.05)]),
    ((4, 5.4), (4, 9), ["bedroom", "bath"], []),
    ((6, 5.4), (6, 9), ["bath", "study"], []),
]  # fmt: skip
N_OPENINGS = 11  # both rooms list the door from the living room to the hall
# category, (x, y), size (w, d, h), degrees about up
_THINGS = [
    ("couch", (2.2, 0.6), (2.0, 0.9, 0.8), 180), ("table", (2.2, 1.9), (1.1, 0.6, 0.42), 0),
    ("armchair", (0.7, 2.2), (0.8, 0.8, 0.85), -90), ("tv_stand", (2.2, 3.6), (1.5, 0.4, 0.5), 0),
    ("bookshelf", (4.7, 0.8), (0.9, 0.32, 1.9), -90), ("floor lamp", (0.5, 0.5), (0.35, 0.35, 1.6), 0),
    ("refrigerator", (5.5, 0.5), (0.65, 0.65, 1.8), 180), ("counter", (7.2, 0.5), (1.2, 0.6, 0.9), 180),
    ("table", (6.6, 2.6), (1.2, 0.8, 0.75), 0), ("chair", (6.6, 1.9), (0.5, 0.5, 0.9), 180), ("chair", (6.6, 3.3), (0.5, 0.5, 0.9), 0),
    ("bed", (1.6, 7.9), (1.8, 2.05, 0.9), 0), ("nightstand", (0.4, 8.7), (0.45, 0.4, 0.5), 0), ("wardrobe", (3.6, 7.0), (1.4, 0.6, 2.1), -90),
    ("toilet", (4.4, 8.6), (0.4, 0.65, 0.75), 0), ("bathtub", (5.6, 7.9), (0.75, 1.7, 0.58), 0), ("sink", (4.4, 7.2), (0.6, 0.45, 0.85), 90),
    ("desk", (7.4, 8.2), (0.7, 1.3, 0.75), -90), ("office chair", (6.8, 8.2), (0.55, 0.55, 1.0), 90), ("rug", (2.2, 1.9), (1.8, 1.2, 0.012), 0),
]  # fmt: skip


def hssd_like(folder: Path, *, with_models: bool = True, triangles: int = 12) -> Path:
    """Six rooms, z up, walls listed for one room or two; 20 objects with models in folder/objects."""
    elements: list[dict[str, Any]] = []
    for k, (start, end, rooms, holes) in enumerate(_WALLS):
        elements.append({
            "id": f"wall_{k}", "type": "Wall", "roomId": rooms if len(rooms) > 1 else rooms[0],
            "points": [[*start, -BELOW], [*end, -BELOW]], "height": HEIGHT, "depth": DEPTH,
            "materials": [{"name": "inside", "diffuse": "#e9e2d4"}, {"name": "outside", "diffuse": "#cfd6da"}],
            "holes": [_hole(n, h) for n, h in enumerate(holes)],
        })  # fmt: skip
    for name, ((x0, y0, x1, y1), _type) in ROOMS.items():
        ring = [[x0, y0, -BELOW], [x1, y0, -BELOW], [x1, y1, -BELOW], [x0, y1, -BELOW]]
        elements.append({
            "id": f"{name}_floor", "type": "Floor", "roomId": name, "points": [ring], "depth": BELOW,
            "materials": [{"name": "surface", "diffuse": "#b08a5e"}],
        })  # fmt: skip
        elements.append({
            "id": f"{name}_ceiling", "type": "Ceiling", "roomId": name, "points": [ring],
            "offset": [0, 0, HEIGHT], "depth": 0.05,
        })  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    objects, rows = [], []
    for k, (category, (x, y), size, turn) in enumerate(_THINGS):
        model = f"{(k * 7 + 3) % 16:x}{k:039x}"
        angle = np.radians(turn)
        # Models are aligned to the scene: their front is +y.
        c, s = float(np.cos(angle)), float(np.sin(angle))
        data = [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, x, y, 0, 1]
        objects.append({
            "modelId": f"fpModel.{model}", "index": k, "parentIndex": -1,
            "transform": {"rows": 4, "cols": 4, "data": data},
        })  # fmt: skip
        dims = ",".join(f"{100 * v:.1f}" for v in size)
        rows.append((model, category, dims))
        if with_models:
            place = folder / "objects" / model[0] / f"{model}.glb"
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(model_glb(size, triangles))
    _write_table(folder / "objects.csv", rows)
    transform = {
        "alignTo": {"up": [0, 0, 1], "front": [0, 1, 0]},
        "scaleTo": 1,
        "centerTo": [0.5, 0.5, 0],
    }
    scene = {
        "version": "scene@1.0.2", "id": "hssd.102344115", "up": [0, 0, 1], "front": [0, 1, 0], "unit": 1,
        "assetSource": ["fpModel"], "assetTransforms": {"fpModel": transform}, "object": objects,
        "arch": {
            "version": "arch@1.0.2", "defaults": {"Wall": {"depth": DEPTH, "extraHeight": 0.0}}, "elements": elements,
            "rooms": [{"id": name, "types": [kind]} for name, (_, kind) in ROOMS.items()],
        },
    }  # fmt: skip
    path = folder / "102344115.scenestate.json"
    path.write_text(json.dumps({"format": "sceneState", "scene": scene}))
    return path


def rent3d_like(picture: bytes | None = None) -> dict[str, Any]:
    """Two rooms, y up as {x, y, z}, floors with an embedded picture (None: the image is missing)."""
    rooms = {"room_0": (0.0, 0.0, 4.0, 3.0), "room_1": (4.0, 0.0, 6.0, 3.0)}
    elements: list[dict[str, Any]] = []
    for name, (x0, z0, x1, z1) in rooms.items():
        ring = [[x0, 0, z0], [x1, 0, z0], [x1, 0, z1], [x0, 0, z1]]
        floor = {"name": "surface", "materialId": "Material_floor"}
        elements += [
            {"id": f"{name}_f", "type": "Floor", "roomId": name, "points": [ring], "materials": [floor], "depth": 0.05},
            {"id": f"{name}_c", "type": "Ceiling", "roomId": name, "points": [ring], "offset": [0, 2.8, 0], "depth": 0.05},
        ]  # fmt: skip
        for k in range(4):
            a, b = ring[k], ring[(k + 1) % 4]
            is_shared = a[0] == b[0] == 4.0
            holes = [_hole(0, ("Door", 1.0, 0.0, 0.9, 2.1))] if is_shared else []
            if k == 0:
                holes = [_hole(0, ("Window", 0.6, 0.9, 0.8, 1.2))]
            elements.append({
                "id": f"{name}_wall_{k}", "type": "Wall", "roomId": name, "points": [a, b], "height": 2.8, "depth": 0.1,
                "extra_height": 0.035, "holes": holes,
                "materials": [{"name": "surface1", "diffuse": "#f6deff"}, {"name": "surface2", "diffuse": "#f6deff"}],
            })  # fmt: skip
    images = []
    if picture is not None:
        url = "data:img/png;base64," + base64.b64encode(picture).decode()
        images = [{"uuid": "Image_floor", "url": url}]
    arch = {
        "id": "28025487", "elements": elements, "images": images,
        "rooms": [{"id": "room_0", "types": ["Bedroom"]}, {"id": "room_1", "types": ["Bathroom"]}],
        "materials": [{"uuid": "Material_floor", "map": "Texture_floor"}],
        "textures": [{"uuid": "Texture_floor", "image": "Image_floor"}],
    }  # fmt: skip
    axes = {"up": {"x": 0, "y": 1, "z": 0}, "front": {"x": 0, "y": 0, "z": 1}}
    return {"format": "sceneState", "scene": {**axes, "unit": 1, "arch": arch, "object": []}}


def generated() -> dict[str, Any]:
    """A generator's room: four thin walls, a floor, z up but undeclared; no ceiling, room, hole or model."""
    ring = [[0, 0, 0], [4.5, 0, 0], [4.5, 3.5, 0], [0, 3.5, 0]]
    walls = [
        {"id": f"wall|{k}", "type": "Wall", "points": [ring[k], ring[(k + 1) % 4]], "height": 2.7, "depth": 0.025}
        for k in range(4)
    ]  # fmt: skip
    floor = {"id": "floor", "type": "Floor", "points": ring, "depth": 0.05}
    objects = [
        {
            "modelId": f"objaverse.{k:032x}", "index": k, "parentIndex": k - 1,
            "transform": {"rows": 4, "cols": 4, "data": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.8 + 0.6 * k, 1.5, 0, 1]},
        }
        for k in range(5)
    ]  # fmt: skip
    return {
        "format": "sceneState",
        "scene": {
            "id": "made", "assetSource": ["objaverse"], "object": objects,
            "arch": {"elements": [*walls, floor]},
        },
    }  # fmt: skip


def _hole(n: int, hole: tuple[str, float, float, float, float]) -> dict[str, Any]:
    kind, along, up, width, height = hole
    box = {"min": [along, up], "max": [along + width, up + height]}
    return {"id": f"hole_{n}", "type": kind, "box": box}


def _write_table(path: Path, rows: list[tuple[str, str, str]]) -> None:
    """objects.csv in HSSD's layout: the id first, the category 15th."""
    head = [
        "id", "name", *(f"c{k}" for k in range(2, 13)), "aligned.dims", "main_category", "notes",
    ]  # fmt: skip
    lines = [",".join(head)]
    for model, category, dims in rows:
        lines.append(",".join([model, "thing", *[""] * 11, f'"{dims}"', category, ""]))
    path.write_text("\n".join(lines) + "\n")


def model_glb(size: tuple[float, float, float], triangles: int = 12) -> bytes:
    """A box with y up and its front at +z, centred on the origin; each face is a grid of triangles."""
    width, depth, height = size
    n = max(int(np.sqrt(triangles / 12)), 1)
    u, v = np.meshgrid(np.arange(n), np.arange(n))
    steps = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    cells = (np.stack([u, v], -1).reshape(-1, 1, 2) + steps) / n
    faces = []
    half = np.array([width, height, depth]) / 2
    for axis in range(3):
        for sign in (1.0, -1.0):
            p = np.zeros((len(cells), 4, 3))
            a, b = (axis + 1) % 3, (axis + 2) % 3
            p[..., a], p[..., b] = cells[..., 0] * 2 - 1, cells[..., 1] * 2 - 1
            p[..., axis] = sign
            faces.append(p * half if sign > 0 else p[:, ::-1] * half)
    corners = np.concatenate(faces).astype("<f4")
    k = 4 * np.arange(len(corners))[:, None]
    index = (
        np.concatenate([k + np.array(t) for t in ((0, 1, 2), (0, 2, 3))], 1)
        .reshape(-1)
        .astype("<u4")
    )
    points = corners.reshape(-1, 3)
    binary = points.tobytes() + index.tobytes()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "model"}], "buffers": [{"byteLength": len(binary)}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [0.4, 0.3, 0.25, 1], "metallicFactor": 0}}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": index.nbytes},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
             "min": points.min(0).tolist(), "max": points.max(0).tolist()},
            {"bufferView": 1, "componentType": 5125, "count": len(index), "type": "SCALAR"},
        ],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    body += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
