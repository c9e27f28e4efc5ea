"""Axis and unit conventions, and the a_from_b transforms between frames; no effects.

World: metres, right-handed, y up. Plan coordinates are (x, z). Camera inside: OpenGL axes
(x right, y up, looking along -z). Names read as composition: a_from_c = a_from_b @ b_from_c.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrs_farm.core.arrays import F64, Matrix4

M_FROM_CM = 0.01
# Share of the largest scale: a direction that shrinks by more is lost in double precision.
_FLAT_SHARE = 1e-11

# Camera axes x right, y down, z forward  <-  x right, y up, z backward.
OPENCV_FROM_OPENGL: Matrix4 = np.diag([1.0, -1.0, -1.0, 1.0])

# Published normal axes x right, y forward, z up  <-  OpenGL camera axes (docs/spec/suncg.md section 5).
PUBLISHED_FROM_OPENGL: F64 = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]], np.float64)


# Our axes, y up  <-  those of a file with z up: (x, y, z) is (x, z, -y).
Y_UP_FROM_Z_UP: Matrix4 = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
# A world with z up  <-  ours: (x, y, z) is (x, -z, y).
Z_UP_FROM_Y_UP: Matrix4 = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def opencv_world_from_camera(world_from_camera: Matrix4) -> Matrix4:
    """(4, 4) pose of a camera with OpenCV axes from that with OpenGL axes; it is its own inverse."""
    return world_from_camera @ OPENCV_FROM_OPENGL


def rotation_x(angle_rad: float) -> F64:
    """(3, 3) right-handed rotation about +x of column vectors: takes +y towards +z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]], np.float64)


def rotation_y(angle_rad: float) -> F64:
    """(3, 3) right-handed rotation of column vectors about +y: a positive angle takes +z towards +x."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]], np.float64)


def rotation_z(angle_rad: float) -> F64:
    """(3, 3) right-handed rotation about +z of column vectors: takes +x towards +y."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float64)


# Exact quarter turns that lay an upright item with its top along +x, or along +z.
LYING_ALONG_X: F64 = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
LYING_ALONG_Z: F64 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def rotation_of_quaternion(w: float, x: float, y: float, z: float) -> F64:
    """(3, 3) rotation of column vectors by a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def affine(linear: ArrayLike, offset: ArrayLike = 0.0) -> Matrix4:
    """(4, 4) that turns and scales by linear (3, 3), then moves by offset (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, offset
    return matrix


def is_flattening(matrix: F64) -> bool:
    """True if a linear map (D, D) leaves less than D dimensions, whatever its scale (1e-5 is no flattening)."""
    if not np.isfinite(matrix).all():
        return False  # the caller refuses a result with such numbers
    sizes = np.linalg.svd(np.asarray(matrix, np.float64), compute_uv=False)
    return bool(sizes[-1] <= _FLAT_SHARE * sizes[0])


def transform_points(a_from_b: F64, points_b: NDArray[np.floating]) -> F64:
    """(N, 3) float64 points in frame a; a_from_b is (4, 4) affine. Use the rotation alone for directions."""
    p = np.asarray(points_b, np.float64)
    return np.asarray(p @ a_from_b[:3, :3].T + a_from_b[:3, 3])


def linear_from_srgb(encoded: NDArray[np.floating]) -> F64:
    """Linear values, float64, from sRGB-encoded ones, both in 0..1 (IEC 61966-2-1); not clipped."""
    e = np.asarray(encoded, np.float64)
    return np.where(e <= 0.04045, e / 12.92, ((np.maximum(e, 0) + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: NDArray[np.floating]) -> F64:
    """sRGB-encoded values, float64, from linear ones, both in 0..1 (IEC 61966-2-1); not clipped."""
    v = np.asarray(linear, np.float64)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 0) ** (1 / 2.4) - 0.055)


# Weights of linear sRGB primaries in luminance (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float64)

# Lumen per watt of white light: radiance in W m-2 sr-1 times this is luminance in cd m-2.
LM_PER_W = 179.0
