"""Cameras, logarithmic depth and covisibility of trainers' forms; no code of export. Effects: reads files."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pbrs_farm.check.form_truth import FormTruth
from pbrs_farm.core.arrays import F64, Bools

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from y up
_GRID_PX = 224  # long side of the grid of points of covisibility
_NEAREST_M = 0.04  # of a point in the other frame
_ROWS = 12  # of a matrix of covisibility to compute again


def metres_of_logarithms(data: bytes) -> F64:
    """Depth (H, W) of MoGe's PNG: metres, 0 for unknown, inf for the sky. KeyError without near and far."""
    from PIL import Image

    with Image.open(io.BytesIO(data)) as image:
        near, far = (float(image.info[name]) for name in ("near", "far"))
        steps = np.asarray(image).astype(np.float64)
    metres = np.exp(np.log(near) + (steps - 1) / 65533 * np.log(far / near))
    return np.where(steps == 0, 0, np.where(steps == 65535, np.inf, metres))


def camera_matrix(data: bytes) -> F64:
    """The numbers of a text, or the field `intrinsics` of a JSON file. ValueError for other files."""
    if data.lstrip()[:1] == b"{":
        return np.array(json.loads(data)["intrinsics"], np.float64)
    return np.atleast_2d(np.loadtxt(io.StringIO(data.decode())))


def wanted_matrix(form: str, file: str, facts: dict[str, Any]) -> F64:
    """The matrix of a camera's file: K in pixels or shares of the picture, or the pose with z up."""
    k = np.array(facts["K"], np.float64)
    if form == "moge":
        size = np.array([[facts["width_px"]], [facts["height_px"]], [1.0]])
        return np.asarray(k / size)
    if form == "lingbot":
        return k
    if file.startswith("pose/"):
        return np.asarray(Z_UP @ np.array(facts["world_from_camera_opencv"]))
    four = np.eye(4)
    four[:3, :3] = whole_centres(k)
    return four


def whole_centres(k: F64) -> F64:
    """K for pixels whose centres are whole numbers."""
    return np.asarray(k - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])


class _Frame:
    """A view with depth, as covisibility compares it with others."""

    def __init__(self, truth: FormTruth, depth: F64) -> None:
        self.depth, self.k = depth, np.array(truth.facts["K"], np.float64)
        self.pose = truth.view.world_from_camera

    def grid(self) -> tuple[F64, int]:
        """(N, 3) world points of a grid of pixels with depth, and the number of pixels of the grid."""
        scale = min(1.0, _GRID_PX / max(self.depth.shape))
        lines = [
            np.floor((np.arange(int(n * scale)) + 0.5) * n / int(n * scale)).astype(int)
            for n in self.depth.shape
        ]
        y, x = (g.ravel() for g in np.meshgrid(*lines, indexing="ij"))
        z = self.depth[y, x]
        local = np.linalg.solve(self.k, np.stack([x + 0.5, y + 0.5, np.ones(len(x))])) * z
        world = self.pose[:3, :3] @ local + self.pose[:3, 3:]
        return world.T[z > 0], len(z)

    def sees(self, points: F64) -> Bools:
        """True for points in the picture that nothing hides."""
        local = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        z = local[:, 2]
        is_ahead = z > _NEAREST_M
        x, y, _w = self.k @ (local / np.where(is_ahead, z, 1)[:, None]).T
        column, row = np.floor(x), np.floor(y)
        height, width = self.depth.shape
        is_in = is_ahead & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        depth = np.zeros_like(z)
        depth[is_in] = self.depth[row[is_in].astype(int), column[is_in].astype(int)]
        allowed = 0.1 + 0.005 * z - math.log(0.5) * 0.1
        return np.asarray(is_in & (depth > 0) & (np.abs(depth - z) < allowed))


def covisibility(truths: Sequence[FormTruth], depths: Sequence[F64]) -> dict[int, F64]:
    """Row -> shares of its frame's grid that each frame sees, of some rows spread over the scene."""
    frames = [_Frame(*pair) for pair in zip(truths, depths, strict=True)]
    rows = np.unique(np.linspace(0, len(frames) - 1, min(_ROWS, len(frames))).astype(int))
    shares = {}
    for row in rows.tolist():
        points, n = frames[row].grid()
        shares[row] = np.array([frame.sees(points).sum() / n for frame in frames])
    return shares
