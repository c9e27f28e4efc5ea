"""OpenCV's two models of distortion and their inverses; arrays in, arrays out, no effects.

Radial-tangential (Brown 1966, Conrady 1919), k1 k2 p1 p2 k3: with a, b the undistorted point at z = 1
and s = a a + b b its squared radius,

    radial = 1 + k1 s + k2 s^2 + k3 s^3
    x = a radial + 2 p1 a b + p2 (s + 2 a a)
    y = b radial + p1 (s + 2 b b) + 2 p2 a b

Fisheye (Kannala and Brandt 2006), k1 k2 k3 k4: a direction at the angle t from the axis falls, on its
own side of the axis, at the radius r = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8). With k = 0 it is the
equidistant fisheye.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64

Coefficients = tuple[float, ...]

_GRID: Final = 1025  # radii from which Newton's method starts
_STEPS: Final = 30
_RESIDUAL: Final = 1e-10  # of a solution, at z = 1: a ten-millionth of a pixel


def distorted(points: F64, coefficients: Coefficients) -> F64:
    """(N, 2) distorted points of undistorted points (N, 2) at z = 1, by Brown's model (head of this module).

    Coefficients: (k1, k2, p1, p2, k3), OpenCV's order. Beyond `largest_radius` it folds back: callers
    leave such points out.
    """
    k1, k2, p1, p2, k3 = coefficients
    a, b = points[:, 0], points[:, 1]
    s = a * a + b * b
    radial = 1 + s * (k1 + s * (k2 + s * k3))
    x = a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a)
    y = b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b
    return np.stack([x, y], axis=1)


def undistorted(points: F64, coefficients: Coefficients) -> F64:
    """(N, 2) the inverse of distorted, by Newton's method; NaN without a solution.

    Coefficients as of `distorted`. NaN if Newton's method leaves a residual, the Jacobian is not positive
    definite, or the solution is beyond `largest_radius`: no ray meets such a point. N may be 0.
    """
    if not len(points):
        return points.copy()
    # Start at the radius that the radial part alone maps to the point's.
    radius = np.linalg.norm(points, axis=1)
    start = _radius_before(radius, coefficients)
    scale = np.divide(start, radius, out=np.ones_like(radius), where=radius > 0)
    solution = points * scale[:, None]
    # Solve both components; the Jacobian is symmetric.
    for _ in range(_STEPS):
        error = distorted(solution, coefficients) - points
        xx, xy, yy = jacobian(solution, coefficients)
        determinant = xx * yy - xy * xy
        inverse = np.divide(
            1.0, determinant, out=np.zeros_like(determinant), where=np.abs(determinant) > 1e-12
        )
        step_x = (yy * error[:, 0] - xy * error[:, 1]) * inverse
        step_y = (xx * error[:, 1] - xy * error[:, 0]) * inverse
        solution = solution - np.stack([step_x, step_y], axis=1)
        if max(np.abs(step_x).max(), np.abs(step_y).max()) < 1e-15:
            break
    # A point beyond the fold is another point's picture, turned inside out.
    error = np.abs(distorted(solution, coefficients) - points).max(1)
    xx, xy, yy = jacobian(solution, coefficients)
    within = np.linalg.norm(solution, axis=1) <= largest_radius(coefficients)
    good = (error < _RESIDUAL) & (xx > 0) & (xx * yy > xy * xy) & within
    return np.where(good[:, None], solution, np.nan)


def jacobian(points: F64, coefficients: Coefficients) -> tuple[F64, F64, F64]:
    """dx/da, dx/db = dy/da and dy/db of distorted at (N, 2) points.

    Three (N,) float64 arrays, as the matrix is symmetric; coefficients as of `distorted`.
    `undistorted` takes a solution only where it is positive definite.
    """
    k1, k2, p1, p2, k3 = coefficients
    a, b = points[:, 0], points[:, 1]
    s = a * a + b * b
    radial = 1 + s * (k1 + s * (k2 + s * k3))
    slope = k1 + s * (2 * k2 + s * 3 * k3)
    xx = radial + 2 * a * a * slope + 2 * p1 * b + 6 * p2 * a
    xy = 2 * a * b * slope + 2 * p1 * a + 2 * p2 * b
    yy = radial + 2 * b * b * slope + 6 * p1 * b + 2 * p2 * a
    return xx, xy, yy


def largest_radius(coefficients: Coefficients) -> float:
    """The radius at z = 1 where the radial part begins to decrease; inf if it never does.

    Only k1, k2 and k3 count, so with strong tangential terms the fold differs a little: `undistorted` also
    checks the Jacobian.
    """
    k1, k2, _p1, _p2, k3 = coefficients
    return math.sqrt(first_root((1.0, 3 * k1, 5 * k2, 7 * k3)))


def first_root(polynomial: tuple[float, ...]) -> float:
    """The least positive real root of the polynomial c0, c1 ... of 1, s ...; inf without one."""
    roots = np.roots(polynomial[::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-12 * (1 + np.abs(roots))) & (roots.real > 0)]
    return float(real.min()) if len(real) else math.inf


def _radius_before(radius: F64, coefficients: Coefficients) -> F64:
    """(N,) radii that the radial part maps to radius, interpolated; held to the largest."""
    k1, k2, _p1, _p2, k3 = coefficients

    def mapped(r: F64) -> F64:
        s = r * r
        return np.asarray(r * (1 + s * (k1 + s * (k2 + s * k3))))

    # Cover the farthest point: a strong barrel needs more than its own radius.
    end, most = float(radius.max()), largest_radius(coefficients)
    while end < most and mapped(np.array([end]))[0] < radius.max() and end < 1e3:
        end = end * 1.5 + 1e-6
    grid = np.linspace(0.0, min(end, most), _GRID)
    return np.interp(radius, mapped(grid), grid)


_FISHEYE_GRID: Final = 2049  # angles from which Newton's method starts
_FISHEYE_STEPS: Final = 6


def radius_of_angle(angle_rad: F64, coefficients: Coefficients) -> F64:
    """The plane's radius of angles from the axis, in focal lengths (Kannala and Brandt 2006).

    t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8). Beyond `angle_of_fold` the radius shrinks again.
    """
    k1, k2, k3, k4 = coefficients
    s = angle_rad * angle_rad
    return np.asarray(angle_rad * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))))


def angle_of_fold(coefficients: Coefficients) -> float:
    """The angle in rad from which on the radius shrinks; inf where it never does.

    Where the derivative of `radius_of_angle` first is 0. A lens sees up to this angle or its own
    image circle, whichever is less.
    """
    k1, k2, k3, k4 = coefficients
    return math.sqrt(first_root((1.0, 3 * k1, 5 * k2, 7 * k3, 9 * k4)))


def angle_of_radius(radius: F64, coefficients: Coefficients, largest_rad: float) -> F64:
    """(N,) angles in rad of radii (N,), up to largest_rad; NaN for radii beyond its own.

    The inverse of `radius_of_angle` on 0..largest_rad, by a table and Newton's method. largest_rad
    must not lie beyond `angle_of_fold`, where the radius is no longer monotone and the table's
    order breaks.
    """
    k1, k2, k3, k4 = coefficients
    grid = np.linspace(0.0, largest_rad, _FISHEYE_GRID)
    angle = np.interp(radius, radius_of_angle(grid, coefficients), grid)
    # Newton's method from there; at the fold itself the slope is 0 and the start is kept.
    for _ in range(_FISHEYE_STEPS):
        s = angle * angle
        slope = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
        error = radius_of_angle(angle, coefficients) - radius
        step = np.divide(error, slope, out=np.zeros_like(error), where=slope > 1e-9)
        angle = np.clip(angle - step, 0.0, largest_rad)
    end = float(radius_of_angle(np.array(largest_rad), coefficients))
    return np.where(radius <= end * (1 + 1e-12), angle, np.nan)


def directions_of_fisheye(plane: F64, coefficients: Coefficients, largest_rad: float) -> F64:
    """(N, 3) unit directions of points (N, 2) of the plane, OpenCV's axes; NaN beyond largest_rad.

    The plane's unit is the focal length. An angle above 90 degrees has z < 0.
    """
    radius = np.linalg.norm(plane, axis=1)
    angle = angle_of_radius(radius, coefficients, largest_rad)
    # sin(t) / r is 1 on the axis.
    sine = np.divide(np.sin(angle), radius, out=np.ones_like(radius), where=radius > 0)
    return np.concatenate([plane * sine[:, None], np.cos(angle)[:, None]], axis=1)


def fisheye_of_directions(directions: F64, coefficients: Coefficients, largest_rad: float) -> F64:
    """(N, 2) the plane's points of directions (N, 3) of any length, OpenCV's axes; NaN beyond largest_rad."""
    across = np.linalg.norm(directions[:, :2], axis=1)
    angle = np.arctan2(across, directions[:, 2])
    radius = radius_of_angle(angle, coefficients)
    # r / sin(t) stays finite on the axis, where the point is the centre.
    scale = np.divide(radius, across, out=np.zeros_like(radius), where=across > 0)
    return np.where((angle <= largest_rad)[:, None], directions[:, :2] * scale[:, None], np.nan)
