"""A view's stored files, cameras and covisibility as a form has to show them; no code of export. Effects: reads files."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.lens_rays import PlacedCamera, StoredCamera
from pbrs_farm.check.stored_set import MODES
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.layers import LAYER

_GRID_PX = 224  # long side of the grid of points of covisibility
_NEAREST_M = 0.04  # of a point in the other frame
_ROWS = 12  # of a matrix of covisibility to compute again
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from y up


@dataclass(frozen=True)
class FormTruth:
    """A view as a form of that size has to show it."""

    view: StoredView
    size: tuple[int, int] | None  # (height, width); None as rendered

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the form's pictures."""
        return self.size or self.view.size

    @cached_property
    def facts(self) -> dict[str, Any]:
        """view.json; size, K and instances at the form's size."""
        (height, width), (full_h, full_w) = self.shape, self.view.size
        k = self.view.k * np.array([[width / full_w], [height / full_h], [1.0]])
        rows = [self._row(row) for row in self.view.table["instances"]]
        return self.view.table | {
            "width_px": width, "height_px": height, "K": k.tolist(), "instances": [r for r in rows if r["pixels"]],
        }  # fmt: skip

    @cached_property
    def instance(self) -> NDArray[Any]:
        """(H, W) the instances."""
        return self.label("instance.png")

    def rows(self) -> list[dict[str, Any]]:
        """The rows of instances with a class."""
        return [row for row in self.facts["instances"] if row["nyu40"]]

    def _row(self, row: dict[str, Any]) -> dict[str, Any]:
        y, x = np.nonzero(self.instance == row["id"])
        if not len(x):
            return row | {"pixels": 0}
        left, top = int(x.min()), int(y.min())
        right, bottom = int(x.max()) + 1, int(y.max()) + 1
        box = [left, top, right, bottom]
        n = {"pixels": len(x), "fraction": len(x) / self.instance.size}
        return row | n | {"box2d": box, "bbox": [left, top, right - left, bottom - top]}

    def label(self, file: str) -> NDArray[Any]:
        """A label of the nearest pixels."""
        return self._nearest(self.view.png(file))

    def metres(self, layers: Collection[str]) -> F64:
        """(H, W) depth, 0 for nothing; of depth_z if the view has it and `layers` (none for all) name it."""
        if self.view.has("depth_z.exr") and (not layers or "depth_z" in layers):
            return self._nearest(self.view.exr("depth_z.exr")["Z"]).astype(np.float64)
        depth = self.label("depth.png")
        return np.where(depth < np.iinfo(np.uint16).max, depth, 0) / 1000

    def _nearest(self, array: NDArray[Any]) -> NDArray[Any]:
        (height, width), (full_h, full_w) = self.shape, array.shape[:2]
        rows = ((np.arange(height) + 0.5) * full_h / height).astype(int)
        columns = ((np.arange(width) + 0.5) * full_w / width).astype(int)
        return np.asarray(array[rows[:, None], columns])

    def _mean(self, array: NDArray[Any]) -> F64:
        """A picture at the form's size, each pixel the mean over its area."""
        array = array.astype(np.float64)
        if array.shape[:2] == self.shape:
            return array
        down, across = (_areas(n, of) for n, of in zip(self.shape, array.shape[:2], strict=True))
        return np.asarray(np.einsum("ab,bc...,dc->ad...", down, array, across, optimize=True))

    def opengl_normals(self) -> F64:
        """Unit normals, x right, y up, z towards the camera; 0 for nothing."""
        x, forward, up = np.moveaxis(self.label("normal.png") * (2 / 65535) - 1, -1, 0)
        normal = np.stack([x, up, -forward], axis=-1)
        length = np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
        is_valid = (self.label("valid.png") > 0)[..., None]
        return np.asarray(np.where(is_valid, normal / length, 0))

    def array(self, name: str) -> NDArray[Any] | None:
        """A picture by its mode, or a layer; None for one that is not recomputed at that size."""
        if name in MODES:
            return self._mean(self.view.png(f"{name}.png"))
        layer = LAYER.get({"class40": "semantic"}.get(name, name))
        if layer is None or not layer.file.endswith(".png"):
            return None
        if self.size is None or layer.resized == "nearest":
            return self.label(layer.file)
        if layer.resized != "lines":
            return None
        lines = self.view.png(layer.file)
        of_values = [value * (self._mean(lines == value) > 0) for value in np.unique(lines)]
        return np.asarray(np.max(of_values, axis=0))

    def mode(self, modes: Collection[str]) -> str | None:
        """The mode of its picture among modes; None without one."""
        return next((m for m in MODES if m in modes and self.view.has(f"{m}.png")), None)


def _areas(n: int, of: int) -> F64:
    """(n, of) shares of pixels of a line of `of` in each of n."""
    edges = np.arange(n + 1) * of / n
    low, high = edges[:-1, None], edges[1:, None]
    pixel = np.arange(of)
    shares = np.clip(np.minimum(high, pixel + 1) - np.maximum(low, pixel), 0, None)
    return np.asarray(shares / (high - low))


def mask_from_runs(runs: dict[str, Any]) -> Bools:
    """(H, W) mask of COCO's compressed run lengths: digits of 5 bits, from the fourth on differences to the last but one."""
    counts: list[int] = []
    value = shift = 0
    for letter in str(runs["counts"]).encode():
        digit = letter - 48
        value |= (digit & 31) << shift
        shift += 5
        if digit & 32:
            continue
        if digit & 16:
            value -= 1 << shift
        counts.append(value + counts[-2] if len(counts) > 2 else value)
        value = shift = 0
    height, width = (int(n) for n in runs["size"])
    if min(counts, default=0) < 0 or sum(counts) != height * width:
        return np.zeros((0, 0), bool)
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape(width, height).T


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


def _grid_of(camera: StoredCamera, depth: F64) -> tuple[F64, int]:
    """(N, 3) world points of a grid of pixels with depth, and the number of pixels of the grid."""
    scale = min(1.0, _GRID_PX / max(depth.shape))
    lines = [
        np.floor((np.arange(int(n * scale)) + 0.5) * n / int(n * scale)).astype(int)
        for n in depth.shape
    ]
    y, x = (g.ravel() for g in np.meshgrid(*lines, indexing="ij"))
    z = depth[y, x]
    eye, directions = camera.rays(y, x)
    return (eye + directions * z[:, None])[z > 0], len(z)


def _n_seen(camera: StoredCamera, depth: F64, points: F64) -> int:
    """Number of points in the picture that nothing hides."""
    px, z = camera.pixels(points)
    with np.errstate(invalid="ignore"):
        is_in = (z > _NEAREST_M) & (px >= 0).all(1) & (px < depth.shape[::-1]).all(1)
    columns, rows = np.floor(px[is_in]).astype(int).T
    stored, z = depth[rows, columns], z[is_in]
    allowed = 0.1 + 0.005 * z - math.log(0.5) * 0.1
    return int(((stored > 0) & (np.abs(stored - z) < allowed)).sum())


def covisibility(truths: Sequence[FormTruth], depths: Sequence[F64]) -> dict[int, F64]:
    """Row -> shares of its frame's grid that each frame sees, of some rows spread over the scene."""
    cameras = [
        PlacedCamera(np.array(t.facts["K"], np.float64), t.view.world_from_camera, t.shape)
        for t in truths
    ]
    rows = np.unique(np.linspace(0, len(cameras) - 1, min(_ROWS, len(cameras))).astype(int))
    shares = {}
    for row in rows.tolist():
        points, n = _grid_of(cameras[row], depths[row])
        seen = [_n_seen(*pair, points) for pair in zip(cameras, depths, strict=True)]
        shares[row] = np.array(seen) / n
    return shares
