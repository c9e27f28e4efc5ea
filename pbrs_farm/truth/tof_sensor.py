"""The layers depth_sensor_tof, _azure and _l515: depth as cameras have it that time light; no effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, HitRecord
from pbrs_farm.core.camera import Camera
from pbrs_farm.truth.sensor_reading import (
    FULL_REFLECTANCE,
    LOW_REFLECTANCE,
    Hole,
    Reading,
    depth_reading,
)

TOF_MAX_ANGLE_RAD = np.radians(85)  # from the normal; beyond it nothing returns
_AZURE_STEADY_M: Final = 2.5  # from which an Azure Kinect is less noisy than a Kinect 2
_EDGE_SHARE: Final = 0.03  # of the depth, that neighbours of a pixel without depth lie apart


def kinect2_noise_mm(z: F64, angle_rad: F64) -> F64:
    """Standard deviation in mm at depth z (m) and angle from the normal (Fankhauser et al. 2015)."""
    grazing = angle_rad**2 / (np.pi / 2 - angle_rad) ** 2
    return np.asarray(np.maximum(1.5 - 0.5 * z + 0.3 * z**2 + 0.1 * z**1.5 * grazing, 0.5))


def azure_noise_mm(z: F64, angle_rad: F64) -> F64:
    """The same of an Azure Kinect: a Kinect 2's to 2.5 m, and no more beyond (Kurillo et al. 2022)."""
    return kinect2_noise_mm(np.minimum(z, _AZURE_STEADY_M), angle_rad)


def l515_noise_mm(z: F64, _angle_rad: F64) -> F64:
    """The same of an L515: 2.5 mm at 1 m, 15.5 mm at 9 m, a line between (its data sheet)."""
    return np.asarray(np.maximum(2.5 + (15.5 - 2.5) / (9 - 1) * (z - 1), 0.5))


@dataclass(frozen=True, slots=True)
class TofSensor:
    """A camera that times light. noise_mm: of depth (m) and angle from the normal (rad)."""

    nearest_m: float  # between which it answers
    farthest_m: float
    noise_mm: Callable[[F64, F64], F64]
    mix_px: float  # standard deviation of what a pixel gathers light over
    least_reflectance: float = LOW_REFLECTANCE  # of a surface at the farthest distance
    drops_edges: bool = False  # no depth where both sides of an edge reach a pixel; else their mean


KINECT2: Final = TofSensor(0.5, 4.5, kinect2_noise_mm, 0.5)
AZURE: Final = TofSensor(0.5, 3.86, azure_noise_mm, 0.5, drops_edges=True)
"""An Azure Kinect, narrow field of view, unbinned."""
L515: Final = TofSensor(0.25, 9.0, l515_noise_mm, 0.3, FULL_REFLECTANCE)
"""A lidar camera: a laser's spot is narrow."""


def tof_depth(
    hit: HitRecord, camera: Camera, *, seed: int, sensor: TofSensor = KINECT2
) -> NDArray[np.uint16]:
    """(H, W) uint16 measured mm, 0 = none."""
    return tof_reading(hit, camera, seed=seed, sensor=sensor).depth_mm


def tof_reading(
    hit: HitRecord, camera: Camera, *, seed: int, sensor: TofSensor = KINECT2
) -> Reading:
    """Measured depth, noise by seed, and reasons for holes; without multipath, dark surfaces, sun, motion."""
    # Gather light over each pixel's surroundings: on an edge of depth both sides mix.
    rng = np.random.default_rng(seed)
    z = hit.depth_z.astype(np.float64)
    angle = incidence_rad(hit, camera)
    weight = np.where(hit.valid & (angle < TOF_MAX_ANGLE_RAD), np.cos(angle), 0.0)
    light = ndimage.gaussian_filter(weight, sensor.mix_px, mode="nearest")
    mixed = ndimage.gaussian_filter(weight * z, sensor.mix_px, mode="nearest")
    measured = np.divide(mixed, light, out=np.zeros_like(z), where=light > 1e-3)
    # Add axial noise by the pixel's own distance and angle.
    noise_m = sensor.noise_mm(measured, np.minimum(angle, TOF_MAX_ANGLE_RAD)) / 1000
    measured += rng.normal(0.0, 1.0, z.shape) * noise_m
    returns = weight > 0
    faults = {
        Hole.TOO_NEAR: returns & (measured < sensor.nearest_m),
        Hole.TOO_FAR: ~hit.valid | (returns & (measured > sensor.farthest_m)),
        Hole.GRAZING: hit.valid & ~returns,
    }
    if sensor.drops_edges:
        faults[Hole.EDGE] = _edges(z, hit.valid)
    return depth_reading(measured, faults, sensor.least_reflectance / sensor.farthest_m**2)


def _edges(z: F64, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) True at jumps in depth, and beside pixels without depth."""
    high = ndimage.maximum_filter(np.where(valid, z, np.inf), 3, mode="nearest")
    low = ndimage.minimum_filter(np.where(valid, z, np.inf), 3, mode="nearest")
    with np.errstate(invalid="ignore"):
        depth_range = high - low
    return np.asarray(~(depth_range <= _EDGE_SHARE * low))


def incidence_rad(hit: HitRecord, camera: Camera) -> F64:
    """(H, W) angle between each pixel's ray and the normal of its surface."""
    _origin, rays = camera.exact_rays()
    cosine = np.abs(np.einsum("...i,...i->...", hit.geo_normal_world.astype(np.float64), rays))
    return np.asarray(np.arccos(np.clip(cosine / np.linalg.norm(rays, axis=-1), 0, 1)))
