"""glTF scenes built in code, like those of modelling programs; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrs_farm.core.house import House, Item
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import GlbWriter
from pbrs_farm.read.gltf.scene import Beside, read_gltf

Quad = list[list[float]]

CUBE = [
    [[1, 0, 1], [1, 0, 0], [1, 1, 0], [1, 1, 1]],
    [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
    [[0, 1, 1], [1, 1, 1], [1, 1, 0], [0, 1, 0]],
    [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
    [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    [[1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0]],
]


class Scene:
    """Collects nodes and meshes of a scene under construction."""

    def __init__(self) -> None:
        self.writer = GlbWriter()
        self.nodes: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.more: dict[str, Any] = {}

    def node(self, name: str, **more: Any) -> int:
        self.nodes.append({"name": name} | more)
        return len(self.nodes) - 1

    def mesh(self, quads: list[Quad], material: int | None = None) -> int:
        """A mesh of quads with flat normals; uv 0..1 on each."""
        p = np.array(quads, np.float32)
        n = np.cross(p[:, 1] - p[:, 0], p[:, 3] - p[:, 0])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        k = 4 * np.arange(len(p))[:, None, None]
        primitive: dict[str, Any] = {
            "attributes": {
                "POSITION": self.writer.add_vertices(p.reshape(-1, 3), with_bounds=True),
                "NORMAL": self.writer.add_vertices(np.repeat(n, 4, 0).astype(np.float32)),
                "TEXCOORD_0": self.writer.add_vertices(
                    np.tile(np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32), (len(p), 1))
                ),
            },
            "indices": self.writer.add_faces(
                (np.array([[0, 1, 2], [0, 2, 3]]) + k).reshape(-1, 3).astype(np.int32)
            ),
        }
        if material is not None:
            primitive["material"] = material
        self.meshes.append({"primitives": [primitive]})
        return len(self.meshes) - 1

    def box(self, low: list[float], high: list[float], material: int | None = None) -> int:
        """A mesh of a box with outward faces."""
        a, b = np.array(low), np.array(high)
        return self.mesh((np.array(CUBE) * (b - a) + a).tolist(), material)

    def glb(self, roots: list[int] | None = None) -> bytes:
        children = {c for n in self.nodes for c in n.get("children", [])}
        tops = [i for i in range(len(self.nodes)) if i not in children] if roots is None else roots
        return self.writer.glb(
            {
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": tops}],
                "nodes": self.nodes,
                "meshes": self.meshes,
                "materials": self.materials,
                **self.more,
            }
        )


def two_rooms() -> Scene:
    """Two rooms, 4 x 3 and 2 x 3 m, on one floor, separated by a planar wall with a door."""
    s = Scene()
    s.node("Floor", mesh=s.mesh([[[0, 0, 3], [6, 0, 3], [6, 0, 0], [0, 0, 0]]]))
    s.node("Ceiling", mesh=s.mesh([[[0, 2.6, 0], [6, 2.6, 0], [6, 2.6, 3], [0, 2.6, 3]]]))
    outer = [
        [[0, 0, 0], [6, 0, 0], [6, 2.6, 0], [0, 2.6, 0]],
        [[6, 0, 3], [0, 0, 3], [0, 2.6, 3], [6, 2.6, 3]],
        [[0, 0, 3], [0, 0, 0], [0, 2.6, 0], [0, 2.6, 3]],
        [[6, 0, 0], [6, 0, 3], [6, 2.6, 3], [6, 2.6, 0]],
    ]
    s.node("Walls outer", mesh=s.mesh(outer))
    inner = [
        [[4, 0, 3], [4, 0, 2], [4, 2.6, 2], [4, 2.6, 3]],
        [[4, 2, 2], [4, 2, 1], [4, 2.6, 1], [4, 2.6, 2]],
        [[4, 0, 1], [4, 0, 0], [4, 2.6, 0], [4, 2.6, 1]],
    ]
    s.node("Wall.001", mesh=s.mesh(inner))
    return s


def read(scene: Scene, **beside: Any) -> House:
    """The House of a scene and its sidecar files."""
    return read_gltf(scene.glb(), "scene.glb", fields=ReadFields(), beside=Beside(**beside))


def item(house: House, name: str) -> Item:
    """The item of that name."""
    return next(i for i in house.items if i.name == name)


def area(polygon: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Area of an (N, 2) polygon, positive counter-clockwise."""
    x, z = polygon.T
    return float(0.5 * (x @ np.roll(z, -1) - z @ np.roll(x, -1)))
