"""Spheres of nearly equal triangles, by halving the edges of an icosahedron; no effects."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.mesh import unit_vectors


def icosphere_mesh(corners: F64, n_splits: int) -> tuple[F64, I64]:
    """(unit vertices, faces of either winding) of the icosahedron of 12 unit corners, edges halved n_splits times."""
    near = np.linalg.norm(corners[:, None] - corners[None], axis=2) < 1.2  # an edge is 1.05 long
    faces = np.array([f for f in combinations(range(12), 3) if near[np.ix_(f, f)].all()])
    unit = corners
    for _ in range(n_splits):
        unit, faces = _split_parts(unit, faces)
    return unit, faces


def _split_parts(unit: F64, faces: I64) -> tuple[F64, I64]:
    # Make one middle vertex for the two faces of an edge, on the sphere.
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    pairs, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = unit_vectors(unit[pairs].mean(1))
    ab, bc, ca = np.ravel(inverse).reshape(3, -1) + len(unit)
    # Put four faces in the place of each.
    a, b, c = faces.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([unit, middle]), np.concatenate([np.stack(p, 1) for p in parts])
