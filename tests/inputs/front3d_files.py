"""3D-FRONT houses written in code, in the three generations in circulation. Effects: writes files."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

Generation = Literal["0.4", "0.10", "0.11", "0.11 gaps"]
GENERATIONS: tuple[Generation, ...] = ("0.4", "0.10", "0.11", "0.11 gaps")

HEIGHT = 2.7
# name: type, x0, z0, x1, z1 between the walls: .12 m inside, .24 m outside.
ROOMS: dict[str, tuple[str, float, float, float, float]] = {
    "LivingRoom-1": ("LivingDiningRoom", 0.0, 0.0, 5.0, 4.0),
    "Kitchen-2": ("Kitchen", 5.12, 0.0, 8.0, 4.0),
    "Hallway-3": ("Hallway", 0.0, 4.12, 8.0, 5.3),
    "MasterBedroom-4": ("MasterBedroom", 0.0, 5.42, 4.0, 9.0),
    "Bathroom-5": ("Bathroom", 4.12, 5.42, 6.0, 9.0),
    "SecondBedroom-6": ("SecondBedroom", 6.12, 5.42, 8.0, 9.0),
}
OUTER = (-0.24, -0.24, 8.24, 9.24)
# kind, title, middle (x, z), axis along, width, from, to, depth, direction of the door
HOLES: list[tuple[str, str, tuple[float, float], str, float, float, float, float, str]] = [
    ("Door", "door/entry/single swing door", (8.12, 4.7), "z", 1.0, 0.0, 2.1, 0.24, "outerLeft"),
    ("Door", "door/single swing door", (2.0, 4.06), "x", 0.9, 0.0, 2.1, 0.12, "innerRight"),
    ("Door", "door/double sliding door", (5.06, 2.0), "z", 1.6, 0.0, 2.1, 0.12, ""),
    ("Door", "door/single swing door", (3.2, 5.36), "x", 0.85, 0.0, 2.1, 0.12, "innerLeft"),
    ("Door", "door/single swing door", (5.0, 5.36), "x", 0.8, 0.0, 2.1, 0.12, "innerLeft"),
    ("Door", "door/single swing door", (7.0, 5.36), "x", 0.85, 0.0, 2.1, 0.12, "innerLeft"),
    ("Window", "window/floor-based window", (2.5, -0.12), "x", 2.4, 0.1, 2.3, 0.24, ""),
    ("Window", "window/window", (6.6, -0.12), "x", 1.2, 1.0, 2.2, 0.24, ""),
    ("Window", "window/window", (2.0, 9.12), "x", 1.6, 0.9, 2.3, 0.24, ""),
    ("Window", "window/window", (5.0, 9.12), "x", 0.6, 1.4, 2.1, 0.24, ""),
    ("Window", "window/window", (7.0, 9.12), "x", 1.2, 0.9, 2.3, 0.24, ""),
    ("Hole", "", (6.6, 4.06), "x", 1.2, 0.0, 2.2, 0.12, ""),
]
# jid, title, category of 3D-FUTURE, super category, (w, d, h), room, (x, z), degrees
PIECES: list[tuple[str, str, str, str, tuple[float, float, float], str, tuple[float, float], float]] = [
    ("sofa", "sofa/ multi seat sofa", "Three-Seat / Multi-seat Sofa", "Sofa", (2.1, 0.9, 0.8), "LivingRoom-1", (1.2, 3.4), 180),
    ("coffee", "table/coffee table", "Coffee Table", "Table", (1.1, 0.6, 0.42), "LivingRoom-1", (1.2, 2.2), 0),
    ("tv", "media unit/floor-based media unit", "TV Stand", "Cabinet/Shelf/Desk", (1.5, 0.4, 0.5), "LivingRoom-1", (0.9, 0.4), 0),
    ("table", "table/dining table", "Dining Table", "Table", (1.4, 0.8, 0.75), "LivingRoom-1", (3.7, 1.6), 90),
    ("chair", "chair/chair", "Dining Chair", "Chair", (0.48, 0.52, 0.9), "LivingRoom-1", (3.0, 1.6), 90),
    ("chair", "chair/chair", "Dining Chair", "Chair", (0.48, 0.52, 0.9), "LivingRoom-1", (4.4, 1.6), -90),
    ("pendant", "lighting/pendant light", "Pendant Lamp", "Lighting", (0.5, 0.5, 0.4), "LivingRoom-1", (3.7, 1.6), 0),
    ("chest", "storage unit/dresser", "Drawer Chest / Corner cabinet", "Cabinet/Shelf/Desk", (0.9, 0.45, 0.85), "LivingRoom-1", (4.6, 3.6), 180),
    ("bed", "bed/king-size bed", "King-size Bed", "Bed", (1.9, 2.1, 1.0), "MasterBedroom-4", (1.6, 7.9), 180),
    ("night", "table/night table", "Nightstand", "Cabinet/Shelf/Desk", (0.5, 0.42, 0.5), "MasterBedroom-4", (0.35, 8.75), 180),
    ("night", "table/night table", "Nightstand", "Cabinet/Shelf/Desk", (0.5, 0.42, 0.5), "MasterBedroom-4", (2.85, 8.75), 180),
    ("wardrobe", "storage unit/armoire", "Wardrobe", "Cabinet/Shelf/Desk", (1.8, 0.6, 2.2), "MasterBedroom-4", (3.65, 7.5), -90),
    ("ceiling", "lighting/ceiling light", "Ceiling Lamp", "Lighting", (0.5, 0.5, 0.12), "MasterBedroom-4", (2.0, 7.0), 0),
    ("kids", "bed/single bed", "Single bed", "Bed", (1.0, 2.0, 0.8), "SecondBedroom-6", (6.7, 7.9), 180),
    ("desk", "table/table", "Desk", "Table", (0.9, 0.5, 0.75), "SecondBedroom-6", (7.7, 6.6), -90),
    ("toilet", "toilet/floor-based toilet", "", "", (0.4, 0.65, 0.75), "Bathroom-5", (4.5, 8.6), 180),
    ("basin", "basin/floor-based single basin with cabinet", "", "", (0.7, 0.48, 0.85), "Bathroom-5", (4.4, 7.0), 90),
    ("fridge", "appliance/refrigerator", "", "", (0.65, 0.65, 1.8), "Kitchen-2", (7.6, 3.5), 180),
    ("socket", "electric/switch - single switch", "", "", (0.08, 0.02, 0.08), "Kitchen-2", (5.2, 0.1), 0),
]  # fmt: skip
N_DRAWN = len(PIECES) - 1  # a switch has no model


class _Writer:
    def __init__(self, generation: Generation) -> None:
        self.generation = generation
        self.meshes: list[dict[str, Any]] = []
        self.children: dict[str, list[dict[str, Any]]] = {
            name: [] for name in (*ROOMS, "OtherRoom-0")
        }

    def mesh(self, kind: str, triangles: Any, room: str, material: str) -> None:
        corners = np.asarray(triangles, np.float64).reshape(-1, 3)
        n = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
        normals = np.repeat(n, 3, 0)
        if self.generation == "0.4" and kind == "Ceiling":
            normals = corners + 1
        uid = f"{len(self.meshes)}/mesh"
        self.meshes.append({
            "uid": uid, "type": kind, "xyz": corners.ravel().tolist(), "normal": normals.ravel().tolist(),
            "uv": corners[:, [0, 2]].ravel().tolist() if kind in ("Floor", "Ceiling") else None,
            "faces": list(range(len(corners))), "material": material, "instanceid": "", "constructid": "",
        })  # fmt: skip
        self.child(uid, room, [0, 0, 0])

    def child(
        self, ref: str, room: str, pos: list[float], turn_deg: float = 0.0, scale: Any = (1, 1, 1)
    ) -> None:
        half = np.radians(turn_deg) / 2
        rot = [0.0, float(np.sin(half)), 0.0, float(np.cos(half))]
        self.children[room].append(
            {"ref": ref, "instanceid": ref, "pos": pos, "rot": rot, "scale": list(scale)}
        )


def front_house(generation: Generation = "0.11", *, picture_jid: str = "") -> dict[str, Any]:
    """A furnished flat of six rooms, twelve openings and 19 pieces in one generation's schema."""
    w = _Writer(generation)
    for name, (_, x0, z0, x1, z1) in ROOMS.items():
        ends = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]
        for k in range(4):
            w.mesh(
                "WallInner", wall_face(ends[k], ends[(k + 1) % 4], flip=k % 2 == 1), name, "paint"
            )
        w.mesh("Floor", level_face(x0, z0, x1, z1, 0.0, up=True), name, "floor")
        up = generation == "0.4"
        w.mesh("Ceiling", level_face(x0, z0, x1, z1, HEIGHT, up=up), name, "white")
    x0, z0, x1, z1 = OUTER
    ends = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]
    for k in range(4):
        w.mesh("WallOuter", wall_face(ends[k], ends[(k + 1) % 4]), "OtherRoom-0", "paint")
    w.mesh("SlabTop", level_face(x0, z0, x1, z1, HEIGHT + 0.1, up=True), "OtherRoom-0", "white")
    w.mesh("Baseboard", level_face(0.01, 0.01, 4.9, 0.03, 0.08, up=True), "LivingRoom-1", "white")
    furniture: list[dict[str, Any]] = []
    doors: list[dict[str, Any]] = []
    for k, hole in enumerate(HOLES):
        _add_hole(w, k, hole, furniture, doors)
    for k, (jid, title, category, _, (width, depth, height), room, (x, z), turn) in enumerate(
        PIECES
    ):
        y = {"pendant": 1.9, "ceiling": HEIGHT - height}.get(jid, 0.0)
        uid = f"piece{k}/model"
        furniture.append({
            "uid": uid, "jid": f"jid-{jid}", "title": "" if generation == "0.4" else title, "valid": True,
            "category": category if generation != "0.4" and not title else "", "size": [width, depth, height],
            "bbox": [width, depth, height],
        })  # fmt: skip
        # The second night table is mirrored.
        scale = (-1, 1, 1) if k == 10 else (1, 1, 1)
        w.child(uid, room, [x, y, z], turn, scale)
    w.child("99999/model", "LivingRoom-1", [1, 0, 1])
    for k in range(3):
        w.child("spot7/model", "Hallway-3", [2.0 + 2 * k, HEIGHT, 4.7])
    lights = [{
        "nodeType": "FurnitureSpotLight", "type": 0, "instanceid": "spot7", "color_temperature": 4000,
        "multiplier": 30, "units": 0, "src_position": [0, 0, 0], "direction": [0, -1, 0],
    }]  # fmt: skip
    rooms = [
        {
            "type": kind,
            "instanceid": name,
            "empty": 0,
            "children": w.children[name],
            "pos": [0, 0, 0],
        }
        for name, (kind, *_rest) in ROOMS.items()
    ]
    rooms.append(
        {
            "type": "OtherRoom",
            "instanceid": "OtherRoom-0",
            "empty": 1,
            "children": w.children["OtherRoom-0"],
        }
    )
    if generation != "0.4":
        for room, (_, x0, z0, x1, z1) in zip(rooms, ROOMS.values(), strict=False):
            room["size"] = (x1 - x0) * (z1 - z0)
    materials = [
        {"uid": "paint", "jid": "", "texture": "", "color": [232, 226, 214, 255], "useColor": True},
        {"uid": "white", "jid": "", "texture": "", "color": [245, 245, 245, 255], "useColor": True},
        {"uid": "floor", "jid": picture_jid, "texture": "https://img.invalid/a.jpg", "color": [176, 138, 94, 255],
         "UVTransform": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    ]  # fmt: skip
    return {
        "uid": "0003d406", "version": "2.0", "code_version": generation.split()[0], "furniture": furniture,
        "mesh": w.meshes, "material": materials, "lights": lights, "extension": {"door": doors},
        "scene": {"ref": "s", "pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1], "room": rooms},
    }  # fmt: skip


def _add_hole(
    w: _Writer, k: int, hole: tuple[str, str, tuple[float, float], str, float, float, float, float, str],
    furniture: list[dict[str, Any]], doors: list[dict[str, Any]],
) -> None:  # fmt: skip
    kind, title, (x, z), axis, width, low, high, depth, direction = hole
    refs = []
    half = np.array([width, depth]) / 2 if axis == "x" else np.array([depth, width]) / 2
    a, b = np.array([x, z]) - half, np.array([x, z]) + half
    if w.generation != "0.11 gaps":
        uid = f"{len(w.meshes)}/mesh"
        w.mesh(kind, jambs(a, b, axis, low, high), room_at(x, z, axis), "white")
        refs.append(uid)
        if w.generation in ("0.4", "0.10") and low == 0.0:
            w.mesh(
                kind, level_face(a[0], a[1], b[0], b[1], 0.0, up=True), room_at(x, z, axis), "white"
            )
    if title and w.generation != "0.4":
        uid = f"hole{k}/model"
        furniture.append(
            {"uid": uid, "jid": "", "title": title, "size": [width, depth, high - low]}
        )
        w.child(uid, room_at(x, z, axis), [x, low, z], 0.0 if axis == "x" else 90.0)
        refs.append(uid)
    if kind == "Door":
        kind_of_door = "entryDoor" if "entry" in title else "interiorDoor"
        doors.append({"type": kind_of_door, "roomId": "", "dir": direction, "ref": refs})


def room_at(x: float, z: float, axis: str) -> str:
    """Name of the room beside a hole."""
    for name, (_, x0, z0, x1, z1) in ROOMS.items():
        if x0 - 0.3 < x < x1 + 0.3 and z0 - 0.3 < z < z1 + 0.3:
            return name
    raise ValueError(f"no room at {x}, {z}, {axis}")


def tile_walls(house: dict[str, Any], rooms: tuple[str, ...]) -> dict[str, Any]:
    """The house with each wall of some rooms as two meshes: its tiles, and the grout between."""
    of_room = {
        child["ref"]: room for room in house["scene"]["room"] for child in room["children"]
    }  # fmt: skip
    meshes: list[dict[str, Any]] = []
    for mesh in house["mesh"]:
        room = of_room.get(mesh["uid"])
        if mesh["type"] != "WallInner" or room is None or room["instanceid"] not in rooms:
            meshes.append(mesh)
            continue
        corners = np.reshape(mesh["xyz"], (-1, 3))
        a, b = corners[:, [0, 2]].min(0), corners[:, [0, 2]].max(0)
        room["children"] = [c for c in room["children"] if c["ref"] != mesh["uid"]]
        for part in ("tiles", "grout"):
            uid = f"{mesh['uid']}/{part}"
            xyz = wall_face(tuple(a), tuple(b), part=part).reshape(-1, 3)
            row = {"uid": uid, "xyz": xyz.ravel().tolist(), "faces": list(range(len(xyz)))}
            meshes.append({**mesh, **row, "normal": None, "material": part})
            place = {"pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1]}
            room["children"].append({"ref": uid, "instanceid": uid, **place})
    materials = [
        {"uid": "tiles", "color": [20, 90, 160, 255], "useColor": True},
        {"uid": "grout", "color": [200, 200, 200, 255], "useColor": True},
    ]
    return {**house, "mesh": meshes, "material": [*house["material"], *materials]}


_TILE_M, _JOINT_M = (0.6, 0.3), 0.004


def wall_face(
    a: tuple[float, float], b: tuple[float, float], *, flip: bool = False, part: str = ""
) -> Any:
    """The triangles of a wall's face between two corners, minus its holes.

    part: only "tiles" or "grout" of a tiled wall, "" = a plain one.
    """
    along = "x" if a[1] == b[1] else "z"
    k, across = (0, a[1]) if along == "x" else (1, a[0])
    low, high = sorted((a[k], b[k]))
    gaps = []
    for _, _, middle, axis, width, y0, y1, depth, _dir in HOLES:
        is_here = axis == along and abs(middle[1 - k] - across) < depth / 2 + 0.02
        if is_here and low < middle[k] < high:
            gaps.append((middle[k] - width / 2, middle[k] + width / 2, y0, y1))
    ss = sorted({low, high, *(g[0] for g in gaps), *(g[1] for g in gaps)})
    ys = sorted({0.0, HEIGHT, *(g[2] for g in gaps), *(g[3] for g in gaps)})
    if part:
        ss, ys = (
            sorted({*lines, *(v for v in _joints(lines[0], lines[-1], size) if v < lines[-1])})
            for lines, size in zip((ss, ys), _TILE_M, strict=True)
        )
    triangles = []
    for s0, s1 in pairwise(ss):
        for y0, y1 in pairwise(ys):
            s, y = (s0 + s1) / 2, (y0 + y1) / 2
            if any(g[0] < s < g[1] and g[2] < y < g[3] for g in gaps):
                continue
            in_joint = _is_joint(s - low, _TILE_M[0]) or _is_joint(y, _TILE_M[1])
            if part and in_joint != (part == "grout"):
                continue
            p = [
                [v, h, across] if along == "x" else [across, h, v]
                for v, h in ((s0, y0), (s1, y0), (s1, y1), (s0, y1))
            ]
            triangles += [[p[0], p[1], p[2]], [p[0], p[2], p[3]]]
    face = np.array(triangles)
    return face[:, ::-1] if flip else face


def _joints(low: float, high: float, size: float) -> list[float]:
    """Edges of the joints between tiles of a size."""
    return [
        low + k * size + side * _JOINT_M
        for k in range(int((high - low) / size) + 1)
        for side in ((1,) if k == 0 else (-1, 1))
    ]


def _is_joint(at: float, size: float) -> bool:
    return abs(at - size * round(at / size)) < _JOINT_M


def level_face(
    x0: float, z0: float, x1: float, z1: float, y: float, *, up: bool, n: int = 2
) -> Any:
    side = max(int(np.sqrt(n / 2)), 1)
    xs, zs = np.linspace(x0, x1, side + 1), np.linspace(z0, z1, side + 1)
    a, b = np.meshgrid(np.arange(side), np.arange(side))
    a, b = a.ravel(), b.ravel()
    corner = [
        np.stack([xs[a + i], np.full(len(a), y), zs[b + j]], -1)
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    ]
    face = np.concatenate([np.stack(corner[:3], 1), np.stack([corner[0], corner[2], corner[3]], 1)])
    return face if up else face[:, ::-1]


def jambs(a: Any, b: Any, axis: str, low: float, high: float) -> Any:
    """The two sides and the lintel of a hole, and a sill if it is above the floor."""
    quads = [
        [[a[0], low, a[1]], [b[0], low, a[1]], [b[0], high, a[1]], [a[0], high, a[1]]],
        [[a[0], low, b[1]], [b[0], low, b[1]], [b[0], high, b[1]], [a[0], high, b[1]]],
    ] if axis == "z" else [
        [[a[0], low, a[1]], [a[0], low, b[1]], [a[0], high, b[1]], [a[0], high, a[1]]],
        [[b[0], low, a[1]], [b[0], low, b[1]], [b[0], high, b[1]], [b[0], high, a[1]]],
    ]  # fmt: skip
    for y in (high, low) if low > 0 else (high,):
        quads.append([[a[0], y, a[1]], [b[0], y, a[1]], [b[0], y, b[1]], [a[0], y, b[1]]])
    return np.array([[q[i] for i in t] for q in quads for t in ((0, 1, 2), (0, 2, 3))])


def write_house(
    folder: Path, generation: Generation = "0.11", *, with_models: bool = True, picture: bytes | None = None,
    n_triangles: int = 0,
) -> Path:  # fmt: skip
    """Write 3D-FRONT/<uid>.json with 3D-FUTURE-model, and with 3D-FRONT-texture if a picture is given.

    n_triangles: total of all models.
    """
    place = folder / "3D-FRONT"
    place.mkdir(parents=True, exist_ok=True)
    jid = "jid-oak" if picture is not None else ""
    path = place / "0003d406.json"
    path.write_text(json.dumps(front_house(generation, picture_jid=jid)))
    if picture is not None:
        texture = folder / "3D-FRONT-texture" / jid / "texture.png"
        texture.parent.mkdir(parents=True, exist_ok=True)
        texture.write_bytes(picture)
    if with_models:
        write_models(folder / "3D-FUTURE-model", n_triangles // len(PIECES))
    return path


def write_models(folder: Path, n_triangles: int = 0) -> None:
    """Write an OBJ with a shadow card for each piece, n_triangles in all, and model_info.json."""
    info = []
    for jid, _, category, above, size, *_rest in PIECES:
        place = folder / f"jid-{jid}"
        place.mkdir(parents=True, exist_ok=True)
        (place / "raw_model.obj").write_text(_obj(size, n_triangles))
        (place / "model.mtl").write_text(
            "newmtl paint\nKd 0.5 0.4 0.3\nKe 9 9 9\nnewmtl shadow\nKd 0 0 0\n"
        )
        info.append(
            {
                "model_id": f"jid-{jid}",
                "category": category or None,
                "super-category": above or None,
            }
        )
    (folder / "model_info.json").write_text(json.dumps(info))


def _obj(size: tuple[float, float, float], n_triangles: int = 0) -> str:
    """Two boxes with their origin at the bottom's middle; the front one is lower, which marks the front."""
    width, depth, height = size
    boxes = [
        ((-width / 2, 0, -depth / 2), (width / 2, height, 0)),
        ((-width / 2, 0, 0), (width / 2, height / 2, depth / 2)),
    ]
    lines, n = ["mtllib model.mtl", "usemtl paint"], 0
    # Each of the twelve sides is a grid of quads.
    side = max(1, round((n_triangles / 24) ** 0.5))
    steps = np.linspace(0.0, 1.0, side + 1)
    for low, high in boxes:
        corners = np.array([[(high if k >> i & 1 else low)[i] for i in range(3)] for k in range(8)])
        for quad in (
            (0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6),
        ):  # fmt: skip
            a, b, c, d = corners[list(quad)]
            for u in steps:
                for v in steps:
                    point = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * c)
                    lines.append("v " + " ".join(f"{x:g}" for x in point))
            for i in range(side):
                for j in range(side):
                    k = n + i * (side + 1) + j + 1
                    lines.append(f"f {k} {k + side + 1} {k + side + 2} {k + 1}")
            n += (side + 1) ** 2
    lines += [
        "usemtl shadow",
        *(
            f"v {x:g} 0 {z:g}"
            for x, z in (
                (-width / 2, -depth / 2),
                (width / 2, -depth / 2),
                (width / 2, depth / 2),
                (-width / 2, depth / 2),
            )
        ),
    ]
    lines.append(f"f {n + 1} {n + 2} {n + 3} {n + 4}")
    return "\n".join(lines) + "\n"
