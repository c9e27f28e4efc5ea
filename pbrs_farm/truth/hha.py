"""The hha layer: horizontal disparity, height above ground, angle with gravity; no effects.

Source: Gupta, Girshick, Arbelaez, Malik 2014, with the constants of their published encoder, and
the paper's depth baseline. Gravity and normals are exact here, where theirs are estimated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import HitRecord
from pbrs_farm.core.camera import Camera

_DISPARITY_CM = 31000.0  # disparity = this / depth in cm
_NEAREST_CM = 100.0  # nearer depths count as this: the disparity fits into a byte
_ANGLE_OFFSET = 128 - 90  # a wall, at 90 degrees, is 128
_FLOOR_IN_VIEW_CM = -90.0  # the lowest point below this, from the eye, is taken for the floor
_ASSUMED_FLOOR_CM = -130.0  # the floor's height from the eye when none is in view


def hha_png(hit: HitRecord, camera: Camera) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: H, H, A; (0, 0, 0) = nothing.

    R: 31000 / depth_z in cm, depth held to at least 100 cm. G: height in cm above the lowest point
    in view, or above 130 cm below the camera when no point lies more than 90 cm below it. B: degrees
    between gravity and the normal that points away from the camera, plus 38: floors are 38, walls
    128, ceilings 218. Each is rounded and held to 0..255.
    """
    out = np.zeros((*hit.face.shape, 3), np.float32)
    if not hit.valid.any():
        return out.astype(np.uint8)
    # Estimate the floor's height from the lowest point in view.
    above_eye_cm = (hit.points.position_world[..., 1] - np.float32(camera.eye[1])) * np.float32(100)
    lowest_cm = float(above_eye_cm[hit.valid].min())
    floor_cm = lowest_cm if lowest_cm <= _FLOOR_IN_VIEW_CM else _ASSUMED_FLOOR_CM
    # Encode the three channels.
    out[..., 0] = _DISPARITY_CM / np.maximum(hit.depth_z * np.float32(100), _NEAREST_CM)
    out[..., 1] = above_eye_cm - floor_cm
    up = np.clip(hit.geo_normal_world[..., 1], -1, 1)
    out[..., 2] = np.degrees(np.arccos(up)) + _ANGLE_OFFSET
    return np.where(hit.valid[..., None], np.clip(np.rint(out), 0, 255), 0).astype(np.uint8)
