"""Cameras around one object without context (paper section 4.1); no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.mesh import unit_vectors

N_VIEWS: Final = 20  # per object, paper section 4.1
MIN_DIAGONALS, MAX_DIAGONALS = 1.5, 4.5  # from the box's middle to the eye
POLE_RAD: Final = np.deg2rad(1.0)  # nearer to a pole the camera takes another up vector

_UP, _UP_AT_POLES = (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)


def object_views(
    bounds: F64,
    intrinsics: Intrinsics,
    seed: int,
    names: tuple[str | int, ...],
    n_views: int = N_VIEWS,
) -> tuple[View, ...]:
    """Views of what bounds (2, 3) holds, each from a random vertex of the icosphere.

    A vertex is one of the 162 of the twice-subdivided icosahedron, uniform with repetition; the
    distance from the bounds' centre is uniform in 1.5..4.5 times their diagonal; the camera looks
    at the centre, upright (another fixed up vector within a degree of the poles). names: what
    the randomness is hashed from, with the seed. View.sector is the vertex's number. No other
    rule applies: no clearance, no least number of objects. Raises ValueError for bounds that are
    not finite or have no extent.
    """
    centre = bounds.mean(0)
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0]))
    if not np.isfinite(diagonal) or diagonal <= 0:
        raise ValueError(f"bounds: expected a finite box with an extent, got {bounds.tolist()}")
    vertices = icosphere_vertices(2)
    rng = np.random.default_rng(int(keys.digest(seed, *names)[:16], 16))
    views = []
    for k in range(n_views):
        # Draw the vertex, then the distance.
        vertex = int(rng.integers(len(vertices)))
        distance = diagonal * rng.uniform(MIN_DIAGONALS, MAX_DIAGONALS)
        outwards = vertices[vertex]
        # Keep the camera upright where that is possible.
        at_pole = np.arccos(min(1.0, abs(float(outwards[1])))) <= POLE_RAD
        up = _UP_AT_POLES if at_pole else _UP
        camera = Camera.look(intrinsics, centre + distance * outwards, -outwards, up)
        views.append(View(f"object_{k:02d}", "", vertex, camera))
    return tuple(views)


def icosphere_vertices(n_subdivisions: int) -> F64:
    """(10 * 4^n + 2, 3) unit vertices, both poles among them, of the icosahedron, edges halved n times."""
    vertices, faces = _icosahedron()
    for _ in range(n_subdivisions):
        # Make one middle per edge, on the sphere, and four faces of each.
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, place = np.unique(edges, axis=0, return_inverse=True)
        middles = unit_vectors(vertices[unique].sum(1))
        a, b, c = (len(vertices) + place.reshape(-1, 3)).T
        i, j, k = faces.T
        vertices = np.concatenate([vertices, middles])
        faces = np.concatenate(
            [np.stack(corner, axis=1) for corner in ((i, a, c), (j, b, a), (k, c, b), (a, b, c))]
        )
    return vertices


def _icosahedron() -> tuple[F64, NDArray[np.intp]]:
    """12 unit vertices, poles first and last, and 20 faces."""
    height, radius = 1 / np.sqrt(5), 2 / np.sqrt(5)  # of the two rings of five vertices
    turn = 2 * np.pi / 5 * np.arange(5)
    upper = np.stack([radius * np.cos(turn), np.full(5, height), radius * np.sin(turn)], axis=1)
    lower = upper @ np.diag([-1.0, -1.0, -1.0])
    vertices = np.concatenate([[[0, 1, 0]], upper, lower, [[0, -1, 0]]])

    # Take as a face any three vertices at the edge's length from each other.
    gaps = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    edge = gaps[gaps > 0].min()
    near = np.isclose(gaps, edge)
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    return vertices, np.array(faces, np.intp)
