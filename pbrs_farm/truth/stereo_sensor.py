"""The layers depth_sensor_stereo and depth_sensor_d455: depth of stereo cameras with block matching.

No effects. Disparity has noise, is quantised, near edges belongs to the nearer side, and is missing where only the
left camera sees the surface (data sheet of Intel's D400 family; Keselman et al. 2017).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, HitRecord, Mask
from pbrs_farm.core.camera import Camera
from pbrs_farm.truth.sensor_reading import FULL_REFLECTANCE, Hole, Reading, depth_reading

STEREO_DISPARITY_NOISE_PX = 0.08  # standard deviation of sub-pixel matching on a textured wall
STEREO_STEPS_PER_PX = 32  # quantisation of disparity
MAX_DISPARITY_PX = 126.0  # of the search: nearer surfaces have no depth
WINDOW = 5  # px of the sensor's own picture, of a matched block
NOISE_GRAIN_PX = 1.5  # neighbouring blocks overlap: their noise is alike


@dataclass(frozen=True, slots=True)
class StereoSensor:
    """An active stereo camera by its data sheet."""

    width_px: int  # of its picture
    focal_px: float  # of that picture
    baseline_m: float
    farthest_m: float


D435: Final = StereoSensor(848, 447.0, 0.05, 10.0)
"""848 pixels over 87 degrees."""
D455: Final = StereoSensor(848, 455.0, 0.095, 20.0)
"""848 pixels over 86 degrees, twice the baseline: half the D435's noise at a distance."""


def stereo_depth(
    hit: HitRecord, camera: Camera, *, seed: int, sensor: StereoSensor = D435
) -> NDArray[np.uint16]:
    """(H, W) uint16 measured mm, 0 = none."""
    return stereo_reading(hit, camera, seed=seed, sensor=sensor).depth_mm


def stereo_reading(
    hit: HitRecord, camera: Camera, *, seed: int, sensor: StereoSensor = D435
) -> Reading:
    """Measured depth, noise by seed, and reasons for holes; without untextured walls, patterns, glass."""
    # A block takes its nearest depth: objects grow by half a block.
    rng = np.random.default_rng(seed)
    size = max(round(WINDOW * hit.face.shape[1] / sensor.width_px) | 1, 3)
    z = np.where(hit.valid, hit.depth_z.astype(np.float64), np.inf)
    fattened = ndimage.minimum_filter(z, size=size, mode="nearest")
    hidden = _hidden_from_right(fattened, camera, sensor.baseline_m)
    # Add noise of the blocks' grain to the disparity, quantise it, and turn it back into depth.
    grain = ndimage.gaussian_filter(rng.normal(0.0, 1.0, z.shape), NOISE_GRAIN_PX, mode="wrap")
    grain /= max(float(grain.std()), 1e-9)
    scale = sensor.focal_px * sensor.baseline_m
    with np.errstate(divide="ignore"):
        disparity = scale / fattened + STEREO_DISPARITY_NOISE_PX * grain
        measured = scale / (np.rint(disparity * STEREO_STEPS_PER_PX) / STEREO_STEPS_PER_PX)
    is_hit, is_near = np.isfinite(fattened), disparity > MAX_DISPARITY_PX
    in_reach = (measured > 0) & (measured <= sensor.farthest_m)
    faults = {
        Hole.TOO_NEAR: is_hit & is_near,
        Hole.TOO_FAR: ~is_hit | (~is_near & ~in_reach),
        Hole.SHADOW: is_hit & hidden,
    }

    def measured_by_block(mask: Mask) -> Mask:
        nearest = ndimage.minimum_filter(np.where(mask, z, np.inf), size=size, mode="nearest")
        return np.asarray(is_hit & (nearest == fattened))

    least_return = FULL_REFLECTANCE / sensor.farthest_m**2
    return depth_reading(measured, faults, least_return, measured_by_block)


def _hidden_from_right(z: F64, camera: Camera, baseline_m: float) -> Mask:
    """(H, W) bool: the right camera does not see the point: beyond its picture, or behind another."""
    with np.errstate(divide="ignore"):
        shift = np.where(np.isfinite(z), camera.intrinsics.fx * baseline_m / z, 0.0)
    columns = np.arange(z.shape[1]) - shift
    # A point on a row is hidden where something on its right has moved past it.
    leftmost = np.minimum.accumulate(columns[:, ::-1], axis=1)[:, ::-1]
    return np.asarray((columns > leftmost + 0.5) | (columns < -0.5))
