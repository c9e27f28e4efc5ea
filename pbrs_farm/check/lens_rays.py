"""Rays and projections of cameras and lenses, written again for `verify` from the published formulas; no effects.

Shares no code with the stages. OpenCV's documentation gives radtan, opencv and fisheye; they are inverted by
bisection of the radius and by fixed-point steps for the tangential and prism parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.axes import into_frame
from pbrs_farm.core.arrays import F64

_BENT = ("radtan", "opencv")  # pinholes with distortion
_HALVINGS = 60
_FARTHEST_FOLD = 50.0  # radius at z = 1, within which a fold is looked for
# Right, down and forward of the faces front, right, back, left, up and down.
_CUBE = np.array(
    [
        np.diag([1.0, 1, 1]), [[0, 0, -1], [0, 1, 0], [1, 0, 0]], np.diag([-1, 1, -1]),
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    ]
)  # fmt: skip
_STEPS = 200  # of the fixed point; a third of a pixel of tangential part needs few


@dataclass(frozen=True, slots=True)
class StoredLens:
    """The "lens" of a view.json."""

    model: str
    k: tuple[float, ...]  # radial: k1 k2 k3, of a fisheye k1 k2 k3 k4
    p: tuple[float, float]  # tangential
    limit: float  # largest angle in rad
    divisor: tuple[float, ...] = ()  # opencv: k4 k5 k6
    prism: tuple[float, ...] = (0.0,) * 4  # s1 s2 s3 s4
    tau: tuple[float, float] = (0.0, 0.0)  # tilt, rad

    @staticmethod
    def of(table: dict[str, Any]) -> StoredLens:
        """From view.json; KeyError or ValueError for an unknown lens. Views of a pinhole have no table."""
        model = table["model"]
        if model not in (*_BENT, "fisheye", "equirect", "cubemap"):
            raise ValueError(f"no lens model {model!r}")

        def numbers(*names: str) -> tuple[float, ...]:
            return tuple(float(table[name]) for name in names)

        radial = ("k1", "k2", "k3", "k4")[: {"fisheye": 4, "radtan": 3, "opencv": 3}.get(model, 0)]
        k = numbers(*radial)
        p = numbers("p1", "p2") if model in _BENT else (0.0, 0.0)
        limit = float(table.get("max_angle_rad", np.pi))
        if model != "opencv":
            return StoredLens(model, k, (p[0], p[1]), limit)
        tau_x, tau_y = numbers("tau_x", "tau_y")
        divisor, prism = numbers("k4", "k5", "k6"), numbers("s1", "s2", "s3", "s4")
        return StoredLens(model, k, (p[0], p[1]), limit, divisor, prism, (tau_x, tau_y))

    def rays(self, plane: F64) -> F64:
        """(N, 3) directions with OpenCV's axes of points (N, 2) of the plane.

        Of unit depth for radtan and opencv; of unit length for the others, whose depth is the distance.
        (0, 0, 0) beyond the image circle of a fisheye.
        """
        if self.model == "equirect":
            longitude, latitude = plane.T
            horizontal = np.cos(latitude)
            parts = [
                np.sin(longitude) * horizontal,
                np.sin(latitude),
                np.cos(longitude) * horizontal,
            ]
            return np.stack(parts, axis=1)
        if self.model == "cubemap":
            return _cube_rays(plane)
        if self.model in _BENT:
            ideal = self._undistorted(
                _through(plane, np.asarray(np.linalg.inv(self._tilt()), np.float64))
            )
            return np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
        # A fisheye: the angle whose radius is the point's, none beyond the image circle.
        radius = np.hypot(plane[:, 0], plane[:, 1])
        most = self._turn(self.limit)
        angle = self._inverse(radius, most)
        turn = np.arctan2(plane[:, 1], plane[:, 0])
        parts = [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)]
        visible = radius <= self._radial(np.array([most]))[0]
        return np.where(visible[:, None], np.stack(parts, axis=1), 0.0)

    def plane_and_depth(self, points: F64) -> tuple[F64, F64]:
        """(N, 2) of the plane and (N,) depth of points (N, 3) in the camera's frame; NaN = not visible.

        Depth is z for radtan and opencv and the distance for the others, as the layers store it.
        """
        x, y, z = points.T
        distance = np.sqrt(x * x + y * y + z * z)
        if self.model == "equirect":
            return np.stack([np.arctan2(x, z), np.arcsin(y / distance)], axis=1), distance
        if self.model == "cubemap":
            return _cube_plane(points), distance
        if self.model in _BENT:
            depth = np.where(z > 0, z, np.nan)
            ideal = points[:, :2] / depth[:, None]
            fold = self._turn(_FARTHEST_FOLD)
            beyond = (np.hypot(x, y) > fold * z) & (fold < _FARTHEST_FOLD)
            ideal = np.where(beyond[:, None], np.nan, ideal)
            return _through(self._distorted(ideal), self._tilt()), depth
        angle, turn = np.arccos(z / distance), np.arctan2(y, x)
        radius = np.where(angle <= self._turn(self.limit), self._radial(angle), np.nan)
        return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1), distance

    def _radial(self, r: F64) -> F64:
        """r (1 + k1 r^2 + k2 r^4 + ...), of opencv over (1 + k4 r^2 + ...)."""
        over, under = (
            1 + np.sum([k * r ** (2 * n) for n, k in enumerate(ks, start=1)], axis=0)
            for ks in (self.k, self.divisor)
        )
        return np.asarray(r * over / under)

    def _turn(self, most: float) -> float:
        """Where _radial stops growing in 0..most; most where it never does."""
        grid = np.linspace(0, most, 4001)
        turns = np.nonzero(np.diff(self._radial(grid)) <= 0)[0]
        return float(grid[turns[0]]) if len(turns) else most

    def _inverse(self, value: F64, most: float) -> F64:
        """The r in 0..most whose _radial is value, by bisection."""
        low, high = np.zeros_like(value), np.full_like(value, most)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            is_below = self._radial(middle) < value
            low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
        return (low + high) / 2

    def _tangential(self, x: F64, y: F64) -> F64:
        p1, p2 = self.p
        r2 = x * x + y * y
        s1, s2, s3, s4 = self.prism
        across = 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + s1 * r2 + s2 * r2**2
        down = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + s3 * r2 + s4 * r2**2
        return np.stack([across, down], axis=1)

    def _tilt(self) -> F64:
        """(3, 3) from the plane to that of a sensor turned about x, then y."""
        (cx, cy), (sx, sy) = np.cos(self.tau), np.sin(self.tau)
        about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
        turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ about_x
        flat = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
        return np.asarray(flat @ turn)

    def _distorted(self, ideal: F64) -> F64:
        r = np.hypot(ideal[:, 0], ideal[:, 1])
        scale = np.divide(self._radial(r), r, out=np.ones_like(r), where=r > 0)
        return ideal * scale[:, None] + self._tangential(ideal[:, 0], ideal[:, 1])

    def _undistorted(self, plane: F64) -> F64:
        # Bracket the radius below the fold, then take the tangential part off again and again.
        most = self._turn(4.0)
        ideal = plane.copy()
        for _ in range(_STEPS):
            target = plane - self._tangential(ideal[:, 0], ideal[:, 1])
            radius = np.hypot(target[:, 0], target[:, 1])
            inverse = self._inverse(radius, most)
            scale = np.divide(inverse, radius, out=np.ones_like(radius), where=radius > 0)
            before, ideal = ideal, target * scale[:, None]
            if np.abs(ideal - before).max(initial=0.0) < 1e-12:
                break
        return ideal


def _through(plane: F64, homography: F64) -> F64:
    """(N, 2) points at z = 1 on another plane; NaN behind it."""
    x, y, z = homography @ np.column_stack([plane, np.ones(len(plane))]).T
    z = np.where(z > 0, z, np.nan)
    return np.stack([x / z, y / z], axis=1)


def _cube_rays(plane: F64) -> F64:
    number = np.clip(np.floor((plane[:, 0] + 1) / 2), 0, 5).astype(np.int64)
    local = np.stack([plane[:, 0] - 2 * number, plane[:, 1], np.ones(len(plane))], axis=1)
    rays = np.einsum("nk,nkc->nc", local, _CUBE[number])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _cube_plane(points: F64) -> F64:
    out = np.full((len(points), 2), np.nan)
    for k, face in enumerate(_CUBE):
        x, y, z = face @ points.T
        inside = (z >= np.abs(x)) & (z >= np.abs(y))
        with np.errstate(divide="ignore", invalid="ignore"):
            out[inside] = np.stack([x / z + 2 * k, y / z], axis=1)[inside]
    return out


def scaled_k(intrinsics: Mapping[str, Any], width: float, height: float) -> F64:
    """(3, 3) K of a camera of cameras.json for a picture of another size."""
    i = intrinsics
    k = np.array([[i["fx"], 0, i["cx"]], [0, i["fy"], i["cy"]], [0, 0, 1]], np.float64)
    k[:2] *= [[width / i["width_px"]], [height / i["height_px"]]]
    return k


class StoredCamera:
    """A camera by stored numbers, which are read-only and may be read on first use."""

    k: F64  # (3, 3) K
    world_from_camera: F64  # (4, 4) pose with OpenCV axes (x right, y down, z forward)
    size: tuple[int, int]  # (height, width) in pixels
    lens: StoredLens | None  # None for a pinhole

    @property
    def eye(self) -> F64:
        """(3,) the camera's position."""
        return self.world_from_camera[:3, 3]

    def pixels_and_depths(self, camera: F64) -> tuple[F64, F64]:
        """(N, 2) pixels and (N,) depths of points (N, 3) with OpenCV's axes; NaN where not visible."""
        if self.lens is not None:
            plane, depth = self.lens.plane_and_depth(camera)
        else:
            depth = np.where(camera[:, 2] > 0, camera[:, 2], np.nan)
            plane = camera[:, :2] / depth[:, None]
        pixel = np.concatenate([plane, np.ones((len(plane), 1))], axis=1) @ self.k.T
        return pixel[:, :2], depth

    def pixels(self, points: F64) -> tuple[F64, F64]:
        """The same of world points (N, 3); one less than 1 mm before a pinhole has no pixel."""
        pixel, depth = self.pixels_and_depths(into_frame(self.world_from_camera, points))
        if self.lens is None:
            with np.errstate(invalid="ignore"):
                pixel = np.where(depth[:, None] > 1e-3, pixel, np.nan)
        return pixel, depth

    def margin(self, px: F64) -> F64:
        """(N,) distance in px of points (N, 2) inside the picture's border."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.minimum(px, np.array(self.size[::-1]) - px).min(axis=1))

    def ray_grid(self) -> F64:
        """(H, W, 3) the directions of `rays` through all pixels."""
        height, width = self.size
        rows, columns = (g.reshape(-1) for g in np.mgrid[0:height, 0:width])
        return self.rays(rows, columns)[1].reshape(height, width, 3)

    def rays(self, rows: NDArray[Any], columns: NDArray[Any]) -> tuple[F64, F64]:
        """Origin (3,) and directions (N, 3) of unit depth through (column + 0.5, row + 0.5), in the world.

        Depth is as the view stores it, along the axis or along the ray; (0, 0, 0) is no ray.
        """
        pixel = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))], axis=1)
        camera = np.linalg.solve(self.k, pixel.T).T
        if self.lens is not None:
            camera = self.lens.rays(np.asarray(camera[:, :2], np.float64))
        return self.eye, camera @ self.world_from_camera[:3, :3].T


@dataclass(frozen=True, eq=False)
class PlacedCamera(StoredCamera):
    """A camera that another file describes than its own view.json."""

    k: F64
    world_from_camera: F64
    size: tuple[int, int]
    lens: StoredLens | None = None
