"""STL -> a mesh, binary or ASCII; no effects. Its normals are ignored: many programs write zeros."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.mesh import face_areas, unit_vectors
from pbrs_farm.read.mesh.obj import DEFAULT_CREASE_RAD, Mesh
from pbrs_farm.read.mesh.triangulate import crease_normals

_HEADER: Final = 84  # bytes before the facets, the last four of which count them
_FACET: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX: Final = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def parse_stl(data: bytes, file: str, *, max_triangles: int) -> Mesh:
    """The facets with creased normals; BadHouse if there are none, too many, or one is not finite."""
    corners = _binary(data) if _is_binary(data) else _ascii(data, file)
    if not 0 < len(corners) <= max_triangles:
        raise BadHouse(file, "", f"has {len(corners)} triangles; 1 to {max_triangles} are read")
    if not (np.abs(corners) < 1e9).all():
        raise BadHouse(file, "", "has a vertex that is not finite")
    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    faces = faces[face_areas(points[faces]) > 0]
    normals, of_corner = crease_normals(points, faces, DEFAULT_CREASE_RAD)
    keys = np.stack([faces.reshape(-1), of_corner.reshape(-1)], 1)
    unique, corner = np.unique(keys, axis=0, return_inverse=True)
    normal = unit_vectors(normals[unique[:, 1]])
    return Mesh("", "", points[unique[:, 0]], corner.reshape(-1, 3).astype(np.int32), None, normal)


def _is_binary(data: bytes) -> bool:
    n = int.from_bytes(data[80:_HEADER], "little")
    return len(data) >= _HEADER and len(data) == _HEADER + n * _FACET.itemsize


def _binary(data: bytes) -> F64:
    return np.frombuffer(data, _FACET, offset=_HEADER)["corners"].astype(np.float64)


def _ascii(data: bytes, file: str) -> F64:
    rows = _VERTEX.findall(data)
    try:
        values = np.array(rows, np.bytes_).astype(np.float64)
    except ValueError:
        raise BadHouse(file, "", "has a vertex that is not three numbers") from None
    return values.reshape(-1, 3)[: len(rows) // 3 * 3].reshape(-1, 3, 3)
