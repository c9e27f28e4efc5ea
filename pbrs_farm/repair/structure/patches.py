"""Surfaces of the house as patches for the boolean work, and back; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import faces_with_area, triangle_corners
from pbrs_farm.repair.structure.booleans import Patch, Tag
from pbrs_farm.repair.structure.sliver_removal import MIN_AREA_M2


def patch_from_surface(surface: Surface, item: int) -> Patch:
    """The surface in double precision, tagged with its item; metric uv where it has none."""
    positions = surface.positions.astype(np.float64)
    uvs = surface.uvs.astype(np.float64) if surface.uvs is not None else positions[:, [0, 2]]
    normals = (
        surface.normals.astype(np.float64)
        if surface.normals is not None
        else np.zeros_like(positions)
    )
    tag = Tag(item, surface.name, surface.material)
    return Patch(tag, positions, surface.faces.astype(np.int64), uvs, normals)


def surface_from_patch(patch: Patch) -> Surface | None:
    """The patch in single precision, faces of no area left out; None if nothing is left."""
    positions = patch.positions.astype(np.float32)
    keep = faces_with_area(triangle_corners(positions, patch.faces), MIN_AREA_M2)
    if not keep.any():
        return None
    # Keep the vertices that the remaining faces use.
    used, inverse = np.unique(patch.faces[keep], return_inverse=True)
    # Store normals only where every vertex has one.
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
