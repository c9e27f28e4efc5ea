"""Builds small SUNCG roots in code: our own models, tables and textures. Effect: writes files.

`write_root` has every feature once; `write_large_root` has a given number of nodes.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from pbrs_farm.core.house import House, Item, Material, Surface
from tests.read.suncg.suncg_meshes import Hole, Obj, ball, mtl, slab_with_holes

HOUSE = "0123456789abcdef0123456789abcdef"
WALL_HEIGHT = 2.735
DOOR: Hole = (1.02, 1.98, 0.0, 2.08)
WINDOW: Hole = (1.52, 2.88, 0.92, 2.28)


def write_root(root: Path, *, pretty: bool = False) -> str:
    """A house of two rooms on one level and a second level; returns its id."""
    _write_models(root)
    _write_textures(root)
    _write_tables(root)
    write_room(root, "fr_0rm_0", "0_0", 0.0, 4.0, {2: WINDOW, 3: DOOR})
    write_room(root, "fr_0rm_1", "0_1", 4.095, 7.0, {0: DOOR})
    _write_ground(root, "fr_0gd_12")
    write(
        root / f"house/{HOUSE}/house.json", json.dumps(house_json(), indent=2 if pretty else None)
    )
    return HOUSE


def house_json() -> dict[str, Any]:
    """The house of write_root as SUNCG's JSON."""
    nodes = [
        room("0_0", "fr_0rm_0", [2, 3, 4, 5, 6, 9, 10, 11, 15, 16], ["Bedroom"]),
        room("0_1", "fr_0rm_1", [7, 8, 0], []) | {"hideCeiling": 1},
        object_node("0_2", "chair", placement(1, 0.05, 1)),
        object_node("0_3", "chair", placement(2, 0.05, 1, mirror=True), isMirrored=1),
        object_node("0_4", "lamp", placement(0.5, 0.05, 2.5)),
        object_node("0_5", "bare_lamp", placement(3.5, 0.05, 2.5)),
        object_node("0_6", "window", placement(2.2, 0.9, 3.05)),
        object_node("0_7", "door", placement(4.05, 0.05, 1.5, turn=1), state=1),
        object_node("0_8", "door", placement(6.0, 0.05, 1.5), state="0"),
        object_node("0_9", "plant", placement(3.5, 0.05, 0.5)),
        object_node("0_10", "nobody_has_this", placement(3, 0.05, 0.5)),
        {
            "id": "0_11", "type": "Box", "valid": 1, "transform": placement(2, 0.3, 2),
            "dimensions": [0.4, 0.5, 0.6],
            "materials": [{"name": f"side{k}", "diffuse": f"#0{k}0000"} for k in range(5)],
        },
        {"id": "0_12", "type": "Ground", "valid": 1, "modelId": "fr_0gd_12"},
        object_node("0_13", "chair", placement(1, 0.05, 2)) | {"valid": 0},
        {"id": "0_14", "type": "None"},
        object_node("0_15", "chair", placement(3, 0.05, 2, scale=1.5), materials=[
            {"name": "stone", "texture": "stone"},
            {"name": "colour", "diffuse": "#ff8000"},
            {"name": "extra", "diffuse": "#000000"},
        ]),
        object_node("0_16", "chair", placement(1, 0.05, 2, turn=1), materials=[
            {"name": "both", "texture": "leaves", "diffuse": "#808080"},
            {"name": "same"},
        ]),
    ]  # fmt: skip
    upstairs = [object_node("1_0", "person", placement(1, 2.8, 1))]
    return {
        "version": "suncg@1.0.0", "id": HOUSE, "up": [0, 1, 0], "front": [0, 0, 1],
        "scaleToMeters": 1, "bbox": {"min": [0, 0, 0], "max": [7, 5, 3]},
        "levels": [{"id": "0", "nodes": nodes}, {"id": "1", "nodes": upstairs}, {"id": "2", "nodes": []}],
    }  # fmt: skip


def room(node_id: str, model_id: str, members: list[int], types: list[str]) -> dict[str, Any]:
    """A Room node."""
    return {
        "id": node_id, "type": "Room", "valid": 1, "modelId": model_id, "nodeIndices": members,
        "roomTypes": types, "bbox": {"min": [0, 0, 0], "max": [1, 1, 1]},
    }  # fmt: skip


def object_node(node_id: str, model_id: str, transform: list[float], **more: Any) -> dict[str, Any]:
    """An Object node."""
    return {
        "id": node_id, "type": "Object", "valid": 1, "modelId": model_id, "transform": transform,
    } | more  # fmt: skip


def placement(
    x: float, y: float, z: float, *, turn: int = 0, mirror: bool = False, scale: float = 1.0
) -> list[float]:
    """A column-major transform: quarter turns about y, then a translation."""
    c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn % 4]
    m = np.eye(4)
    m[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.diag(
        [-1.0 if mirror else 1, 1, 1]
    )
    m[:3, :3] *= scale
    m[:3, 3] = x, y, z
    return [float(v) for v in m.T.reshape(-1)]


def write(path: Path, content: str | bytes) -> None:
    """Write a file and its parent folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)


def picture(rgb: tuple[int, ...], kind: str) -> bytes:
    """A 4 x 4 picture of one colour; with four components its lower half is transparent."""
    image = Image.new("RGBA" if len(rgb) == 4 else "RGB", (4, 4), rgb)
    if len(rgb) == 4:
        image.paste((0, 0, 0, 0), (0, 2, 4, 4))
    buffer = io.BytesIO()
    image.save(buffer, kind)
    return buffer.getvalue()


def _write_textures(root: Path) -> None:
    write(root / "texture/wood.jpg", picture((120, 80, 40), "JPEG"))
    write(root / "texture/stone.png", picture((90, 90, 95), "PNG"))
    write(root / "texture/stone.jpg", picture((255, 0, 0), "JPEG"))
    write(root / "texture/leaves.png", picture((20, 160, 30, 255), "PNG"))
    write(root / "texture/wallp_1_1.jpg", picture((230, 220, 200), "JPEG"))
    write(root / "texture/wallp_0.jpg", picture((255, 255, 255), "JPEG"))
    write(root / "texture/broken.jpg", picture((255, 255, 255), "JPEG")[:200])


def _write_models(root: Path) -> None:
    for name, (obj, materials) in _models().items():
        folder = name.removesuffix("_0")
        write(root / f"object/{folder}/{name}.obj", obj.text())
        if materials:
            write(root / f"object/{folder}/{folder}.mtl", mtl(*materials))


def _models() -> dict[str, tuple[Obj, list[dict[str, str]]]]:
    wood = {"name": "material_0", "Ka": "0 0 0", "Kd": "0.64 0.64 0.64", "Ks": ".1 .1 .1", "Ns": "30",
            "d": "1", "illum": "2", "map_Kd": "../../texture//wood.jpg"}  # fmt: skip
    blue = {"name": "material_1", "Kd": "0.1 0.2 0.9", "Ks": "0 0 0", "Ns": "0", "d": "1"}
    glass = {"name": "material_1", "Kd": "0.8 0.9 1", "d": "0.5"}
    missing = {"name": "material_2", "Kd": "0.5 0.4 0.3", "map_Kd": "../../texture/gone.jpg"}
    broken = {"name": "material_0", "Kd": "0.2 0.3 0.4", "map_Kd": "../../texture/broken.jpg"}
    chair = _boxes(
        "chair", [((-0.2, 0, -0.2), (0.2, 0.45, 0.2)), ((-0.2, 0.45, -0.2), (0.2, 1, -0.15))]
    )
    chair.lines.append("f 1/1/1 1/1/1 2/2/2")  # zero area
    lamp = _boxes("lamp", [((-0.05, 0, -0.05), (0.05, 1.4, 0.05))])
    lamp.begin(material="material_1")
    lamp.box((-0.23, 1.5, -0.03), (-0.17, 1.6, 0.03))
    lamp.box((0.17, 1.5, -0.03), (0.23, 1.6, 0.03))
    lamp.begin(material="material_2")
    lamp.box((-0.4, 1.4, -0.2), (0.4, 1.7, 0.2))
    frame = [((-0.7, 0, -0.05), (-0.6, 1.4, 0.05)), ((0.6, 0, -0.05), (0.7, 1.4, 0.05))]
    window = _boxes("window", frame)
    window.begin(material="material_1")
    window.box((-0.6, 0, -0.005), (0.6, 1.4, 0.005))
    opened = _boxes(
        "door", [((-0.5, 0, -0.05), (-0.45, 2.1, 0.9)), ((0.45, 0, -0.05), (0.5, 2.1, 0.05))]
    )
    closed = _boxes("door", [((-0.5, 0, -0.05), (0.5, 2.1, 0.05))])
    plant = _boxes("plant", [((-0.1, 0, -0.1), (0.1, 1, 0.1))])
    person = _boxes("person", [((-0.2, 0, -0.1), (0.2, 1.8, 0.1))])
    bare = _boxes("bare_lamp", [((-0.1, 0, -0.1), (0.1, 0.4, 0.1))])
    return {
        "chair": (chair, [wood, blue]),
        "lamp": (lamp, [wood, blue, missing]),
        "bare_lamp": (bare, [broken]),
        "window": (window, [wood, glass]),
        "door": (opened, [wood]),
        "door_0": (closed, []),
        "plant": (plant, [wood]),
        "person": (person, [wood]),
    }


def _boxes(name: str, boxes: list[Any]) -> Obj:
    """A model of boxes; box k has material_k."""
    obj = Obj(f"{name}.mtl")
    for k, (low, high) in enumerate(boxes):
        obj.begin(material=f"material_{min(k, 1) if name == 'chair' else 0}")
        obj.box(low, high)
    return obj


def _write_tables(root: Path) -> None:
    rows = [
        ("chair", "office_chair", "chair", "2", "chair", "1"),
        ("lamp", "floor_lamp", "lamp", "2", "lamp", "1"),
        ("bare_lamp", "table_lamp", "lamp", "2", "lamp", "1"),
        ("window", "window", "window", "2", "window", "1"),
        ("door", "door", "door", "2", "door", "1"),
        ("plant", "potted_plant", "plant", "2", "otherprop", "0"),
        ("person", "person", "person", "2", "person", "0"),
        ("column", "column", "column", "1", "wall", "1"),
    ]
    head = (
        "index,model_id,fine_grained_class,coarse_grained_class,empty_struct_obj,"
        "nyuv2_40class,wnsynsetid,wnsynsetkey,active"
    )
    lines = [f"{i},{m},{f},{c},{e},{n},,,{a}" for i, (m, f, c, e, n, a) in enumerate(rows)]
    write(root / "metadata/ModelCategoryMappingNewActive.csv", "\n".join([head, *lines]) + "\n")
    write(root / "metadata/models.csv", 'id,front,variantIds\ndoor,"0,0,1","door,door_0"\n')
    write(
        root / "metadata/light_geometry_compact.txt",
        "lamp 1 material_1 1 material_2\nbare_lamp 1 material_7 0\n",
    )
    write(root / "metadata/suncgModelLights.json", json.dumps({
        "lamp": [
            light("PointLight", [-0.2, 1.55, 0.0], 60),
            light("SpotLight", [0.2, 1.55, 0.0], 30) | {
                "direction": [0, -1, 0.5], "cutoffAngle": 1.57, "dropoffRate": 2,
            },
        ],
        "bare_lamp": [light("LineLight", [-0.1, 0.6, 0], 15) | {
            "position2": [0.1, 0.6, 0], "direction": [0, -1, 0], "cutoffAngle": 3.14, "dropoffRate": 1,
        }],
    }))  # fmt: skip


def light(kind: str, position: list[float], power: float) -> dict[str, Any]:
    """A row of suncgModelLights.json."""
    return {
        "type": kind, "power": power, "color": "#ffffff", "position": position,
        "attenuation": [0, 0, 1],
    }  # fmt: skip


def write_room(
    root: Path, model_id: str, node_id: str, x0: float, x1: float, holes: dict[int, Hole]
) -> None:
    """A room between x0 and x1, z 0..3, with walls, floor and ceiling as released."""
    folder = root / f"room/{HOUSE}"
    paint = {"Kd": "1 1 1", "Ks": "0.0667 0.0667 0.0667", "Ns": "30", "d": "1", "illum": "2"}
    for part, low, high, group in (("f", 0.0, 0.05, "Floor"), ("c", 2.69, 2.74, "Ceiling")):
        obj = Obj(f"{model_id}{part}.mtl")
        obj.begin(group=f"{group}#{node_id}", material="surface")
        obj.box((x0 - 0.05, low, -0.05), (x1 + 0.05, high, 3.05))
        write(folder / f"{model_id}{part}.obj", obj.text())
        look = {"name": "surface"} | paint | {"map_Kd": "../../texture/wood.jpg"}
        write(folder / f"{model_id}{part}.mtl", mtl(look))
    obj = Obj(f"{model_id}w.mtl")
    corners = [(x0, 0.0), (x0, 3.0), (x1, 3.0), (x1, 0.0)]
    # Walls in order: x0, z3 (from x0 to x1), x1 (back), z0. Columns: start, along, outward, length.
    sides = [
        (0, corners[0], (0.0, 1.0), (-1.0, 0.0), 3.0),
        (2, corners[1], (1.0, 0.0), (0.0, 1.0), x1 - x0),
        (3, corners[2], (0.0, -1.0), (1.0, 0.0), 3.0),
        (4, corners[3], (-1.0, 0.0), (0.0, -1.0), x1 - x0),
    ]
    for number, start, along, outward, length in sides:
        begin = (start[0] - 0.095 * along[0], start[1] - 0.095 * along[1])
        shifted = [(a + 0.095, b + 0.095, c, d) for k, (a, b, c, d) in holes.items() if k == number]
        for name, across, face in (
            ("Inside", (0.0, 0.05), "in"),
            ("Outside", (0.045, 0.095), "out"),
        ):
            slab_with_holes(
                obj, begin, along, outward, length + 0.19, WALL_HEIGHT, across, shifted,
                group=f"Wall{name}#{node_id}_{number}", face=face, edge="edge",
            )  # fmt: skip
    write(folder / f"{model_id}w.obj", obj.text())
    looks = [
        {"name": "in"} | paint | {"map_Kd": "../../texture/wallp_1_1.jpg"},
        {"name": "out"}
        | paint
        | {"Kd": "0.902 0.110 0.322", "map_Kd": "../../texture/wallp_0.jpg"},
        {"name": "edge"} | paint | {"Kd": "0.50196 0.50196 0.50196"},
    ]
    write(folder / f"{model_id}w.mtl", mtl(*looks))


def _write_ground(root: Path, model_id: str) -> None:
    obj = Obj(f"{model_id}f.mtl")
    obj.begin(group="Ground#0_12", material="surface")
    obj.box((-5, -0.04, -5), (12, 0.04, -1))
    write(root / f"room/{HOUSE}/{model_id}f.obj", obj.text())
    write(root / f"room/{HOUSE}/{model_id}f.mtl", mtl({"name": "surface", "Kd": "0.3 0.6 0.2"}))


def write_large_root(
    root: Path, *, n_nodes: int = 300, n_models: int = 100, detail: int = 37
) -> str:
    """One long room with n_nodes objects of n_models models of 2 detail^2 triangles; its id.

    1,400 faces per model is the mean of 29 real models (docs/spec/suncg.md section 1.5).
    """
    _write_textures(root)
    _write_models(root)
    _write_tables(root)
    length = max(10.0, n_nodes / 8)
    write_room(root, "fr_0rm_0", "0_0", 0.0, length, {2: WINDOW})
    for k in range(n_models):
        obj = Obj(f"m{k}.mtl")
        obj.begin(material="material_0")
        ball(obj, (0, 0.2, 0), 0.2, detail)
        write(root / f"object/m{k}/m{k}.obj", obj.text())
        look = {
            "name": "material_0",
            "Kd": f"{k / n_models:.3f} 0.5 0.5",
            "map_Kd": "../../texture/wood.jpg",
        }
        write(root / f"object/m{k}/m{k}.mtl", mtl(look))
    nodes = [room("0_0", "fr_0rm_0", list(range(1, n_nodes)), ["Hall"])]
    places = [
        (0.5 + (k // 5) * length * 5 / (n_nodes + 10), 0.4 + 0.5 * (k % 5)) for k in range(n_nodes)
    ]
    for k in range(1, n_nodes - 4):
        x, z = places[k]
        nodes.append(
            object_node(
                f"0_{k}", f"m{k % n_models}", placement(x, 0.05, z, turn=k, mirror=k % 7 == 0)
            )
        )
    for k, (model, x) in enumerate((("window", 2.2), ("lamp", 3), ("lamp", 6), ("lamp", 9))):
        y, z = (0.9, 3.05) if model == "window" else (0.05, 1.5)
        nodes.append(object_node(f"0_{n_nodes - 4 + k}", model, placement(x, y, z)))
    plain = house_json() | {"levels": [{"id": "0", "nodes": nodes}]}
    write(root / f"house/{HOUSE}/house.json", json.dumps(plain))
    return HOUSE


def item(house: House, item_id: str) -> Item:
    """The item of that id."""
    return next(i for i in house.items if i.id == item_id)


def material_of(house: House, item_id: str, surface: str) -> Material:
    """The material of a named surface of an item."""
    match = next(s for s in item(house, item_id).surfaces if s.name == surface)
    return house.materials[match.material]


def outward_volume(surfaces: tuple[Surface, ...]) -> float:
    """Signed volume by the divergence theorem: positive if closed faces look outwards."""
    p = np.concatenate([s.positions[s.faces] for s in surfaces]).astype(np.float64)
    return float(np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)
