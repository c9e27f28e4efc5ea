"""A shape with fewer triangles: vertices that lie close together become one. No effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import face_areas, triangle_corners

FINEST: Final = 1 / 500  # size of the first grid cell to try, as a share of the longest side
_STEP: Final = 1.3
_NORMAL_STEPS: Final = 2.0  # normals that round to the same multiple of 1/2 are one
_UV_STEPS: Final = 16.0
_MIN_AREA_M2: Final = 1e-10


def lighter_shape(shape: Shape, most: int, coarsest: float) -> Shape:
    """Reduce a shape to at most `most` triangles by clustering vertices in a grid.

    coarsest: the largest cell, as a share of the longest side. The bounds are kept; a shape with few
    enough triangles is returned unchanged, and one that needs a coarser grid as light as possible.
    """
    n_faces = sum(len(s.faces) for s in shape.surfaces)
    if n_faces <= most:
        return shape
    low, high = shape.bounds
    longest = float((high - low).max())
    # Begin with cells that a plain sheet of that area would fill twice over.
    area = sum(
        float(face_areas(triangle_corners(s.positions, s.faces)).sum()) for s in shape.surfaces
    )
    cell = min(max(FINEST * longest, 0.7 * (2 * area / most) ** 0.5), coarsest * longest)
    lighter = _clustered(shape, cell)
    while sum(len(s.faces) for s in lighter.surfaces) > most and cell < coarsest * longest:
        cell = min(_STEP * cell, coarsest * longest)
        lighter = _clustered(shape, cell)
    return lighter


def _clustered(shape: Shape, cell: float) -> Shape:
    points = np.concatenate([s.positions for s in shape.surfaces]).astype(np.float64)
    # One position a cell: the mean of the vertices in it.
    _, cluster = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_inverse=True)
    cluster = cluster.ravel()
    count = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, points[:, k]) / count for k in range(3)], -1)
    # Stretch the whole back to its bounds.
    low, high = shape.bounds
    mean_low, mean_high = mean.min(0), mean.max(0)
    stretch = (high - low) / np.where(mean_high > mean_low, mean_high - mean_low, 1.0)
    mean = (mean - mean_low) * np.where(mean_high > mean_low, stretch, 1.0) + low
    # Take the surfaces apart again.
    surfaces, first = [], 0
    for surface in shape.surfaces:
        clusters = cluster[first : first + len(surface.positions)]
        first += len(surface.positions)
        # Keep surfaces smaller than a cell: lights refer to surfaces by index.
        surfaces.append(_lighter_surface(surface, clusters, mean) or surface)
    return replace(shape, surfaces=tuple(surfaces))


def _lighter_surface(surface: Surface, cluster: I64, mean: F64) -> Surface | None:
    # Drop faces that fell together, and the second of two equal ones.
    corners = cluster[surface.faces]
    is_whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
    is_whole &= corners[:, 2] != corners[:, 0]
    faces = surface.faces[is_whole]
    _, first_of_equals = np.unique(np.sort(corners[is_whole], axis=1), axis=0, return_index=True)
    faces = faces[np.sort(first_of_equals)]
    if not len(faces):
        return None
    # Vertices of one cell stay apart where normals or texture coordinates differ much.
    keys = [cluster]
    if surface.normals is not None:
        keys += list(np.rint(surface.normals * _NORMAL_STEPS).astype(np.int64).T)
    if surface.uvs is not None:
        keys += list(np.rint(surface.uvs * _UV_STEPS).astype(np.int64).T)
    used = np.unique(faces)
    _, first, number = np.unique(
        np.stack(keys, -1)[used], axis=0, return_index=True, return_inverse=True
    )
    renumbered = np.zeros(len(cluster), np.int32)
    renumbered[used] = number.ravel()
    vertex = used[first]
    positions = mean[cluster[vertex]].astype(np.float32)
    faces = renumbered[faces]
    faces = faces[face_areas(triangle_corners(positions, faces)) > _MIN_AREA_M2]
    if not len(faces):
        return None
    return replace(
        surface,
        positions=positions,
        faces=np.ascontiguousarray(faces, np.int32),
        uvs=None if surface.uvs is None else surface.uvs[vertex],
        normals=None if surface.normals is None else surface.normals[vertex],
    )
