"""Scenes of posed pictures in the WorldAI layout, from which MapAnything trains (facebookresearch/map-anything).

    <house>/scene_meta.json  images/<view>.png  depth/<view>.exr
    <house>/covisibility/v0/pairwise_covisibility--<N>x<N>.npy
    pbrs_farm_scene_list_<split>.npy

Effects: reads views, writes files.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_metres,
    k_of_whole_centres,
    require_lens,
)
from pbrs_farm.export.form import Convention, ViewForm, name_left_out, views_with_picture
from pbrs_farm.export.sequences import pose_opencv
from pbrs_farm.images import exr_from_layers

_COVISIBILITY: Final = "covisibility/v0"
_LONG_SIDE: Final = 224  # of the grid of points, pixels
_LEAST_Z_M: Final = 0.04  # of a point in the other frame
# A point is seen if depth differs by less than 0.1 m + 0.5 % - ln(0.5) x 0.1 m, as in the repository.
_WITHIN_M: Final = 0.1 - math.log(0.5) * 0.1
_WITHIN_SHARE: Final = 0.005


def write_wai(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above; a scene is a house.

    Poses are camera to world in OpenCV's axes, in the home's world (metres, y up); depth is float32 metres along
    the axis, 0 for nothing. The matrix has, in the row of a frame, the share of its picture that each frame sees.
    left_out.txt names views without a picture; BadInput for a lens other than a pinhole.
    """
    shown = views_with_picture(views)
    for house in dict.fromkeys(view.house.id for view in shown):
        folder = out / house
        for part in ("images", "depth", _COVISIBILITY):
            (folder / part).mkdir(parents=True)
        of_house = [view for view in shown if view.house.id == house]
        rows = [_frame(view, folder) for view in of_house]
        matrix = pairwise_covisibility([_frame_points(view) for view in of_house])
        n = len(rows)
        name = f"{_COVISIBILITY}/pairwise_covisibility--{n}x{n}.npy"
        np.save(folder / name, matrix)
        meta = {
            "scene_name": house,
            "dataset_name": "pbrs_farm",
            "version": "0.1",
            "shared_intrinsics": len({(r["fl_x"], r["fl_y"], r["cx"], r["cy"]) for r in rows}) == 1,
            "camera_model": "PINHOLE",
            "camera_convention": "opencv",
            "scale_type": "metric",
            "scene_modalities": {"pairwise_covisibility": {"scene_key": name, "format": "mmap"}},
            "frames": rows,
            "frame_modalities": {
                kind: {"frame_key": kind, "format": kind} for kind in ("image", "depth")
            },
        }
        (folder / "scene_meta.json").write_text(json.dumps(meta, indent=1) + "\n", "utf-8")
    name_left_out(out, [view for view in views if view.picture is None], "has no picture")


def _frame(view: ChosenView, folder: Path) -> dict[str, Any]:
    """The frame's row; writes its picture and depth."""
    require_lens(view, "wai", *FORM.lenses)
    image, depth = f"images/{view.id}.png", f"depth/{view.id}.exr"
    (folder / image).write_bytes(view.data(view.picture or ""))
    (folder / depth).write_bytes(exr_from_layers({"Y": depth_metres(view).astype(np.float32)}))
    k = k_of_whole_centres(view.facts["K"])
    return {
        "frame_name": view.id,
        "image": image,
        "file_path": image,
        "depth": depth,
        "transform_matrix": pose_opencv(view).tolist(),
        "h": view.facts["height_px"],
        "w": view.facts["width_px"],
        "fl_x": k[0][0],
        "fl_y": k[1][1],
        "cx": k[0][2],
        "cy": k[1][2],
    }


@dataclass(frozen=True, slots=True, eq=False)
class FramePoints:
    """A frame of a scene for `pairwise_covisibility`."""

    depth: F32  # (H, W) metres, 0 for nothing
    k: F64  # (3, 3), pixel centres at .5
    camera_from_world: F64  # (4, 4), OpenCV's axes
    points: F64  # (N, 3) world: surfaces behind a grid of pixels
    n_grid: int  # pixels of the grid


def _frame_points(view: ChosenView) -> FramePoints:
    depth, pose = depth_metres(view), pose_opencv(view)
    k = np.array(view.facts["K"], np.float64)
    height, width = depth.shape
    scale = min(1.0, _LONG_SIDE / max(height, width))
    rows, columns = (
        ((np.arange(int(n * scale)) + 0.5) * n / int(n * scale)).astype(int)
        for n in (height, width)
    )
    x, y = (grid.ravel() for grid in np.meshgrid(columns, rows))
    z = depth[y, x]
    rays = np.stack([x + 0.5, y + 0.5, np.ones(len(x))], axis=1) @ np.linalg.inv(k).T
    points = ((rays * z[:, None]) @ pose[:3, :3].T + pose[:3, 3])[z > 0]
    to_camera = np.asarray(np.linalg.inv(pose))
    return FramePoints(depth.astype(np.float32), k, to_camera, points, len(z))


def pairwise_covisibility(frames: list[FramePoints]) -> F32:
    """(N, N) float32: in row i and column j the share of frame i's grid that frame j sees, too.

    A point is seen if it is in j's picture and the depth there is its own. Depth is that of the full picture,
    where the repository reduces it to 224 px.
    """
    matrix = np.zeros((len(frames), len(frames)), np.float32)
    for i, frame in enumerate(frames):
        corners = box_corners(frame.points)
        for j, other in enumerate(frames):
            if may_see(corners, other):
                matrix[i, j] = n_seen(frame.points, other) / frame.n_grid
    return matrix


def box_corners(points: F64) -> F64:
    """(8, 3) corners of the box around the points; none without points."""
    if not len(points):
        return points
    ends = np.stack([points.min(0), points.max(0)])
    return np.array([[ends[k >> axis & 1, axis] for axis in range(3)] for k in range(8)])


def may_see(corners: F64, frame: FramePoints) -> bool:
    """False if all corners of a box are outside one side of the frame's pyramid."""
    height, width = frame.depth.shape
    pose = frame.camera_from_world
    x, y, z = ((corners @ pose[:3, :3].T + pose[:3, 3]) @ frame.k.T).T
    sides = (z - _LEAST_Z_M, x, y, width * z - x, height * z - y)
    return bool(len(corners)) and all(bool((side >= 0).any()) for side in sides)


def n_seen(points: F64, frame: FramePoints) -> int:
    """Number of points in the picture of a frame whose depth there is their own."""
    local = points @ frame.camera_from_world[:3, :3].T + frame.camera_from_world[:3, 3]
    local = local[local[:, 2] > _LEAST_Z_M]
    z = local[:, 2]
    x, y = ((local / z[:, None]) @ frame.k.T)[:, :2].T
    height, width = frame.depth.shape
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    z = z[inside]
    depth = frame.depth[y[inside].astype(int), x[inside].astype(int)]
    is_near = np.abs(depth - z) < _WITHIN_M + _WITHIN_SHARE * z
    return int(np.count_nonzero((depth > 0) & is_near))


def write_scene_lists(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """Write the names of each split's scenes, which its loaders read from `<metadata folder>/<split>`."""
    for split in splits:
        scenes = sorted(path.parent.name for path in (out / split).glob("*/scene_meta.json"))
        np.save(out / split / f"pbrs_farm_scene_list_{split}.npy", np.array(scenes))


FORM = ViewForm(
    "wai",
    write_wai,
    "MapAnything: `<house>/scene_meta.json`, `images`, `depth/*.exr`, `covisibility/v0` (the share of each frame's"
    " picture that each other sees); with `--split` lists of scenes",
    finish=write_scene_lists,
    lenses=("pinhole",),
    convention=Convention(0, axes="OpenCV's; world y up, m", depth="m, along the axis"),
)
