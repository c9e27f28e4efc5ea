"""The depth_sensor_tof layer: depth as a time-of-flight camera (Kinect 2) has it; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, HitRecord
from pbrs_farm.core.camera import Camera

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
