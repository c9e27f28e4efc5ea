"""The models a SUNCG house is made of, parsed once each. Effect: reads OBJ and MTL of the root."""

from __future__ import annotations

import posixpath
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.frames import transform_points
from pbrs_farm.house import Surface
from pbrs_farm.read.mtl import ObjMaterial, parse_mtl
from pbrs_farm.read.notes import Notes
from pbrs_farm.read.obj import Mesh, parse_obj
from pbrs_farm.read.root_folder import RootFolder
from pbrs_farm.recipe import ReadFields

_MAX_MTL_BYTES = 4_000_000
_MIN_TWICE_AREA_M2 = 1e-12
_BYTES_PER_TRIANGLE = 150


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Meshes with their materials. slots: per mesh its material's position in mtl, -1 = unknown."""

    meshes: tuple[Mesh, ...]
    slots: tuple[int, ...]
    mtl: tuple[ObjMaterial, ...]

    @property
    def n_faces(self) -> int:
        """Triangles over all meshes."""
        return sum(len(m.faces) for m in self.meshes)


class Models:
    """Parses every model once and remembers it for the nodes that place it again."""

    def __init__(self, folder: RootFolder, notes: Notes, fields: ReadFields) -> None:
        self._folder = folder
        self._notes = notes
        self._max_triangles = fields.max_model_triangles
        self._known: dict[tuple[str, str], Model | None] = {}

    def model(self, obj_name: str, mtl_name: str) -> Model | None:
        """The model of an OBJ below the root; None if there is no such OBJ."""
        key = (obj_name, mtl_name)
        if key not in self._known:
            self._known[key] = self._parse(obj_name, mtl_name)
        return self._known[key]

    def _parse(self, obj_name: str, mtl_name: str) -> Model | None:
        data = self._folder.read(
            obj_name,
            max_bytes=self._max_triangles * _BYTES_PER_TRIANGLE,
            limit="read.max_model_triangles",
        )
        if data is None:
            return None
        meshes = parse_obj(data, obj_name, max_triangles=self._max_triangles).meshes
        mtl = self._mtl(mtl_name)
        names = {m.name: i for i, m in reversed(list(enumerate(mtl)))}
        for name in {m.material: None for m in meshes}:
            if mtl and name not in names:
                text = f"usemtl {name[:60]!r} is not in {mtl_name}; it is grey"
                self._notes.add("unknown-material", obj_name, text)
        return Model(meshes, tuple(names.get(m.material, -1) for m in meshes), mtl)

    def _mtl(self, name: str) -> tuple[ObjMaterial, ...]:
        data = self._folder.read(name, max_bytes=_MAX_MTL_BYTES)
        if data is None:
            self._notes.add("missing-materials", name, "does not exist; the model is grey")
            return ()
        at = posixpath.dirname(name)
        return tuple(
            replace(m, map_kd=self._folder.name_from(at, m.map_kd)) if m.map_kd else m
            for m in parse_mtl(data)
        )


def placed(
    mesh: Mesh, world_from_model: NDArray[np.float64], *, name: str, material: int
) -> Surface | None:
    """A mesh as a Surface in the world; None if no area is left.

    A mirroring transform turns the winding, so that fronts stay in front. Degenerate faces go.
    """
    world = transform_points(world_from_model, mesh.positions).astype(np.float32)
    faces = mesh.faces
    if np.linalg.det(world_from_model[:3, :3]) < 0:
        faces = faces[:, ::-1]
    p = world[faces].astype(np.float64)
    twice_area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    faces = faces[twice_area > _MIN_TWICE_AREA_M2]
    if not len(faces):
        return None
    return Surface(
        name=name,
        positions=world,
        faces=np.ascontiguousarray(faces),
        material=material,
        uvs=None if mesh.uvs is None else mesh.uvs.astype(np.float32),
        normals=_normals(mesh.normals, world_from_model),
    )


def _normals(
    normals: NDArray[np.float64], world_from_model: NDArray[np.float64]
) -> NDArray[np.float32] | None:
    """Unit normals by the inverse transpose, or None (flat) if one is zero."""
    n = normals @ np.linalg.inv(world_from_model[:3, :3])
    length = np.linalg.norm(n, axis=1, keepdims=True)
    if (length < 1e-12).any():
        return None
    unit: NDArray[np.float32] = (n / length).astype(np.float32)
    return unit
