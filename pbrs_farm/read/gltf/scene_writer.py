"""A glTF document in memory with joints, for readers that bring other scenes to the reader of glTF. No effects.

Such readers write a joint to a node's extras; the node holds the moving part:

    {"pbrs_joint": {"part": "door 1", "kind": "revolute", "point": [0, 0, 0], "axis": [0, 1, 0],
                    "lower": 0.0, "upper": 1.57, "value": 0.5}}

Point and axis are in the node's own frame, in which the motion leaves them where they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, I64, triple
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import GlbWriter, Gltf, entry
from pbrs_farm.read.gltf.document import Placed, numbers, object_at
from pbrs_farm.read.mesh.shape import Shape

LIGHTS: Final = "KHR_lights_punctual"
Row = dict[str, Any]


def matrix_row(matrix: F64) -> list[float]:
    """The numbers of a matrix (4, 4) as glTF lists them, column by column."""
    numbers: list[float] = matrix.T.ravel().tolist()
    return numbers


class SceneWriter:
    """Collects the nodes, meshes, materials and lights of a scene. State: the parts added so far."""

    def __init__(self, file: str) -> None:
        """file: name of the scene, for messages."""
        self._file = file
        self._writer = GlbWriter()
        self._n_triangles = 0
        self.nodes: list[Row] = []
        self.meshes: list[Row] = []
        self.materials: list[Row] = []
        self.lights: list[Row] = []

    def add_node(self, node: Row, above: int) -> int:
        """The number of a new node below another."""
        self.nodes[above].setdefault("children", []).append(len(self.nodes))
        self.nodes.append(node)
        return len(self.nodes) - 1

    def add_light(self, row: Row) -> Row:
        """Keys of the node that has a new light."""
        self.lights.append(row)
        return {"extensions": {LIGHTS: {"light": len(self.lights) - 1}}}

    def add_attributes(
        self, positions: F64, normals: F64 | None, uvs: F64 | None
    ) -> dict[str, int]:
        """Attributes of a primitive, v of uvs down; normals are stored as they are."""
        add = self._writer.add_vertices
        attributes = {"POSITION": add(positions.astype(np.float32), with_bounds=True)}
        if normals is not None:
            attributes["NORMAL"] = add(normals.astype(np.float32))
        if uvs is not None:
            attributes["TEXCOORD_0"] = add(uvs.astype(np.float32))
        return attributes

    def primitive(self, attributes: dict[str, int], faces: I64, material: int | None) -> Row:
        """A primitive of some faces (F, 3)."""
        row: Row = {
            "attributes": attributes,
            "indices": self._writer.add_faces(faces.astype(np.int32)),
        }
        return row if material is None else row | {"material": material}

    def add_mesh(
        self,
        shape: Shape,
        parts: Iterable[tuple[I64, int | None]],
        place: str,
        fields: ReadFields,
        **other: str,
    ) -> int:
        """The number of a new mesh. parts: (faces, material); other: further keys.

        Raises BadHouse, naming the place, for more triangles than the recipe allows for a model or a scene.
        """
        self._n_triangles += len(shape.faces)
        for n, key in (
            (len(shape.faces), "max_model_triangles"),
            (self._n_triangles, "max_triangles"),
        ):
            most = getattr(fields, key)
            if n > most:
                text = f"more than {most} triangles"
                raise BadHouse(self._file, place, text, hint=f"limit: read.{key}")
        normals = None if shape.normals is None else unit_vectors(shape.normals)
        attributes = self.add_attributes(shape.positions, normals, shape.uvs)
        primitives = [self.primitive(attributes, faces, number) for faces, number in parts]
        self.meshes.append({**other, "primitives": primitives})
        return len(self.meshes) - 1

    def gltf(self, root: int, extras: Row | None = None, **lists: list[Row]) -> Gltf:
        """The document of the scene below a node. extras: of the scene; lists: textures, images, samplers."""
        document = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [root]} | ({"extras": extras} if extras else {})],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "extensions": {LIGHTS: {"lights": self.lights}} if self.lights else {},
            **lists,
        }
        return self._writer.gltf(document, self._file)


KEY: Final = "pbrs_joint"
_LEAST: Final = 1e-3  # radians or metres; what moves less is fixed


def joint_row(
    part: str, kind: JointKind, point: Any, axis: Any, limits: tuple[float, float], value: float
) -> dict[str, Any]:
    """Joint description for a node's extras, under KEY.

    limits: minimum and maximum value, radians or metres. A joint that opens to the negative side is
    inverted, so that it opens from 0 to its maximum.
    """
    lower, upper = limits
    axis = np.asarray(axis, np.float64)
    if abs(lower) > abs(upper):
        lower, upper, value, axis = -upper, -lower, -value, -axis
    return {
        "part": part,
        "kind": kind.value,
        "point": [float(x) for x in point],
        "axis": axis.tolist(),
        "lower": float(lower),
        "upper": float(upper),
        "value": float(value),
    }


def joints_of_parts(gltf: Gltf, parts: Sequence[Placed]) -> dict[tuple[int, ...], Joint]:
    """The joint of each node of an item, in the world frame, by the node's path.

    parts: of one item, parents first. Nodes below a moving part belong to that part: only motion
    relative to the body counts. Raises BadHouse for invalid numbers.
    """
    joints: dict[tuple[int, ...], Joint] = {}
    for part in parts:
        above = joints.get(part.path[:-1])
        row = object_at(object_at(entry(gltf, "nodes", part.index), "extras"), KEY)
        joint = above or (_joint(gltf, row, part) if row else None)
        if joint is not None:
            joints[part.path] = joint
    return joints


def _joint(gltf: Gltf, row: dict[str, Any], part: Placed) -> Joint | None:
    place = f"nodes[{part.index}].extras.{KEY}"
    point = numbers(gltf, row.get("point", [0, 0, 0]), 3, f"{place}.point")
    axis = numbers(gltf, row.get("axis"), 3, f"{place}.axis")
    keys = ("lower", "upper", "value")
    lower, upper, value = numbers(gltf, [row.get(key, 0.0) for key in keys], 3, place)
    length = float(np.linalg.norm(axis))
    kinds = {kind.value: kind for kind in JointKind}
    if row.get("kind") not in kinds or upper - lower < _LEAST or length < 1e-9:
        return None
    joint = Joint(
        str(row.get("part"))[:100],
        kinds[row["kind"]],
        triple(point),
        triple(axis / length),
        float(upper),
        float(lower),
        float(value),
    )
    return joint.placed(part.world_from_node)
