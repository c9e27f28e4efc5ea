"""Depth as a structured-light sensor (first Kinect, NYUv2's) would give it; no effects.

Edges wander (lateral noise), disparity is noisy and measured in eighths of a pixel, surfaces at
grazing angles and out of range are lost, and so is what the projector, 7.5 cm beside the camera,
cannot reach. Models: Handa et al. 2014 (noise, quantisation), Nguyen et al. 2012 (angles),
Khoshelham and Elberink 2012 (baseline and focal length of the sensor).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import HitRecord, Mask
from pbrs_farm.core.camera import Camera

FOCAL_PX = 580.0
BASELINE_M = 0.075
NEAREST_M, FARTHEST_M = 0.5, 8.0
LATERAL_PX = 0.5
DISPARITY_NOISE_PX = 1 / 6
STEPS_PER_PX = 8
MAX_ANGLE_RAD = np.radians(82)


def sensor_depth(hit: HitRecord, camera: Camera, *, seed: int) -> NDArray[np.uint16]:
    """(H, W) uint16 depth_z in mm as the sensor measures it, 0 = no measurement.

    Equal seeds give equal noise. Not modelled: interreflection, sunlight, glass and mirrors
    (they measure as their surface), temperature drift.
    """
    rng = np.random.default_rng(seed)
    reached = hit.valid & ~_grazing(hit, camera) & ~_shadowed(hit.depth_z, camera)
    rows, columns = _wandered(hit.face.shape, rng)
    z = np.where(reached, hit.depth_z, 0)[rows, columns].astype(np.float64)

    with np.errstate(divide="ignore"):
        disparity = FOCAL_PX * BASELINE_M / z + rng.normal(0, DISPARITY_NOISE_PX, z.shape)
        measured = FOCAL_PX * BASELINE_M / (np.rint(disparity * STEPS_PER_PX) / STEPS_PER_PX)
    good = (z > 0) & (measured >= NEAREST_M) & (measured <= FARTHEST_M)
    return np.where(good, np.rint(np.where(good, measured, 0) * 1000), 0).astype(np.uint16)


def _grazing(hit: HitRecord, camera: Camera) -> Mask:
    _, rays = camera.rays()
    cosine = np.abs(np.einsum("...i,...i->...", hit.geo_normal_world, rays))
    return np.asarray(cosine < np.cos(MAX_ANGLE_RAD) * np.linalg.norm(rays, axis=-1))


def _shadowed(depth_z: NDArray[np.float32], camera: Camera) -> Mask:
    """(H, W) bool: a nearer surface on the same row hides the point from the projector.

    The projector stands BASELINE_M to the right of the camera: seen from there, column x moves
    left by fx BASELINE_M / z. Shadows fall on the left of near objects, as the sensor's do.
    """
    fx = camera.intrinsics.fx
    with np.errstate(divide="ignore"):
        shift = np.where(depth_z > 0, fx * BASELINE_M / depth_z, 0)
    from_projector = np.arange(depth_z.shape[1]) - shift
    # Reached points keep their order along the row: whatever lies right of a point here must there.
    leftmost = np.minimum.accumulate(from_projector[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(from_projector > leftmost + 0.5)


def _wandered(
    shape: tuple[int, ...], rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns (H, W) of the pixel each pixel really measures."""
    grid = np.indices(shape) + rng.normal(0, LATERAL_PX, (2, *shape))
    limit = np.array(shape).reshape(2, 1, 1) - 1
    rows, columns = np.clip(np.rint(grid), 0, limit).astype(np.int64)
    return rows, columns
