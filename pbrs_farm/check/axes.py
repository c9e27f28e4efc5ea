"""Changes of frame and axes of `verify`, written apart from core.frames; no effects.

World: metres, y up. Camera: OpenCV axes (x right, y down, z forward). Poses are (4, 4) and map camera to world.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL axes <-> OpenCV axes
_STEP = 2 / 65535  # between two values of a normal component, stored as 16 bits


def opencv_pose(opengl_pose: Any) -> F64:
    """(4, 4) pose of a camera with OpenCV axes from one with OpenGL axes (or back)."""
    return np.asarray(np.array(opengl_pose, np.float64) @ _FLIP)


def opencv_transform(opengl: F64) -> F64:
    """(4, 4) transform between two cameras with OpenGL axes from one with OpenCV axes (or back)."""
    return np.asarray(_FLIP @ opengl @ _FLIP)


def into_frame(pose: F64, points: F64) -> F64:
    """(N, 3) world points in the frame of a rigid pose."""
    return np.asarray((points - pose[:3, 3]) @ pose[:3, :3])


def out_of_frame(pose: F64, points: F64) -> F64:
    """(N, 3) points of a pose's frame in the world."""
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


def stored_normals(stored: NDArray[Any]) -> F64:
    """(..., 3) published axes (x right, y forward, z up) of normals stored as 16 bits."""
    return np.asarray(stored * _STEP - 1)


def camera_normals(stored: NDArray[Any]) -> F64:
    """(..., 3) OpenCV axes of normals stored as 16 bits in the published axes."""
    right, forward, up = np.moveaxis(stored_normals(stored), -1, 0)
    return np.stack([right, -up, forward], axis=-1)


def world_normals(stored: NDArray[Any], pose: F64) -> F64:
    """(..., 3) world axes of normals stored as 16 bits in the published axes of a camera."""
    return np.asarray(camera_normals(stored) @ pose[:3, :3].T)


def published_directions(world: F64, pose: F64) -> F64:
    """(N, 3) published axes of a camera (x right, y forward, z up) of world directions."""
    right, down, forward = (world @ pose[:3, :3]).T
    return np.stack([right, forward, -down], axis=1)


def dot(a: NDArray[Any], b: NDArray[Any]) -> F64:
    """(...) dot products of vectors (..., 3)."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def is_rigid(pose: F64) -> bool:
    """True if a (4, 4) matrix is a rotation and a translation."""
    is_affine = pose.shape == (4, 4) and bool((pose[3] == [0, 0, 0, 1]).all())
    return is_affine and is_rotation(pose[:3, :3])


def is_rotation(matrix: F64) -> bool:
    """True if a (3, 3) matrix is a rotation without mirroring."""
    off = np.abs(matrix @ matrix.T - np.eye(3)).max()
    return bool(off <= 1e-6 and np.linalg.det(matrix) > 0)
