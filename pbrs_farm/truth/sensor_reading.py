"""A depth sensor's picture and, in the layers depth_hole, why pixels have no reading; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, HitRecord, Mask
from pbrs_farm.core.camera import Camera


class Hole(IntEnum):
    """Values of the layers depth_hole; the first reason in the order of HOLE_ORDER counts."""

    READING = 0  # no hole
    CLEAR = 1  # glass or a pane first
    MIRROR = 2
    TOO_DARK = 3  # too little light returns
    TOO_NEAR = 4
    TOO_FAR = 5  # or nothing there
    GRAZING = 6
    SHADOW = 7  # hidden from the emitter or from the second camera
    EDGE = 8  # both sides of a depth edge reach the pixel


HOLE_ORDER = (
    Hole.CLEAR,
    Hole.MIRROR,
    Hole.TOO_NEAR,
    Hole.TOO_FAR,
    Hole.GRAZING,
    Hole.SHADOW,
    Hole.EDGE,
    Hole.TOO_DARK,
)
# Assumed reflectance of the darkest surface measured at full reach. The data sheet of the Azure Kinect gives its
# range for 15 to 95 % at 850 nm; for the others no source was found.
FULL_REFLECTANCE, LOW_REFLECTANCE = 0.95, 0.15


@dataclass(frozen=True, eq=False)
class Reading:
    """One picture of a depth sensor.

    depth_mm: (H, W) planar z, 0 = no measurement. faults: reason -> (H, W) pixels without a measurement. measured:
    moves a mask (H, W) of the hit's pixels to the pixels that measure them. least_return: share of light times m^2,
    below which a surface is too dark.
    """

    depth_mm: NDArray[np.uint16]
    faults: Mapping[Hole, Mask]
    measured: Callable[[Mask], Mask]
    least_return: float


def depth_reading(
    depth_m: F64,
    faults: Mapping[Hole, Mask],
    least_return: float,
    measured: Callable[[Mask], Mask] = lambda mask: mask,
) -> Reading:
    """The Reading of measured depths (H, W) in m, which are 0 where any fault is True."""
    good = ~np.logical_or.reduce(list(faults.values()))
    depth_mm = np.where(good, np.rint(np.where(good, depth_m, 0) * 1000), 0).astype(np.uint16)
    return Reading(depth_mm, faults, measured, least_return)


def hole_label(
    reading: Reading, hit: HitRecord, camera: Camera, clear: Mask, mirror: Mask, reflectance: F64
) -> NDArray[np.uint8]:
    """(H, W) uint8 values of Hole; a sensor sees neither through glass nor in mirrors.

    clear, mirror: (H, W) materials of the hits; reflectance: (H, W) 0..1 of infrared light. The light that returns is
    reflectance times the cosine of incidence over the squared distance.
    """
    _origin, rays = camera.exact_rays()
    length = np.linalg.norm(rays, axis=-1)
    cosine = np.abs(np.einsum("...i,...i->...", hit.geo_normal_world.astype(np.float64), rays))
    distance = np.where(hit.valid, hit.depth_z, 1) * length
    dark = reflectance * cosine / length < reading.least_return * distance**2
    faults = {
        **reading.faults,
        Hole.CLEAR: reading.measured(clear),
        Hole.MIRROR: reading.measured(mirror),
        Hole.TOO_DARK: reading.measured(hit.valid & dark),
    }
    reasons = [reason for reason in HOLE_ORDER if reason in faults]
    return np.select([faults[r] for r in reasons], [np.uint8(r) for r in reasons], np.uint8(0))
