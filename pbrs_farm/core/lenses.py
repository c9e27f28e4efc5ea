"""The noun Lens: a model, its coefficients, and the maps between plane and direction; no effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64

# OpenCV's radial-tangential distortion (Brown 1966, Conrady 1919): k1 k2 p1 p2 k3.
# With a, b the undistorted point at z = 1 and s = a a + b b its squared radius:
#     radial = 1 + k1 s + k2 s^2 + k3 s^3
#     x = a radial + 2 p1 a b + p2 (s + 2 a a)
#     y = b radial + p1 (s + 2 b b) + 2 p2 a b


Coefficients = tuple[float, ...]

_GRID: Final = 1025  # radii from which Newton's method starts
_STEPS: Final = 30
_RESIDUAL: Final = 1e-10  # of a solution, at z = 1: a ten-millionth of a pixel


def distorted(points: F64, coefficients: Coefficients) -> F64:
    """(N, 2) points in the plane of undistorted points (N, 2) at z = 1."""
    k1, k2, p1, p2, k3 = coefficients
    a, b = points[:, 0], points[:, 1]
    s = a * a + b * b
    radial = 1 + s * (k1 + s * (k2 + s * k3))
    x = a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a)
    y = b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b
    return np.stack([x, y], axis=1)


def undistorted(points: F64, coefficients: Coefficients) -> F64:
    """(N, 2) the inverse of distorted, by Newton's method; NaN where no undistorted point is."""
    if not len(points):
        return points.copy()
    # Start at the radius that the radial part alone maps to the point's.
    radius = np.linalg.norm(points, axis=1)
    start = _radius_before(radius, coefficients)
    scale = np.divide(start, radius, out=np.ones_like(radius), where=radius > 0)
    found = points * scale[:, None]
    # Solve both components; the Jacobian is symmetric.
    for _ in range(_STEPS):
        error = distorted(found, coefficients) - points
        xx, xy, yy = jacobian(found, coefficients)
        determinant = xx * yy - xy * xy
        inverse = np.divide(
            1.0, determinant, out=np.zeros_like(determinant), where=np.abs(determinant) > 1e-12
        )
        step_x = (yy * error[:, 0] - xy * error[:, 1]) * inverse
        step_y = (xx * error[:, 1] - xy * error[:, 0]) * inverse
        found = found - np.stack([step_x, step_y], axis=1)
        if max(np.abs(step_x).max(), np.abs(step_y).max()) < 1e-15:
            break
    # A point beyond the fold is another point's picture, turned inside out.
    error = np.abs(distorted(found, coefficients) - points).max(1)
    xx, xy, yy = jacobian(found, coefficients)
    within = np.linalg.norm(found, axis=1) <= largest_radius(coefficients)
    good = (error < _RESIDUAL) & (xx > 0) & (xx * yy > xy * xy) & within
    return np.where(good[:, None], found, np.nan)


def jacobian(points: F64, coefficients: Coefficients) -> tuple[F64, F64, F64]:
    """dx/da, dx/db = dy/da and dy/db of distorted at (N, 2) points."""
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
    """The radius at z = 1 from which on the radial part runs back inwards; inf where it never does."""
    k1, k2, _p1, _p2, k3 = coefficients
    return math.sqrt(first_root((1.0, 3 * k1, 5 * k2, 7 * k3)))


def first_root(polynomial: tuple[float, ...]) -> float:
    """The least positive real root of the polynomial, constant first; inf where it has none."""
    roots = np.roots(polynomial[::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-12 * (1 + np.abs(roots))) & (roots.real > 0)]
    return float(real.min()) if len(real) else math.inf


def _radius_before(radius: F64, coefficients: Coefficients) -> F64:
    """(N,) radii that the radial part maps to radius, interpolated; held to the largest."""
    k1, k2, _p1, _p2, k3 = coefficients

    def mapped(r: F64) -> F64:
        s = r * r
        return np.asarray(r * (1 + s * (k1 + s * (k2 + s * k3))))

    # Reach as far as the farthest point needs: a strong barrel needs more than its own radius.
    end, most = float(radius.max()), largest_radius(coefficients)
    while end < most and mapped(np.array([end]))[0] < radius.max() and end < 1e3:
        end = end * 1.5 + 1e-6
    grid = np.linspace(0.0, min(end, most), _GRID)
    return np.interp(radius, mapped(grid), grid)


# OpenCV's fisheye model (Kannala and Brandt 2006): k1 k2 k3 k4.
# A direction at the angle t from the axis falls at the radius
#     r = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)
# of the plane, on its own side of the axis. With k = 0 it is the equidistant fisheye.


_FISHEYE_GRID: Final = 2049  # angles from which Newton's method starts
_FISHEYE_STEPS: Final = 6


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


# Panoramas of all directions: equirectangular, and a cube map as a strip of six faces.
# Equirectangular: the plane is (longitude, latitude downwards) in rad; the middle looks forward.
# Cube map: face k covers 2 k - 1 <= x < 2 k + 1, -1 <= y < 1 of the plane; each face is a pin-
# hole picture of 90 degrees. The faces are front, right, back, left, up, down: the first four go
# round; the lower edge of `up` and the upper edge of `down` adjoin the front.


FACE_NAMES: Final = ("front", "right", "back", "left", "up", "down")

# Rows of each face: its right, down and forward in the camera's axes (OpenCV's).
FACE_AXES: Final[F64] = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    ],
    np.float64,
)


def directions_of_equirect(plane: F64) -> F64:
    """(N, 3) unit directions of (longitude, latitude downwards) (N, 2); NaN beyond the poles."""
    longitude, latitude = plane[:, 0], plane[:, 1]
    level = np.cos(latitude)
    found = np.stack(
        [level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude)], axis=1
    )
    return np.where((np.abs(latitude) <= np.pi / 2)[:, None], found, np.nan)


def equirect_of_directions(directions: F64) -> F64:
    """(N, 2) longitude in -pi..pi and latitude downwards of directions (N, 3) of any length."""
    x, y, z = directions.T
    return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=1)


def directions_of_cubemap(plane: F64) -> F64:
    """(N, 3) unit directions of points (N, 2) of the strip; NaN beside it."""
    number = np.floor((plane[:, 0] + 1) / 2)
    inside = (number >= 0) & (number < 6) & (np.abs(plane[:, 1]) <= 1)
    axes = FACE_AXES[np.where(inside, number, 0).astype(np.int64)]
    # The point of the face at unit depth, in the camera's axes.
    right = (plane[:, 0] - 2 * number)[:, None] * axes[:, 0]
    point = right + plane[:, 1:] * axes[:, 1] + axes[:, 2]
    point /= np.linalg.norm(point, axis=1, keepdims=True)
    return np.where(inside[:, None], point, np.nan)


def cubemap_of_directions(directions: F64) -> F64:
    """(N, 2) the strip's points of directions (N, 3) of any length, on the face that sees each."""
    number = np.argmax(directions @ FACE_AXES[:, 2].T, axis=1)
    local = np.einsum("nij,nj->ni", FACE_AXES[number], directions)
    with np.errstate(divide="ignore", invalid="ignore"):
        point = local[:, :2] / local[:, 2:]
    point[:, 0] += 2 * number
    return np.asarray(point)


# The noun Lens.


LensModel = Literal["pinhole", "radtan", "fisheye", "equirect", "cubemap"]

COEFFICIENTS: Final[Mapping[str, tuple[str, ...]]] = {
    "pinhole": (),
    "radtan": ("k1", "k2", "p1", "p2", "k3"),  # in OpenCV's order
    "fisheye": ("k1", "k2", "k3", "k4"),
    "equirect": (),
    "cubemap": (),
}
"""Names of each model's coefficients."""


@dataclass(frozen=True, slots=True)
class Lens:
    """How directions fall on the picture's plane; K then says where that is in pixels."""

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
        """Depth is z along the optical axis; else the distance along the ray.

        A model that sees more than half of all directions has no z that could be stored.
        """
        return self.model in ("pinhole", "radtan")

    @property
    def largest_angle_rad(self) -> float:
        """The angle from the axis beyond which nothing is seen."""
        if self.model == "fisheye":
            return min(self.max_angle_rad, angle_of_fold(self.coefficients))
        if self.model == "radtan":
            return math.atan(largest_radius(self.coefficients))
        return math.pi if self.is_panorama else math.pi / 2

    def directions(self, plane: F64) -> F64:
        """(N, 3) directions, x right, y down, z forward, of points (N, 2) of the plane.

        Of unit depth where depth is planar, else of unit length; (0, 0, 0) where there is no ray.
        """
        if self.model == "fisheye":
            found = directions_of_fisheye(plane, self.coefficients, self.largest_angle_rad)
        elif self.model == "equirect":
            found = directions_of_equirect(plane)
        elif self.model == "cubemap":
            found = directions_of_cubemap(plane)
        else:
            ideal = undistorted(plane, self.coefficients) if self.model == "radtan" else plane
            found = np.concatenate([ideal, np.ones((len(plane), 1))], axis=1)
        return np.where(np.isfinite(found).all(1, keepdims=True), found, 0.0)

    def plane_points(self, directions: F64) -> F64:
        """(N, 2) points of the plane of directions (N, 3), any length; NaN where none is seen."""
        if self.model == "fisheye":
            return fisheye_of_directions(directions, self.coefficients, self.largest_angle_rad)
        if self.model == "equirect":
            return equirect_of_directions(directions)
        if self.model == "cubemap":
            return cubemap_of_directions(directions)
        # Only what lies before the camera, and within the fold, has a picture.
        z = directions[:, 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            ideal = np.where(z > 1e-9, directions[:, :2] / z, np.nan)
        if self.model == "pinhole":
            return ideal
        with np.errstate(invalid="ignore"):
            seen = np.linalg.norm(ideal, axis=1) <= largest_radius(self.coefficients)
        return np.where(seen[:, None], distorted(ideal, self.coefficients), np.nan)

    def table(self) -> dict[str, Any]:
        """The lens as JSON values: model, its coefficients by name, a fisheye's max_angle_rad."""
        names = COEFFICIENTS[self.model]
        rows = {"model": self.model} | dict(zip(names, self.coefficients, strict=True))
        return rows | ({"max_angle_rad": self.max_angle_rad} if self.model == "fisheye" else {})


PINHOLE: Final = Lens()


def lens_from_table(table: Mapping[str, Any]) -> Lens:
    """The lens that Lens.table wrote; KeyError, TypeError or ValueError when it is none."""
    model = table["model"]
    if model not in COEFFICIENTS:
        raise ValueError(f"no lens model {model!r}")
    coefficients = tuple(float(table[name]) for name in COEFFICIENTS[model])
    return Lens(model, coefficients, float(table.get("max_angle_rad", math.pi)))


# Pin-hole pictures that together hold what a lens sees, and the lens's picture from theirs.
# For what only draws pin-holes: one wider picture where it fits, else the faces of a cube.


_WIDEST_COS: Final = np.cos(np.radians(60))  # beyond it one picture would waste its corners
_FINER: Final = 1.5  # pixels of a face across one of the lens's finest
_MAX_FOCAL_PX: Final = 1536.0
_MARGIN_PX: Final = 2  # so that a seam of two faces is interpolated within either


@dataclass(frozen=True, slots=True)
class PinholeFace:
    """A pin-hole picture with square pixels."""

    axes: F64  # (3, 3) rows: its right, down and forward in the camera's axes (OpenCV's)
    width_px: int
    height_px: int
    focal_px: float
    cx: float
    cy: float


@dataclass(frozen=True, slots=True, eq=False)
class PinholeFaces:
    """The faces, and where each pixel of the lens's picture lies in them."""

    faces: tuple[PinholeFace, ...]
    number: NDArray[np.int64]  # (H, W) index into faces, -1 = the pixel has no ray
    x: F64  # (H, W) pixel coordinates there
    y: F64

    def nearest(self, pictures: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """(H, W, ...) the lens's picture by the nearest pixel; 0 where there is no ray."""
        out = np.zeros((*self.number.shape, *pictures[0].shape[2:]), pictures[0].dtype)
        for k, picture in enumerate(pictures):
            at = self.number == k
            column = np.floor(self.x[at]).astype(np.int64).clip(0, picture.shape[1] - 1)
            row = np.floor(self.y[at]).astype(np.int64).clip(0, picture.shape[0] - 1)
            out[at] = picture[row, column]
        return out

    def bilinear(self, pictures: Sequence[NDArray[np.floating]]) -> NDArray[np.float32]:
        """(H, W, C) the lens's picture of (h, w, C) pictures; 0 where there is no ray."""
        out = np.zeros((*self.number.shape, pictures[0].shape[2]), np.float32)
        for k, picture in enumerate(pictures):
            at = self.number == k
            # Pixel centres lie at +0.5; a border repeats itself.
            left = np.clip(self.x[at] - 0.5, 0, picture.shape[1] - 1.000001)
            top = np.clip(self.y[at] - 0.5, 0, picture.shape[0] - 1.000001)
            column, row = left.astype(np.int64), top.astype(np.int64)
            across, down = (left - column)[:, None], (top - row)[:, None]
            upper = picture[row, column] * (1 - across) + picture[row, column + 1] * across
            lower = picture[row + 1, column] * (1 - across) + picture[row + 1, column + 1] * across
            out[at] = upper * (1 - down) + lower * down
        return out


def faces_of_directions(directions: F64) -> PinholeFaces:
    """The faces that hold all rays of a picture: (H, W, 3), OpenCV's axes, any length, 0 = no ray."""
    length = np.linalg.norm(directions, axis=-1)
    has_ray = length > 0
    unit = directions / np.where(has_ray, length, 1.0)[..., None]
    focal = min(_FINER / _finest_angle(unit, has_ray), _MAX_FOCAL_PX)
    if unit[has_ray][:, 2].min() > _WIDEST_COS:
        return _one_face(unit, has_ray, focal)
    return _cube_faces(unit, has_ray, focal)


def _finest_angle(unit: F64, has_ray: NDArray[np.bool_]) -> float:
    """The angle in rad between neighbours where they are nearest, but for the nearest twentieth."""
    # Of rows and columns the farther: near a panorama's poles the columns meet.
    down = np.linalg.norm(np.diff(unit, axis=0), axis=-1)[:, :-1]
    across = np.linalg.norm(np.diff(unit, axis=1), axis=-1)[:-1]
    inside = has_ray[:-1, :-1] & has_ray[1:, :-1] & has_ray[:-1, 1:]
    return max(float(np.percentile(np.maximum(down, across)[inside], 5)), 1e-5)


def _one_face(unit: F64, has_ray: NDArray[np.bool_], focal: float) -> PinholeFaces:
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = unit[..., 0] / unit[..., 2], unit[..., 1] / unit[..., 2]
    low = np.array([x[has_ray].min(), y[has_ray].min()])
    high = np.array([x[has_ray].max(), y[has_ray].max()])
    width, height = (int(n) for n in np.ceil((high - low) * focal) + 2 * _MARGIN_PX)
    cx, cy = _MARGIN_PX - low * focal
    face = PinholeFace(FACE_AXES[0], width, height, focal, float(cx), float(cy))
    return PinholeFaces((face,), np.where(has_ray, 0, -1), x * focal + cx, y * focal + cy)


def _cube_faces(unit: F64, has_ray: NDArray[np.bool_], focal: float) -> PinholeFaces:
    side = 2 * (int(np.ceil(focal)) + _MARGIN_PX)
    number = np.where(has_ray, np.argmax(unit @ FACE_AXES[:, 2].T, axis=-1), -1)
    # Keep the faces that a pixel looks into.
    used = np.unique(number[number >= 0])
    index = np.full(len(FACE_AXES) + 1, -1)
    index[used] = np.arange(len(used))
    x, y = np.zeros(number.shape), np.zeros(number.shape)
    for k in used:
        at = number == k
        local = unit[at] @ FACE_AXES[k].T
        x[at], y[at] = (local[:, :2] / local[:, 2:] * focal + side / 2).T
    faces = tuple(PinholeFace(FACE_AXES[k], side, side, focal, side / 2, side / 2) for k in used)
    return PinholeFaces(faces, index[number], x, y)
