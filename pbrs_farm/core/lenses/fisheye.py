"""OpenCV's fisheye model (Kannala and Brandt 2006): k1 k2 k3 k4; no effects.

A direction at the angle t from the axis falls at the radius

    r = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)

of the plane, on its own side of the axis. With k = 0 it is the equidistant fisheye.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.lenses.radial_tangential import Coefficients, first_root

_GRID: Final = 2049  # angles from which Newton's method starts
_STEPS: Final = 6


def radius_of_angle(angle_rad: F64, coefficients: Coefficients) -> F64:
    """The plane's radius of angles from the axis, of any shape."""
    k1, k2, k3, k4 = coefficients
    s = angle_rad * angle_rad
    return np.asarray(angle_rad * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))))


def angle_of_fold(coefficients: Coefficients) -> float:
    """The angle in rad from which on the radius shrinks; inf where it never does."""
    k1, k2, k3, k4 = coefficients
    return math.sqrt(first_root((1.0, 3 * k1, 5 * k2, 7 * k3, 9 * k4)))


def angle_of_radius(radius: F64, coefficients: Coefficients, largest_rad: float) -> F64:
    """(N,) angles in rad of radii (N,), up to largest_rad; NaN for radii beyond its own."""
    k1, k2, k3, k4 = coefficients
    grid = np.linspace(0.0, largest_rad, _GRID)
    angle = np.interp(radius, radius_of_angle(grid, coefficients), grid)
    # Newton's method from there; at the fold itself the slope is 0 and the start is kept.
    for _ in range(_STEPS):
        s = angle * angle
        slope = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
        error = radius_of_angle(angle, coefficients) - radius
        step = np.divide(error, slope, out=np.zeros_like(error), where=slope > 1e-9)
        angle = np.clip(angle - step, 0.0, largest_rad)
    end = float(radius_of_angle(np.array(largest_rad), coefficients))
    return np.where(radius <= end * (1 + 1e-12), angle, np.nan)


def directions_of_fisheye(plane: F64, coefficients: Coefficients, largest_rad: float) -> F64:
    """(N, 3) unit directions of points (N, 2) of the plane; NaN beyond largest_rad."""
    radius = np.linalg.norm(plane, axis=1)
    angle = angle_of_radius(radius, coefficients, largest_rad)
    # sin(t) / r is 1 on the axis.
    sine = np.divide(np.sin(angle), radius, out=np.ones_like(radius), where=radius > 0)
    return np.concatenate([plane * sine[:, None], np.cos(angle)[:, None]], axis=1)


def fisheye_of_directions(directions: F64, coefficients: Coefficients, largest_rad: float) -> F64:
    """(N, 2) the plane's points of directions (N, 3) of any length; NaN beyond largest_rad."""
    across = np.linalg.norm(directions[:, :2], axis=1)
    angle = np.arctan2(across, directions[:, 2])
    radius = radius_of_angle(angle, coefficients)
    # r / sin(t) stays finite on the axis, where the point is the centre.
    scale = np.divide(radius, across, out=np.zeros_like(radius), where=across > 0)
    return np.where((angle <= largest_rad)[:, None], directions[:, :2] * scale[:, None], np.nan)
