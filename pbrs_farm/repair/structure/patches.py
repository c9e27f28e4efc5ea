"""Surfaces of the house as patches for the boolean work, and back; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.house import Surface
from pbrs_farm.repair.structure.booleans import F64, Patch, Tag

_MIN_AREA_M2 = 1e-12


def patch_from_surface(surface: Surface, item: int, *, name: str | None = None) -> Patch:
    """The surface in double precision, tagged with its item; metric uv where it has none."""
    positions = surface.positions.astype(np.float64)
    uvs = surface.uvs.astype(np.float64) if surface.uvs is not None else positions[:, [0, 2]]
    normals = (
        surface.normals.astype(np.float64)
        if surface.normals is not None
        else np.zeros_like(positions)
    )
    tag = Tag(item, surface.name if name is None else name, surface.material)
    return Patch(tag, positions, surface.faces.astype(np.int64), uvs, normals)


def surface_from_patch(patch: Patch) -> Surface | None:
    """The patch in single precision, faces of no area left out; None if nothing is left."""
    positions = patch.positions.astype(np.float32)
    keep = face_areas(positions, patch.faces) > _MIN_AREA_M2
    if not keep.any():
        return None
    used, inverse = np.unique(patch.faces[keep], return_inverse=True)
    length = np.linalg.norm(patch.normals[used], axis=1, keepdims=True)
    normals = None
    if bool((length > 0.1).all()):
        normals = (patch.normals[used] / length).astype(np.float32)
    return Surface(
        patch.tag.surface,
        positions[used],
        inverse.reshape(-1, 3).astype(np.int32),
        patch.tag.material,
        patch.uvs[used].astype(np.float32),
        normals,
    )


def face_areas(positions: NDArray[np.floating], faces: NDArray[np.integer]) -> F64:
    """(F,) areas in square metres, computed in double precision; NaN where a corner is."""
    p = positions.astype(np.float64)
    a, b, c = p[faces[:, 0]], p[faces[:, 1]], p[faces[:, 2]]
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def face_normals(positions: NDArray[np.floating], faces: NDArray[np.integer]) -> F64:
    """(F, 3) unit normals, counter-clockwise front; (0, 0, 0) where a face has no area."""
    p = positions.astype(np.float64)
    a, b, c = p[faces[:, 0]], p[faces[:, 1]], p[faces[:, 2]]
    n = np.cross(b - a, c - a)
    return np.asarray(n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300))
