"""OpenCV's models of distortion and their inverses; arrays in, arrays out, no effects.

With a, b the undistorted point at z = 1 and s = a a + b b its squared radius,

    radial = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)
    x = a radial + 2 p1 a b + p2 (s + 2 a a) + s1 s + s2 s^2
    y = b radial + p1 (s + 2 b b) + 2 p2 a b + s3 s + s4 s^2

and then, where the sensor is tilted by tau_x and tau_y, a projection on its plane. With k1 k2 p1 p2 k3 alone it is the
radial-tangential model (Brown 1966, Conrady 1919); OpenCV's 4, 5, 8, 12 and 14 numbers are the first ones of
COEFFICIENTS["opencv"] in core/lenses.py, the rest is 0.

Fisheye (Kannala and Brandt 2006), k1 k2 k3 k4: a direction at the angle t from the axis falls, on its
own side of the axis, at the radius r = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8). With k = 0 it is the
equidistant fisheye.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from pbrs_farm.core.arrays import F64

Coefficients = tuple[float, ...]

_GRID: Final = 1025  # radii from which Newton's method starts
_STEPS: Final = 30
_RESIDUAL: Final = 1e-10  # of a solution, at z = 1: a ten-millionth of a pixel


class _Terms(NamedTuple):
    """The coefficients of OpenCV's model; shorter ones end with zeros."""

    k1: float
    k2: float
    p1: float
    p2: float
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tau_x: float = 0.0
    tau_y: float = 0.0

    def radial(self, s: F64) -> tuple[F64, F64]:
        """(N,) the factor at squared radii s (N,), and its derivative by s."""
        over = 1 + s * (self.k1 + s * (self.k2 + s * self.k3))
        under = 1 + s * (self.k4 + s * (self.k5 + s * self.k6))
        over_slope = self.k1 + s * (2 * self.k2 + s * 3 * self.k3)
        under_slope = self.k4 + s * (2 * self.k5 + s * 3 * self.k6)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = over / under
            return factor, np.asarray((over_slope - factor * under_slope) / under)

    def tilt(self) -> F64 | None:
        """(3, 3) projection on the tilted sensor; None if it is not tilted."""
        if self.tau_x == self.tau_y == 0:
            return None
        cx, sx, cy, sy = (f(v) for v in (self.tau_x, self.tau_y) for f in (math.cos, math.sin))
        turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ [
            [1, 0, 0],
            [0, cx, sx],
            [0, -sx, cx],
        ]
        z = turn[2, 2]
        return np.asarray([[z, 0, -turn[0, 2]], [0, z, -turn[1, 2]], [0, 0, 1]] @ turn)


def distorted(points: F64, coefficients: Coefficients) -> F64:
    """(N, 2) distorted points of undistorted points (N, 2) at z = 1, by OpenCV's model (head of this module).

    Coefficients: the first 4, 5, 8, 12 or 14 in OpenCV's order, (k1, k2, p1, p2, k3, ...); tau_x, tau_y in rad.
    Beyond `largest_radius` it folds back: callers leave such points out.

        >>> distorted(np.array([[0.5, 0.0]]), (0.2, 0.0, 0.0, 0.0)).round(4).tolist()
        [[0.525, 0.0]]
    """
    terms = _Terms(*coefficients)
    flat, tilt = _on_upright_sensor(points, terms), terms.tilt()
    return flat if tilt is None else _projected(flat, tilt)


def _on_upright_sensor(points: F64, terms: _Terms) -> F64:
    p1, p2, a, b = terms.p1, terms.p2, points[:, 0], points[:, 1]
    s = a * a + b * b
    radial, _slope = terms.radial(s)
    x = a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a) + s * (terms.s1 + s * terms.s2)
    y = b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b + s * (terms.s3 + s * terms.s4)
    return np.stack([x, y], axis=1)


def _projected(points: F64, matrix: F64) -> F64:
    """(N, 2) points at z = 1 by a homography (3, 3); NaN behind it."""
    moved = points @ matrix[:, :2].T + matrix[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(moved[:, 2:] > 0, moved[:, :2] / moved[:, 2:], np.nan)


def undistorted(points: F64, coefficients: Coefficients) -> F64:
    """(N, 2) the inverse of distorted, by Newton's method; NaN without a solution.

    Coefficients as of `distorted`. NaN if Newton's method leaves a residual, the Jacobian has no positive
    determinant, or the solution is beyond `largest_radius`: no ray meets such a point. N may be 0.

        >>> undistorted(np.array([[0.525, 0.0]]), (0.2, 0.0, 0.0, 0.0)).round(9).tolist()
        [[0.5, 0.0]]
    """
    if not len(points):
        return points.copy()
    terms = _Terms(*coefficients)
    tilt = terms.tilt()
    if tilt is not None:
        points = _projected(points, np.asarray(np.linalg.inv(tilt), np.float64))
    # Start at the radius that the radial part alone maps to the point's.
    radius = np.linalg.norm(points, axis=1)
    start = _radius_before(radius, coefficients)
    scale = np.divide(start, radius, out=np.ones_like(radius), where=radius > 0)
    solution = points * scale[:, None]
    for _ in range(_STEPS):
        error = _on_upright_sensor(solution, terms) - points
        xx, xy, yx, yy = _jacobian(solution, terms)
        determinant = xx * yy - xy * yx
        inverse = np.divide(
            1.0, determinant, out=np.zeros_like(determinant), where=np.abs(determinant) > 1e-12
        )
        step_x = (yy * error[:, 0] - xy * error[:, 1]) * inverse
        step_y = (xx * error[:, 1] - yx * error[:, 0]) * inverse
        solution = solution - np.stack([step_x, step_y], axis=1)
        if max(np.abs(step_x).max(), np.abs(step_y).max()) < 1e-15:
            break
    # A point beyond the fold is another point's picture, turned inside out.
    error = np.abs(_on_upright_sensor(solution, terms) - points).max(1)
    xx, xy, yx, yy = _jacobian(solution, terms)
    within = np.linalg.norm(solution, axis=1) <= largest_radius(coefficients)
    good = (error < _RESIDUAL) & (xx > 0) & (xx * yy > xy * yx) & within
    return np.where(good[:, None], solution, np.nan)


def _jacobian(points: F64, terms: _Terms) -> tuple[F64, F64, F64, F64]:
    """dx/da, dx/db, dy/da and dy/db, each (N,), before a tilt, at points (N, 2)."""
    p1, p2, a, b = terms.p1, terms.p2, points[:, 0], points[:, 1]
    s = a * a + b * b
    radial, slope = terms.radial(s)
    prism_x, prism_y = terms.s1 + 2 * s * terms.s2, terms.s3 + 2 * s * terms.s4
    across = 2 * a * b * slope + 2 * p1 * a + 2 * p2 * b
    xx = radial + 2 * a * a * slope + 2 * p1 * b + 6 * p2 * a + 2 * a * prism_x
    yy = radial + 2 * b * b * slope + 6 * p1 * b + 2 * p2 * a + 2 * b * prism_y
    return xx, across + 2 * b * prism_x, across + 2 * a * prism_y, yy


def largest_radius(coefficients: Coefficients) -> float:
    """The radius at z = 1 where the radial part begins to decrease or has a pole; inf if it never does.

    Only k1 to k6 count, so with strong other terms the fold differs a little: `undistorted` also
    checks the Jacobian.
    """
    t = _Terms(*coefficients)
    growth = (1.0, 3 * t.k1, 5 * t.k2, 7 * t.k3)
    if not any((t.k4, t.k5, t.k6)):
        return math.sqrt(first_root(growth))
    over, under = Polynomial([1, t.k1, t.k2, t.k3]), Polynomial([1, t.k4, t.k5, t.k6])
    # The numerator of the derivative of r over(s) / under(s), s = r^2.
    turning = Polynomial(growth) * under - 2 * Polynomial([0, 1]) * over * under.deriv()
    return math.sqrt(min(first_root(tuple(p.coef)) for p in (turning, under)))


def first_root(polynomial: tuple[float, ...]) -> float:
    """The least positive real root of the polynomial c0, c1 ... of 1, s ...; inf without one."""
    roots = np.roots(polynomial[::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-12 * (1 + np.abs(roots))) & (roots.real > 0)]
    return float(real.min()) if len(real) else math.inf


def _radius_before(radius: F64, coefficients: Coefficients) -> F64:
    """(N,) radii that the radial part maps to radius, interpolated; held to the largest."""
    terms = _Terms(*coefficients)

    def mapped(r: F64) -> F64:
        return np.asarray(r * terms.radial(r * r)[0])

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
