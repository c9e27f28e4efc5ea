"""Projection: camera to OpenGL clip space on Camera.rays()' pixel grid, and frustum culling; pure numpy, no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64, Bools, Matrix4
from pbrs_farm.core.camera import Camera

NEAR_PLANE_M = 0.02  # closer than any camera to a wall


def clip_from_world(camera: Camera, far_m: float) -> Matrix4:
    """(4, 4) world to clip space of a pin-hole camera, pixels as of `Camera.rays`; far_m: `far_plane`."""
    # Shift the principal point: clip space runs from -1 to 1, upwards, across the picture.
    i = camera.intrinsics
    w, h, n, f = i.width_px, i.height_px, NEAR_PLANE_M, far_m
    clip_from_camera = np.array(
        [
            [2 * i.fx / w, 0, 1 - 2 * i.cx / w, 0],
            [0, 2 * i.fy / h, 2 * i.cy / h - 1, 0],
            [0, 0, -(f + n) / (f - n), -2 * f * n / (f - n)],
            [0, 0, -1, 0],
        ]
    )
    return np.asarray(clip_from_camera @ np.linalg.inv(camera.world_from_camera))


def far_plane(camera: Camera, low: F64, high: F64) -> float:
    """Depth of a far plane just beyond every box low..high (N, 3) from the camera, at least a metre."""
    if not len(low):
        return 1.0
    # Measure to the farthest corner of the box around all boxes.
    reach = np.maximum(np.abs(low.min(0) - camera.eye), np.abs(high.max(0) - camera.eye))
    return max(1.0, 1.01 * float(np.linalg.norm(reach)))


def boxes_in_view(clip: Matrix4, low: F64, high: F64) -> Bools:
    """(N,) bool: the box low..high (N, 3) is not wholly outside one plane of the frustum."""
    # Read the six planes off the clip matrix (Gribb and Hartmann 2001).
    planes = np.concatenate([clip[3] + clip[:3], clip[3] - clip[:3]])
    normal, offset = planes[:, :3], planes[:, 3]
    # Test the innermost corner of each box.
    farthest = np.where(normal[:, None] > 0, high, low)
    return np.asarray((np.einsum("pk,pnk->pn", normal, farthest) + offset[:, None] >= 0).all(0))


def distance_to_boxes(eye: F64, low: F64, high: F64) -> F64:
    """(N,) distance from eye to the nearest point of each box low..high (N, 3), metres; 0 inside."""
    gap = np.maximum(np.maximum(low - eye, eye - high), 0.0)
    return np.asarray(np.sqrt(np.einsum("nk,nk->n", gap, gap)))
