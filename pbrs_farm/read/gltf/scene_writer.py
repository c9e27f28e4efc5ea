"""A glTF document in memory, for readers that bring other scenes to the reader of glTF. No effects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import GlbWriter, Gltf
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
