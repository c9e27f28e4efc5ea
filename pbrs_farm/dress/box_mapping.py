"""Texture coordinates by box projection in the item's axes, the grain along a board; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, Surface
from pbrs_farm.core.mesh import area_vectors, face_areas, triangle_corners
from pbrs_farm.geometry.connected import connected_places

_WELD_M = 1e-4  # vertices no farther apart are one
_GOLDEN = 0.6180339887498949  # how far each board's picture is shifted against the one before it
# Of a face that looks along an axis: the two others.
_ACROSS = np.array([[2, 1], [0, 2], [0, 1]])

Int = NDArray[np.int64]


def box_mapped(
    surface: Surface, axes: F64, size_m: tuple[float, float], *, is_grained: bool = True
) -> Surface:
    """The surface with uv in repeats of size_m; vertices are split where faces look elsewhere.

    axes: (3, 3), columns are the piece's own axes. is_grained: u runs along the longest side of
    each connected part, else along the horizontal.
    """
    local = surface.positions.astype(np.float64) @ axes
    normals = area_vectors(triangle_corners(surface.positions, surface.faces)) @ axes
    axis = np.abs(normals).argmax(1)
    part = _parts_of(local, surface.faces)
    # Choose for each face which of the two axes across its own is u.
    face_part = part[surface.faces[:, 0]]
    extent = _extents(local, part)[face_part]
    first, second = _ACROSS[axis, 0], _ACROSS[axis, 1]
    rows = np.arange(len(axis))
    if is_grained:
        swap = extent[rows, second] > extent[rows, first]
        first, second = np.where(swap, second, first), np.where(swap, first, second)
    # Split vertices by how their faces are mapped.
    key = surface.faces.ravel().astype(np.int64) * 9 + np.repeat(first * 3 + second, 3)
    unique, number = np.unique(key, return_inverse=True)
    vertex, way = np.divmod(unique, 9)
    count = np.arange(len(vertex))
    u, v = local[vertex][count, way // 3], local[vertex][count, way % 3]
    # Shift each part, so that no two boards show the same knot.
    shift = (part[vertex] * _GOLDEN) % 1.0
    uvs = np.stack([u / size_m[0] + shift, v / size_m[1] + (7 * shift) % 1.0], -1)
    return replace(
        surface,
        positions=surface.positions[vertex],
        faces=number.reshape(-1, 3).astype(np.int32),
        uvs=uvs.astype(np.float32),
        normals=None if surface.normals is None else surface.normals[vertex],
    )


def area_of_look(item: Item, surface: Surface) -> float:
    """Area in m2 that chooses a surface's finish: of an item with joints, all of one material."""
    alike = (
        [s for s in item.surfaces if s.material == surface.material] if item.joints else [surface]
    )
    return sum(float(face_areas(triangle_corners(s.positions, s.faces)).sum()) for s in alike)


def connected_parts(surface: Surface, axes: F64) -> Int:
    """(V,) number, from 0, of the connected part (to 0.1 mm) of each vertex; axes: (3, 3) to compare along."""
    return _parts_of(surface.positions.astype(np.float64) @ axes, surface.faces)


def _parts_of(local: F64, faces: NDArray[np.int32]) -> Int:
    """(V,) number of the connected part of each vertex; equal positions are one."""
    places = np.rint(local / _WELD_M).astype(np.int64).reshape(-1, 3)
    # Number the cells in one row where 62 bits hold them: sorting rows takes three times as long.
    x, y, z = (places - places.min(0, initial=0)).T
    n_y, n_z = (int(k.max(initial=0)) + 1 for k in (y, z))
    if (int(x.max(initial=0)) + 1) * n_y * n_z < 1 << 62:
        _, welded = np.unique((x * n_y + y) * n_z + z, return_inverse=True)
    else:
        _, welded = np.unique(places, axis=0, return_inverse=True)
    welded = welded.ravel()
    return connected_places(welded[faces], int(welded.max(initial=-1)) + 1)[welded]


def _extents(local: F64, part: Int) -> F64:
    n = int(part.max()) + 1
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, part, local)
    np.maximum.at(high, part, local)
    return np.asarray(high - low)
