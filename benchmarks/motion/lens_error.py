"""Pixels of 10,000 points by Camera.pixels_of against OpenCV's projection, for each lens model.

With cv2 installed its own projectPoints and fisheye.projectPoints judge; without it the formulas of
OpenCV's documentation, written out here point by point. Panoramas, which
OpenCV has not, are judged by their definition. `lens_judge` says which it was.
"""

from __future__ import annotations

import math
from importlib.util import find_spec
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.optics_fields import LensFields

N_POINTS: Final = 10_000
PINHOLE: Final = Intrinsics.from_hfov(640, 480)
LENSES: Final = {
    "pinhole": LensFields(fx=525, fy=520, cx=310, cy=251),
    "radtan": LensFields(preset="kinect"),
    "radtan_barrel": LensFields(model="radtan", k1=-0.25, k2=0.06, p1=1e-3, p2=-2e-3, k3=-0.004),
    "fisheye": LensFields(preset="tum_vi"),
    "fisheye180": LensFields(preset="fisheye180"),
    "equirect": LensFields(model="equirect"),
    "cubemap": LensFields(model="cubemap"),
}


def figures() -> dict[str, Any]:
    """The largest error in px over all models, each model's own, and what judged."""
    errors = {name: _error(name) for name in LENSES}
    judge = "cv2" if find_spec("cv2") else "OpenCV's documented formulas"
    return {
        "lens_error_px": max(errors.values()),
        **{f"lens_error_px_{name}": error for name, error in errors.items()},
        "lens_judge": judge,
    }


def _error(name: str) -> float:
    """The largest distance in px of the two projections of points that the lens sees."""
    rng = np.random.default_rng(0)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_y(0.8), (1.0, 1.5, -2.0)
    camera = Camera(LENSES[name].intrinsics(PINHOLE), pose)
    i = camera.intrinsics
    # Points at 0.3 to 10 m on rays through places all over the picture, not on pixel centres.
    places = rng.random((3 * N_POINTS, 2)) * [i.width_px, i.height_px]
    directions = i.directions(places)
    directions = directions[directions.any(1)][:N_POINTS]
    local = directions * rng.uniform(0.3, 10, (len(directions), 1))
    world = (local * [1, -1, -1]) @ pose[:3, :3].T + pose[:3, 3]
    ours = camera.pixels_of(world)
    theirs = _by_formula(local, i)
    judged = _by_cv2(local, i) if find_spec("cv2") else None
    if judged is not None:
        # cv2 divides by z, so that it mirrors what lies beyond 90 degrees: there the formula judges.
        ahead = local[:, 2] > 0
        theirs[ahead] = judged[ahead]
    return float(np.linalg.norm(ours - theirs, axis=1).max())


def _by_cv2(local: F64, i: Intrinsics) -> F64 | None:
    """(N, 2) px by OpenCV itself; None for a model that it has not."""
    import cv2

    zero, k = np.zeros(3), np.array(i.lens.coefficients)
    if i.lens.model in ("pinhole", "radtan"):
        return np.asarray(cv2.projectPoints(local, zero, zero, i.k, k)[0]).reshape(-1, 2)
    if i.lens.model == "fisheye":
        return np.asarray(cv2.fisheye.projectPoints(local[:, None], zero, zero, i.k, k)[0]).reshape(
            -1, 2
        )
    return None


def _by_formula(local: F64, i: Intrinsics) -> F64:
    """(N, 2) px, one point after the other."""
    project = {
        "pinhole": lambda x, y, z: (x / z, y / z),
        "radtan": lambda x, y, z: _radtan(x / z, y / z, *i.lens.coefficients),
        "fisheye": lambda x, y, z: _fisheye(x, y, z, i.lens.coefficients),
        "equirect": lambda x, y, z: (math.atan2(x, z), math.asin(y / math.hypot(x, y, z))),
        "cubemap": _cubemap,
    }[i.lens.model]
    plane = [project(*(float(v) for v in point)) for point in local]
    return np.array([(i.fx * a + i.cx, i.fy * b + i.cy) for a, b in plane], np.float64)


def _radtan(
    a: float, b: float, k1: float, k2: float, p1: float, p2: float, k3: float
) -> tuple[float, float]:
    """docs.opencv.org, "Camera Calibration and 3D Reconstruction", detailed description."""
    r2 = a**2 + b**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return (
        a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a**2),
        b * radial + p1 * (r2 + 2 * b**2) + 2 * p2 * a * b,
    )


def _fisheye(x: float, y: float, z: float, k: tuple[float, ...]) -> tuple[float, float]:
    """docs.opencv.org, "Fisheye camera model", whose a, b are x / z, y / z; beyond 90 degrees by angle."""
    r = math.hypot(x, y)
    theta = math.atan2(r, z)
    bent = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)
    return (bent / r * x, bent / r * y) if r else (0.0, 0.0)


def _cubemap(x: float, y: float, z: float) -> tuple[float, float]:
    """The face of the largest component: front, right, back, left, up, down."""
    size = max(abs(x), abs(y), abs(z))
    if size == abs(z):
        return (x / z, y / z) if z > 0 else (4 + x / z, -y / z)
    if size == abs(x):
        return (2 - z / x, y / x) if x > 0 else (6 - z / x, -y / x)
    return (10 + x / y, -z / y) if y > 0 else (8 - x / y, -z / y)


if __name__ == "__main__":
    for figure, value in figures().items():
        print(figure, value)
