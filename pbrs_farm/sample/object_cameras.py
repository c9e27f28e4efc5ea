"""Cameras around one object without context (paper section 4.1); no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.geometry.solids import icosphere_mesh

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
        # Keep the camera upright where possible.
        at_pole = np.arccos(min(1.0, abs(float(outwards[1])))) <= POLE_RAD
        up = _UP_AT_POLES if at_pole else _UP
        camera = Camera.look(intrinsics, centre + distance * outwards, -outwards, up)
        views.append(View(f"object_{k:02d}", "", vertex, camera))
    return tuple(views)


def icosphere_vertices(n_subdivisions: int) -> F64:
    """(10 * 4^n + 2, 3) unit vertices, both poles among them, of the icosahedron, edges halved n times."""
    # Two rings of five vertices between the poles.
    height, radius = 1 / np.sqrt(5), 2 / np.sqrt(5)
    turn = 2 * np.pi / 5 * np.arange(5)
    upper = np.stack([radius * np.cos(turn), np.full(5, height), radius * np.sin(turn)], axis=1)
    lower = upper @ np.diag([-1.0, -1.0, -1.0])
    corners = np.concatenate([[[0, 1, 0]], upper, lower, [[0, -1, 0]]])
    return icosphere_mesh(corners, n_subdivisions)[0]
