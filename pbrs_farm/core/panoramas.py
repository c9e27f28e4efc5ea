"""Pictures of all directions: equirectangular, and a cube map as a strip of six faces; no effects.

Equirectangular: the plane is (longitude, latitude downwards) in rad; the middle looks forward.
Cube map: face k covers 2 k - 1 <= x < 2 k + 1, -1 <= y < 1 of the plane; each face is a pin-hole
picture of 90 degrees. The faces are front, right, back, left, up, down: the first four go round; the
lower edge of `up` and the upper edge of `down` adjoin the front.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.mesh import unit_vectors

# Rows of each face: its right, down and forward in the camera's axes (OpenCV's).
FACE_AXES: Final[F64] = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    ],
    np.float64,
)


def directions_of_equirect(plane: F64) -> F64:
    """(N, 3) unit directions, OpenCV's axes, of (longitude, latitude down), radians; NaN beyond poles."""
    longitude, latitude = plane[:, 0], plane[:, 1]
    level = np.cos(latitude)
    directions = np.stack(
        [level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude)], axis=1
    )
    return np.where((np.abs(latitude) <= np.pi / 2)[:, None], directions, np.nan)


def equirect_of_directions(directions: F64) -> F64:
    """(N, 2) longitude -pi..pi (0 at the poles) and latitude downwards, radians, of (N, 3)."""
    x, y, z = directions.T
    return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=1)


def directions_of_cubemap(plane: F64) -> F64:
    """(N, 3) unit directions of points (N, 2) of the strip; NaN beside it.

    The strip has its six faces side by side, each two units wide and high: face k covers x from 2k
    - 1 to 2k + 1, y from -1 to 1. Its order of faces is that of FACE_AXES.
    """
    number = np.floor((plane[:, 0] + 1) / 2)
    inside = (number >= 0) & (number < 6) & (np.abs(plane[:, 1]) <= 1)
    axes = FACE_AXES[np.where(inside, number, 0).astype(np.int64)]
    # The point of the face at unit depth, in the camera's axes.
    right = (plane[:, 0] - 2 * number)[:, None] * axes[:, 0]
    point = unit_vectors(right + plane[:, 1:] * axes[:, 1] + axes[:, 2])
    return np.where(inside[:, None], point, np.nan)


def cubemap_of_directions(directions: F64) -> F64:
    """(N, 2) the strip's points of directions (N, 3), the first face on an edge; NaN for length 0."""
    number = np.argmax(directions @ FACE_AXES[:, 2].T, axis=1)
    local = np.einsum("nij,nj->ni", FACE_AXES[number], directions)
    with np.errstate(divide="ignore", invalid="ignore"):
        point = local[:, :2] / local[:, 2:]
    point[:, 0] += 2 * number
    return np.asarray(point)
