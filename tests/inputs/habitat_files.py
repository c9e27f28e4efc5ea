"""A Habitat data set written in code, in HSSD-hab's layout. Effects: writes files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.formats.glb import GlbWriter
from tests.inputs.front3d_files import (
    HEIGHT,
    HOLES,
    OUTER,
    PIECES,
    ROOMS,
    jambs,
    level_face,
    room_at,
    wall_face,
)
from tests.inputs.scenestate_files import model_glb

_SCENE = "102344115"
N_OPENINGS = sum(kind != "Hole" for kind, *_ in HOLES)  # a gap without a door is not listed
_LABELS = ("living room", "kitchen", "hallway", "bedroom", "bathroom", "bedroom")
# jid of a piece -> its main_category
_CATEGORIES = {
    "sofa": "couch", "coffee": "coffee table", "tv": "tv stand", "table": "table", "chair": "chair",
    "pendant": "ceiling lamp", "chest": "chest of drawers", "bed": "bed", "night": "nightstand",
    "wardrobe": "wardrobe", "ceiling": "ceiling lamp", "kids": "bed", "desk": "desk", "toilet": "toilet",
    "basin": "sink", "fridge": "refrigerator",
}  # fmt: skip


def habitat_scene(folder: Path, n_triangles: int = 300_000) -> Path:
    """The scene_instance.json of a flat of six rooms, 18 pieces, doors and windows.

    n_triangles: total of the placed objects.
    """
    written(
        folder / "hssd.scene_dataset_config.json",
        {
            "stages": {"paths": {".json": ["stages"]}},
            "objects": {"paths": {".json": ["objects/*"]}},
            "scene_instances": {"paths": {".json": ["scenes"]}},
        },
    )
    written(folder / f"stages/{_SCENE}.stage_config.json", {"render_asset": f"{_SCENE}.glb"})
    written(folder / f"stages/{_SCENE}.glb", _stage_glb())
    things = _objects()
    rows, placed = ["id,name,main_category"], []
    for k, (category, size, place, turn) in enumerate(things):
        model = f"{(k * 7 + 3) % 16:x}{k:039x}"
        path = folder / "objects" / model[0]
        written(path / f"{model}.glb", model_glb(size, n_triangles // len(things)))
        config = {
            "render_asset": f"{model}.glb", "up": [0, 1, 0], "front": [0, 0, 1], "scale": [1, 1, 1],
        }  # fmt: skip
        written(path / f"{model}.object_config.json", config)
        rows.append(f"{model},thing,{category}")
        half = np.radians(turn) / 2
        placed.append({
            "template_name": model, "translation": list(place), "motion_type": "STATIC",
            "rotation": [float(np.cos(half)), 0.0, float(np.sin(half)), 0.0],
            "non_uniform_scale": [1, 1, 1],
        })  # fmt: skip
    written(folder / "metadata/objects.csv", "\n".join(rows).encode())
    written(
        folder / f"semantics/scenes/{_SCENE}.semantic_config.json",
        {"region_annotations": _regions()},
    )
    scene = {
        "translation_origin": "COM", "stage_instance": {"template_name": f"stages/{_SCENE}"},
        "object_instances": placed, "semantic_scene_instance": _SCENE,
        "default_lighting": "", "articulated_object_instances": [],
    }  # fmt: skip
    return written(folder / f"scenes/{_SCENE}.scene_instance.json", scene)


def written(path: Path, value: Any) -> Path:
    """Write bytes or JSON to the path; returns the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(value if isinstance(value, bytes) else json.dumps(value).encode())
    return path


def _objects() -> list[tuple[str, tuple[float, float, float], tuple[float, float, float], float]]:
    """Category, (w, d, h), middle and turn of the flat's objects, including doors and windows."""
    objects = []
    for jid, _, _, _, (w, d, h), _, (x, z), turn in PIECES:
        if jid in _CATEGORIES:
            bottom = {"pendant": 1.9, "ceiling": HEIGHT - h}.get(jid, 0.0)
            objects.append((_CATEGORIES[jid], (w, d, h), (x, bottom + h / 2, z), turn))
    for kind, _, (x, z), axis, width, low, high, _, _ in HOLES:
        if kind != "Hole":
            size = (width, 0.06, high - low)
            turn = 0.0 if axis == "x" else 90.0
            objects.append((kind.lower(), size, (x, (low + high) / 2, z), turn))
    return objects


def _regions() -> list[dict[str, Any]]:
    rows = []
    for (name, (_, x0, z0, x1, z1)), label in zip(ROOMS.items(), _LABELS, strict=True):
        ring = [[x0, 0, z0], [x1, 0, z0], [x1, 0, z1], [x0, 0, z1]]
        rows.append({
            "name": name, "label": label, "poly_loop": ring, "floor_height": 0.0,
            "extrusion_height": HEIGHT,
        })  # fmt: skip
    return rows


def _stage_glb() -> bytes:
    """Single-sided faces: walls of each room and of the outside, jambs, floors, ceilings, a roof."""
    jambs_of: dict[str, list[Any]] = {name: [] for name in ROOMS}
    for _, _, (x, z), axis, width, low, high, depth, _ in HOLES:
        half = np.array([width, depth]) / 2 if axis == "x" else np.array([depth, width]) / 2
        middle = np.array([x, z])
        frame = jambs(middle - half, middle + half, axis, low, high)
        centre = np.array([x, (low + high) / 2, z])
        jambs_of[room_at(x, z, axis)].append(_facing(frame, centre))
    parts: dict[str, Any] = {}
    for k, (name, (_, x0, z0, x1, z1)) in enumerate(ROOMS.items()):
        centre = np.array([(x0 + x1) / 2, HEIGHT / 2, (z0 + z1) / 2])
        walls = [_facing(w, centre) for w in _walls(x0, z0, x1, z1)]
        parts[f"geometry_wall_{k}"] = np.concatenate(walls + jambs_of[name])
        parts[f"floor_{k}"] = level_face(x0, z0, x1, z1, 0.0, up=True)
        parts[f"ceiling_{k}"] = level_face(x0, z0, x1, z1, HEIGHT, up=False)
    outside = np.array([4.0, HEIGHT / 2, 4.5])
    faces = [_facing(w, outside)[:, ::-1] for w in _walls(*OUTER)]
    parts["geometry_wall_outer"] = np.concatenate(faces)
    parts["roof"] = level_face(*OUTER, HEIGHT + 0.1, up=True)
    writer, nodes, meshes = GlbWriter(), [], []
    for name, triangles in parts.items():
        points = np.asarray(triangles, np.float32).reshape(-1, 3)
        order = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
        position = writer.add_vertices(points, with_bounds=True)
        primitive = {"attributes": {"POSITION": position}, "indices": writer.add_faces(order)}
        nodes.append({"name": name, "mesh": len(meshes)})
        meshes.append({"primitives": [primitive]})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
    }
    return writer.glb(document | {"nodes": nodes, "meshes": meshes})


def _walls(x0: float, z0: float, x1: float, z1: float) -> list[Any]:
    ends = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]
    return [wall_face(ends[k], ends[(k + 1) % 4]) for k in range(4)]


def _facing(triangles: Any, towards: Any) -> Any:
    """(N, 3, 3) triangles, each oriented so that its front faces a point."""
    p = np.array(triangles, float)
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    away = ((towards - p[:, 0]) * normal).sum(1) < 0
    p[away] = p[away][:, ::-1]
    return p
