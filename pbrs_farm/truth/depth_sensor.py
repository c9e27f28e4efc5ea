"""The depth_sensor layer: depth as a structured-light sensor (Kinect 1, NYUv2) has it; no effects.

The model has lateral noise, noisy disparity quantised to eighths of a pixel, no return at grazing
angles and out of range, and none in the shadow of the projector 7.5 cm beside the camera. Both
noises are patchy: a pixel's disparity is that of a block about it, and neighbours' blocks overlap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F32, F64, I64, HitRecord, Mask
from pbrs_farm.core.camera import Camera
from pbrs_farm.truth.sensor_reading import FULL_REFLECTANCE, Hole, Reading, depth_reading

FOCAL_PX = 580.0  # the sensor's infrared camera, Khoshelham and Elberink 2012
BASELINE_M = 0.075  # from camera to projector, the same source
NEAREST_M, FARTHEST_M = 0.5, 8.0  # range in which the sensor answers
LATERAL_PX = 0.5  # standard deviation of the measured place, Handa et al. 2014
DISPARITY_NOISE_PX = 1 / 6  # standard deviation, the same source
STEPS_PER_PX = 8  # quantisation of disparity, the same source
KINECT_WIDTH_PX = 640  # of its picture
KINECT_BLOCK = 9  # px of KINECT_WIDTH_PX, of a matched block, Khoshelham and Elberink 2012
MAX_ANGLE_RAD = np.radians(82)  # from the normal; beyond it nothing returns, Nguyen et al. 2012


def sensor_depth(hit: HitRecord, camera: Camera, *, seed: int) -> NDArray[np.uint16]:
    """(H, W) uint16 measured mm, 0 = none."""
    return kinect_reading(hit, camera, seed=seed).depth_mm


def kinect_reading(hit: HitRecord, camera: Camera, *, seed: int) -> Reading:
    """Measured depth, noise by seed, and reasons for holes; without interreflection, sun, glass, drift."""
    # Read the depth of a pixel nearby where projector and camera both see the surface.
    rng = np.random.default_rng(seed)
    grazing, shadow = _grazing(hit, camera), _in_projector_shadow(hit.depth_z, camera)
    reached = hit.valid & ~grazing & ~shadow
    rows, columns = _laterally_moved(hit.face.shape, rng)
    z = np.where(reached, hit.depth_z, 0)[rows, columns].astype(np.float64)

    # Add noise to the disparity f b / z, quantise it, and turn it back into depth.
    with np.errstate(divide="ignore"):
        disparity = FOCAL_PX * BASELINE_M / z + DISPARITY_NOISE_PX * _patchy(z.shape, rng)
        measured = FOCAL_PX * BASELINE_M / (np.rint(disparity * STEPS_PER_PX) / STEPS_PER_PX)
    is_near = (measured >= 0) & (measured < NEAREST_M)
    in_reach = ~is_near & (measured >= 0) & (measured <= FARTHEST_M)
    valid = hit.valid[rows, columns]
    faults = {
        Hole.TOO_NEAR: (z > 0) & is_near,
        Hole.TOO_FAR: ~valid | ((z > 0) & ~is_near & ~in_reach),
        Hole.GRAZING: valid & grazing[rows, columns],
        Hole.SHADOW: valid & shadow[rows, columns],
    }
    least_return = FULL_REFLECTANCE / FARTHEST_M**2
    return depth_reading(measured, faults, least_return, lambda mask: mask[rows, columns])


def _grazing(hit: HitRecord, camera: Camera) -> Mask:
    _, rays = camera.rays()
    cosine = np.abs(np.einsum("...i,...i->...", hit.geo_normal_world, rays))
    return np.asarray(cosine < np.cos(MAX_ANGLE_RAD) * np.linalg.norm(rays, axis=-1))


def _in_projector_shadow(depth_z: F32, camera: Camera) -> Mask:
    """(H, W) bool: a nearer surface on the same row hides the point from the projector.

    The projector is BASELINE_M to the right of the camera: seen from there, column x moves left by
    fx BASELINE_M / z. Shadows are on the left of near objects, as for the real sensor.
    """
    fx = camera.intrinsics.fx
    with np.errstate(divide="ignore"):
        shift = np.where(depth_z > 0, fx * BASELINE_M / depth_z, 0)
    from_projector = np.arange(depth_z.shape[1]) - shift
    # Find points that something on their right overtakes: lit points keep their order along a row.
    leftmost = np.minimum.accumulate(from_projector[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(from_projector > leftmost + 0.5)


def _patchy(shape: tuple[int, ...], rng: np.random.Generator) -> F64:
    """(H, W) normal noise of standard deviation 1 that neighbours share as their blocks overlap."""
    size = max(round(KINECT_BLOCK * shape[1] / KINECT_WIDTH_PX) | 1, 3)
    return np.asarray(ndimage.uniform_filter(rng.normal(0, size, shape), size, mode="wrap"))


def _laterally_moved(shape: tuple[int, ...], rng: np.random.Generator) -> tuple[I64, I64]:
    """Rows and columns (H, W) of the pixel each pixel really measures."""
    # Draw a place around each pixel and hold it to the picture.
    grid = np.indices(shape) + LATERAL_PX * np.stack([_patchy(shape, rng) for _axis in range(2)])
    limit = np.array(shape).reshape(2, 1, 1) - 1
    rows, columns = np.clip(np.rint(grid), 0, limit).astype(np.int64)
    return rows, columns
