"""Faces that cutting and joining made: texture coordinates in metres in each face's plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.repair.structure.booleans import Patch

REVEAL = "reveal"
ADDED_SURFACES = frozenset({REVEAL, "joint", "hidden", "back", "rim"})
"""Names of the surfaces repair adds to structure items."""


def with_metric_uv(patch: Patch) -> Patch:
    """The patch with uv in metres if repair added it; as it is if it came from the source.

    v is the height on upright faces, world z on the others; u runs across it in the face's plane.
    """
    if patch.tag.surface not in ADDED_SURFACES:
        return patch
    # Span each face's plane by u across and v up (or along z where it lies flat).
    corners = patch.positions[patch.faces]
    normals = unit_normals(corners)
    up = np.where(np.abs(normals[:, 1:2]) < 0.7, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]])
    u = np.cross(up, normals)
    u = u / np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-12)
    v = np.cross(normals, u)
    uvs = np.stack([np.einsum("fki,fi->fk", corners, axis) for axis in (u, v)], -1)
    # Give each face vertices of its own: neighbours have other axes.
    n = len(patch.faces)
    return replace(
        patch,
        positions=corners.reshape(-1, 3),
        faces=np.arange(3 * n).reshape(n, 3),
        uvs=uvs.reshape(-1, 2),
        normals=np.zeros((3 * n, 3)),
    )
