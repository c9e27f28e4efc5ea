"""Pin-hole pictures (one, else six of a cube) that hold what a lens sees, and the way back; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.panoramas import FACE_AXES

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
    """The faces, and the place of each pixel of the lens's picture in them."""

    faces: tuple[PinholeFace, ...]
    number: NDArray[np.int64]  # (H, W) index into faces, -1 = the pixel has no ray
    x: F64  # (H, W) pixel coordinates there
    y: F64

    def nearest(self, pictures: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """(H, W, ...) labels of the lens by the nearest pixel of pictures (h, w, ...), 0 without a ray."""
        out = np.zeros((*self.number.shape, *pictures[0].shape[2:]), pictures[0].dtype)
        for k, picture in enumerate(pictures):
            on_face = self.number == k
            column = np.floor(self.x[on_face]).astype(np.int64).clip(0, picture.shape[1] - 1)
            row = np.floor(self.y[on_face]).astype(np.int64).clip(0, picture.shape[0] - 1)
            out[on_face] = picture[row, column]
        return out

    def bilinear(self, pictures: Sequence[NDArray[np.floating]]) -> NDArray[np.float32]:
        """(H, W, C) light or depth of the lens from pictures (h, w, C) per face; 0 without a ray."""
        out = np.zeros((*self.number.shape, pictures[0].shape[2]), np.float32)
        for k, picture in enumerate(pictures):
            on_face = self.number == k
            # Pixel centres lie at +0.5; a border repeats itself.
            x0 = np.clip(self.x[on_face] - 0.5, 0, picture.shape[1] - 1.000001)
            top = np.clip(self.y[on_face] - 0.5, 0, picture.shape[0] - 1.000001)
            column, row = x0.astype(np.int64), top.astype(np.int64)
            across, down = (x0 - column)[:, None], (top - row)[:, None]
            upper = picture[row, column] * (1 - across) + picture[row, column + 1] * across
            lower = picture[row + 1, column] * (1 - across) + picture[row + 1, column + 1] * across
            out[on_face] = upper * (1 - down) + lower * down
        return out


def faces_of_directions(directions: F64) -> PinholeFaces:
    """The faces that hold all rays of a picture: (H, W, 3), OpenCV's axes, any length, 0 = no ray.

    One face within its widest angle about the axis, else the six of a cube, finer than the finest part of
    the lens's picture, up to a limit.
    """
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
        on_face = number == k
        local = unit[on_face] @ FACE_AXES[k].T
        x[on_face], y[on_face] = (local[:, :2] / local[:, 2:] * focal + side / 2).T
    faces = tuple(PinholeFace(FACE_AXES[k], side, side, focal, side / 2, side / 2) for k in used)
    return PinholeFaces(faces, index[number], x, y)
