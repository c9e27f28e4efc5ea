"""Triangle meshes in Mitsuba's memory: the only module that uses its mesh API.

Mitsuba 3.9 makes an empty mesh whose flat buffers are then filled; 3.10 takes tensors in the
constructor (`mi.Mesh(name, faces=..., positions=...)`) and renames the buffers. pyproject.toml
excludes 3.10 until this module follows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32


def mitsuba_mesh(
    mi: Any,
    name: str,
    positions: F32,
    faces: NDArray[np.integer],
    *,
    normals: F32 | None = None,
    uvs: F32 | None = None,
    plugins: dict[str, Any] | None = None,
) -> Any:
    """A Mitsuba mesh.

    mi: the module of the variant. positions: (V, 3); faces: (F, 3), at least one; normals: (V, 3)
    and uvs: (V, 2), v downwards as in Mitsuba. plugins: what `mi.load_dict` made of the mesh's BSDF
    and emitter, which a mesh takes only when it is made.
    """
    properties = mi.Properties()
    for key, plugin in (plugins or {}).items():
        properties[key] = plugin
    mesh = mi.Mesh(
        name, len(positions), len(faces), props=properties,
        has_vertex_normals=normals is not None, has_vertex_texcoords=uvs is not None,
    )  # fmt: skip
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = _flat(positions)
    if normals is not None:
        parameters["vertex_normals"] = _flat(normals)
    if uvs is not None:
        parameters["vertex_texcoords"] = _flat(uvs)
    parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
    parameters.update()
    return mesh


def move_vertices(mi: Any, scene: Any, name: str, positions: F32) -> None:
    """Set the positions (V, 3) of all vertices of a scene's mesh, and rebuild the scene's tree."""
    parameters = mi.traverse(scene)
    parameters[f"{name}.vertex_positions"] = _flat(positions)
    parameters.update()


def _flat(rows: F32) -> F32:
    return np.ascontiguousarray(rows, np.float32).ravel()
