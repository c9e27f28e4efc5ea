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
    """(H, W) uint16 depth_z in mm as the sensor measures it, 0 = no measurement.

    Equal seeds give equal noise. Not modelled: interreflection, sunlight, glass and mirrors
    (they measure as their surface), temperature drift.
    """
    # Read the depth of a pixel nearby where projector and camera both see the surface.
    rng = np.random.default_rng(seed)
    reached = hit.valid & ~_grazing(hit, camera) & ~_in_projector_shadow(hit.depth_z, camera)
    rows, columns = _laterally_moved(hit.face.shape, rng)
    z = np.where(reached, hit.depth_z, 0)[rows, columns].astype(np.float64)

    # Add noise to the disparity f b / z, quantise it, and turn it back into depth.
    with np.errstate(divide="ignore"):
        disparity = FOCAL_PX * BASELINE_M / z + DISPARITY_NOISE_PX * _patchy(z.shape, rng)
        measured = FOCAL_PX * BASELINE_M / (np.rint(disparity * STEPS_PER_PX) / STEPS_PER_PX)
    good = (z > 0) & (measured >= NEAREST_M) & (measured <= FARTHEST_M)
    return np.where(good, np.rint(np.where(good, measured, 0) * 1000), 0).astype(np.uint16)


def _grazing(hit: HitRecord, camera: Camera) -> Mask:
    _, rays = camera.rays()
    cosine = np.abs(np.einsum("...i,...i->...", hit.geo_normal_world, rays))
    return np.asarray(cosine < np.cos(MAX_ANGLE_RAD) * np.linalg.norm(rays, axis=-1))


def _in_projector_shadow(depth_z: F32, camera: Camera) -> Mask:
    """(H, W) bool: a nearer surface on the same row hides the point from the projector.

    The projector stands BASELINE_M to the right of the camera: seen from there, column x moves
    left by fx BASELINE_M / z. Shadows fall on the left of near objects, as the sensor's do.
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


# The depth_sensor_stereo layer: depth as a stereo camera with block matching has it.
# The numbers are those of an active stereo camera like Intel's D435 (848 pixels over 87 degrees,
# 5 cm): disparity has noise, is quantised, near edges belong to the nearer side, and what the
# left camera alone sees has none (data sheet of the D400 family; Keselman et al. 2017).


WIDTH_PX = 848  # of its picture
STEREO_FOCAL_PX = 447.0  # that width over 87 degrees
STEREO_BASELINE_M = 0.05
STEREO_DISPARITY_NOISE_PX = 0.08  # standard deviation of sub-pixel matching on a textured wall
STEREO_STEPS_PER_PX = 32  # quantisation of disparity
MAX_DISPARITY_PX = 126.0  # of the search: what is nearer has no depth
STEREO_FARTHEST_M = 10.0
WINDOW = 5  # px of WIDTH_PX, of a matched block
NOISE_GRAIN_PX = 1.5  # neighbouring blocks overlap: their noise is alike


def stereo_depth(hit: HitRecord, camera: Camera, *, seed: int) -> NDArray[np.uint16]:
    """(H, W) uint16 depth_z in mm as the sensor measures it, 0 = no measurement.

    Equal seeds give equal noise. Not modelled: walls without texture (the projector gives them
    one), repeated patterns, reflections, glass.
    """
    # A block takes the nearest of what lies in it: objects grow by half a block.
    rng = np.random.default_rng(seed)
    size = max(round(WINDOW * hit.face.shape[1] / WIDTH_PX) | 1, 3)
    z = np.where(hit.valid, hit.depth_z.astype(np.float64), np.inf)
    fattened = ndimage.minimum_filter(z, size=size, mode="nearest")
    hidden = _hidden_from_right(fattened, camera)
    # Add noise of the blocks' grain to the disparity, quantise it, and turn it back into depth.
    grain = ndimage.gaussian_filter(rng.normal(0.0, 1.0, z.shape), NOISE_GRAIN_PX, mode="wrap")
    grain /= max(float(grain.std()), 1e-9)
    with np.errstate(divide="ignore"):
        disparity = (
            STEREO_FOCAL_PX * STEREO_BASELINE_M / fattened + STEREO_DISPARITY_NOISE_PX * grain
        )
        measured = (
            STEREO_FOCAL_PX
            * STEREO_BASELINE_M
            / (np.rint(disparity * STEREO_STEPS_PER_PX) / STEREO_STEPS_PER_PX)
        )
    good = np.isfinite(fattened) & ~hidden & (disparity <= MAX_DISPARITY_PX)
    good &= (measured > 0) & (measured <= STEREO_FARTHEST_M)
    return np.where(good, np.rint(np.where(good, measured, 0) * 1000), 0).astype(np.uint16)


def _hidden_from_right(z: F64, camera: Camera) -> Mask:
    """(H, W) bool: the right camera does not see the point: beyond its picture, or behind another."""
    with np.errstate(divide="ignore"):
        shift = np.where(np.isfinite(z), camera.intrinsics.fx * STEREO_BASELINE_M / z, 0.0)
    there = np.arange(z.shape[1]) - shift
    # A point on a row is hidden where something on its right has moved past it.
    leftmost = np.minimum.accumulate(there[:, ::-1], axis=1)[:, ::-1]
    return np.asarray((there > leftmost + 0.5) | (there < -0.5))


# The depth_sensor_tof layer: depth as a time-of-flight camera (Kinect 2) has it.
# Axial noise grows with distance and angle (Fankhauser et al. 2015, "Kinect v2 for mobile robot
# navigation", their fit); pixels on an edge of depth mix both sides (flying pixels).


TOF_NEAREST_M, TOF_FARTHEST_M = 0.5, 4.5  # range in which the sensor answers
MIX_PX = 0.5  # standard deviation of what a pixel gathers light over
TOF_MAX_ANGLE_RAD = np.radians(85)  # from the normal; beyond it nothing returns


def tof_depth(hit: HitRecord, camera: Camera, *, seed: int) -> NDArray[np.uint16]:
    """(H, W) uint16 depth_z in mm as the sensor measures it, 0 = no measurement.

    Equal seeds give equal noise. Not modelled: several paths of light (corners round off), dark and
    shining surfaces, sunlight, motion.
    """
    # Gather light over each pixel's surroundings: on an edge of depth both sides mix.
    rng = np.random.default_rng(seed)
    z = hit.depth_z.astype(np.float64)
    angle = incidence_rad(hit, camera)
    weight = np.where(hit.valid & (angle < TOF_MAX_ANGLE_RAD), np.cos(angle), 0.0)
    light = ndimage.gaussian_filter(weight, MIX_PX, mode="nearest")
    mixed = ndimage.gaussian_filter(weight * z, MIX_PX, mode="nearest")
    measured = np.divide(mixed, light, out=np.zeros_like(z), where=light > 1e-3)
    # Add axial noise by the pixel's own distance and angle.
    noise_m = axial_noise_mm(measured, np.minimum(angle, TOF_MAX_ANGLE_RAD)) / 1000
    measured += rng.normal(0.0, 1.0, z.shape) * noise_m
    good = (weight > 0) & (measured >= TOF_NEAREST_M) & (measured <= TOF_FARTHEST_M)
    return np.where(good, np.rint(np.where(good, measured, 0) * 1000), 0).astype(np.uint16)


def axial_noise_mm(z: F64, angle_rad: F64) -> F64:
    """Standard deviation in mm at depth z (m) and angle from the normal."""
    grazing = angle_rad**2 / (np.pi / 2 - angle_rad) ** 2
    return np.asarray(np.maximum(1.5 - 0.5 * z + 0.3 * z**2 + 0.1 * z**1.5 * grazing, 0.5))


def incidence_rad(hit: HitRecord, camera: Camera) -> F64:
    """(H, W) angle between each pixel's ray and the normal of what it meets."""
    _origin, rays = camera.exact_rays()
    cosine = np.abs(np.einsum("...i,...i->...", hit.geo_normal_world.astype(np.float64), rays))
    return np.asarray(np.arccos(np.clip(cosine / np.linalg.norm(rays, axis=-1), 0, 1)))
