"""The noun Lens: a model, its coefficients, and the maps between plane and direction; no effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.distortion import (
    angle_of_fold,
    directions_of_fisheye,
    distorted,
    fisheye_of_directions,
    largest_radius,
    undistorted,
)
from pbrs_farm.core.panoramas import (
    cubemap_of_directions,
    directions_of_cubemap,
    directions_of_equirect,
    equirect_of_directions,
)

LensModel = Literal["pinhole", "radtan", "opencv", "fisheye", "equirect", "cubemap"]

COEFFICIENTS: Final[Mapping[str, tuple[str, ...]]] = {
    "pinhole": (),
    "radtan": ("k1", "k2", "p1", "p2", "k3"),  # in OpenCV's order
    "opencv": (
        "k1",
        "k2",
        "p1",
        "p2",
        "k3",
        "k4",
        "k5",
        "k6",
        "s1",
        "s2",
        "s3",
        "s4",
        "tau_x",
        "tau_y",
    ),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "equirect": (),
    "cubemap": (),
}
"""Names of each model's coefficients."""

_BROWN: Final = ("radtan", "opencv")
_NUMBERS_OF_OPENCV: Final = (0, 4, 5, 8, 12, 14)


@dataclass(frozen=True, slots=True)
class Lens:
    """Projection of directions to the lens's plane, which K maps to pixels."""

    model: LensModel = "pinhole"
    coefficients: tuple[float, ...] = ()  # by COEFFICIENTS
    max_angle_rad: float = math.pi  # fisheye: of the image circle, from the axis

    @property
    def is_pinhole(self) -> bool:
        """Straight lines stay straight."""
        return self.model == "pinhole"

    @property
    def is_panorama(self) -> bool:
        """All directions are seen."""
        return self.model in ("equirect", "cubemap")

    @property
    def depth_is_planar(self) -> bool:
        """True if depth is z; a model that sees more than half of all directions has the ray's distance."""
        return self.model == "pinhole" or self.bends_lines

    @property
    def bends_lines(self) -> bool:
        """A pinhole with distortion as OpenCV has it: radtan or opencv."""
        return self.model in _BROWN

    @property
    def largest_angle_rad(self) -> float:
        """The widest angle from the axis with an image.

        For a fisheye the image circle or the fold, the nearer one; for a radtan lens its fold, or 90 degrees;
        180 degrees for panoramas.
        """
        if self.model == "fisheye":
            return min(self.max_angle_rad, angle_of_fold(self.coefficients))
        if self.bends_lines:
            return math.atan(largest_radius(self.coefficients))
        return math.pi if self.is_panorama else math.pi / 2

    def directions(self, plane: F64) -> F64:
        """(N, 3) directions, x right, y down, z forward, of points (N, 2) of the plane.

        Of unit depth where depth is planar, else of unit length; (0, 0, 0) where there is no ray.
        """
        if self.model == "fisheye":
            directions = directions_of_fisheye(plane, self.coefficients, self.largest_angle_rad)
        elif self.model == "equirect":
            directions = directions_of_equirect(plane)
        elif self.model == "cubemap":
            directions = directions_of_cubemap(plane)
        else:
            ideal = undistorted(plane, self.coefficients) if self.bends_lines else plane
            directions = np.concatenate([ideal, np.ones((len(plane), 1))], axis=1)
        return np.where(np.isfinite(directions).all(1, keepdims=True), directions, 0.0)

    def plane_points(self, directions: F64) -> F64:
        """(N, 2) points of the plane of directions (N, 3), any length; NaN where none is seen.

        Directions are OpenCV's (x right, y down, z forward). A pinhole and a radtan lens see
        nothing at z <= 1e-9, a fisheye nothing beyond its largest angle; panoramas see everything.
        Multiply by the focal lengths and add the principal point to get pixels.
        """
        if self.model == "fisheye":
            return fisheye_of_directions(directions, self.coefficients, self.largest_angle_rad)
        if self.model == "equirect":
            return equirect_of_directions(directions)
        if self.model == "cubemap":
            return cubemap_of_directions(directions)
        # Only directions before the camera and within the fold have an image.
        z = directions[:, 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            ideal = np.where(z > 1e-9, directions[:, :2] / z, np.nan)
        if self.model == "pinhole":
            return ideal
        with np.errstate(invalid="ignore"):
            in_view = np.linalg.norm(ideal, axis=1) <= largest_radius(self.coefficients)
        return np.where(in_view[:, None], distorted(ideal, self.coefficients), np.nan)

    def table(self) -> dict[str, Any]:
        """The lens as JSON values: model, its coefficients by name, a fisheye's max_angle_rad."""
        names = COEFFICIENTS[self.model]
        rows = {"model": self.model} | dict(zip(names, self.coefficients, strict=True))
        return rows | ({"max_angle_rad": self.max_angle_rad} if self.model == "fisheye" else {})


PINHOLE: Final = Lens()


def lens_from_table(table: Mapping[str, Any]) -> Lens:
    """The lens that Lens.table wrote; KeyError, TypeError or ValueError for another table.

    Other keys are ignored; a missing max_angle_rad is 180 degrees. KeyError for a missing coefficient,
    ValueError for an unknown model or text that is not a number.
    """
    model = table["model"]
    if model not in COEFFICIENTS:
        raise ValueError(f"no lens model {model!r}")
    coefficients = tuple(float(table[name]) for name in COEFFICIENTS[model])
    return Lens(model, coefficients, float(table.get("max_angle_rad", math.pi)))


def lens_of_opencv(numbers: Sequence[float] | F64) -> Lens:
    """The lens of OpenCV's distortion coefficients, in its order; a pinhole if all are 0.

    numbers: 4, 5, 8, 12 or 14, of any shape (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y), of points at z = 1, tau in rad.
    Raises ValueError for another number of them or one that is not finite.

        >>> lens_of_opencv([-0.2, 0.03, 0.001, -0.002]).model
        'radtan'
    """
    values = np.asarray(numbers, np.float64).ravel().tolist()
    if len(values) not in _NUMBERS_OF_OPENCV or not all(map(math.isfinite, values)):
        raise ValueError(f"expected 4, 5, 8, 12 or 14 finite numbers, got {values}")
    if not any(values):
        return PINHOLE
    model: LensModel = "opencv" if any(values[5:]) else "radtan"
    padded = [*values, *([0.0] * _NUMBERS_OF_OPENCV[-1])]
    return Lens(model, tuple(padded[: len(COEFFICIENTS[model])]))
