"""A generated home as the House that its .sh3d gives, bit by bit, but without packing it; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.generate.home_file import HomeContents
from pbrs_farm.generate.model_file import MTL, WrittenSurface, written_surfaces
from pbrs_farm.read.mesh.obj import Mesh, ObjModel, mesh_from_corners
from pbrs_farm.read.sweethome3d.home import house_from_container
from pbrs_farm.read.sweethome3d.home_file.container import Container


def house_of_contents(contents: HomeContents, name: str, sha256: str, fields: ReadFields) -> House:
    """The house, or BadHouse, that read_home makes of contents.archive(); sha256: of the home's inputs."""
    parsed = {
        path: model
        for path, shape in contents.shapes.items()
        if (model := _model_of_shape(shape, fields.max_model_triangles)) is not None
    }
    container = Container(contents.home, contents, parsed)
    return house_from_container(container, name, sha256, fields)


def _model_of_shape(shape: Shape, max_triangles: int) -> ObjModel | None:
    """The model that parse_obj reads from the shape's OBJ; None if the reader would warn about it."""
    if sum(len(surface.faces) for surface in shape.surfaces) > max_triangles:
        return None
    meshes = [_mesh_of_surface(surface) for surface in written_surfaces(shape)]
    whole = tuple(mesh for mesh in meshes if mesh is not None)
    return ObjModel(whole, (MTL,)) if len(whole) == len(meshes) else None


def _mesh_of_surface(surface: WrittenSurface) -> Mesh | None:
    """The mesh of a surface; None if it would lose a triangle."""
    # A corner's position, uv and normal share one index, -1 for an attribute the surface lacks.
    corner = surface.faces.reshape(-1).astype(np.int64)
    none = np.full(len(corner), -1, np.int64)
    uvs, normals = surface.uvs, surface.normals
    indices = np.stack(
        [corner, none if uvs is None else corner, none if normals is None else corner], 1
    )
    pools = (
        surface.positions,
        np.zeros((0, 2)) if uvs is None else uvs,
        np.zeros((0, 3)) if normals is None else normals,
    )
    sizes = np.full(len(surface.faces), 3, np.int64)
    mesh, n_dropped = mesh_from_corners(surface.group, surface.material, indices, sizes, pools)
    return None if n_dropped else mesh
