"""Scenes of posed pictures in the WorldAI layout, from which MapAnything trains (facebookresearch/map-anything).

    <house>/scene_meta.json  images/<view>.png  depth/<view>.exr
    <house>/covisibility/v0/pairwise_covisibility--<N>x<N>.npy
    pbrs_farm_scene_list_<split>.npy

Effects: reads views, writes files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Files, write_files
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.sequences import by_house

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
    for house, of_house in by_house(views).items():
        matrix = pairwise_covisibility([_frame_points(view) for view in of_house])
        name = f"{_COVISIBILITY}/pairwise_covisibility--{len(matrix)}x{len(matrix)}.npy"
        rows = [_row(view) for view in of_house]
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
        documents: Files = {name: matrix, "scene_meta.json": meta}
        write_files(out / house, chain([documents], map(_files, of_house)))


def _files(view: ChosenView) -> Files:
    depth = {"Y": view.depth_m.astype(np.float32)}
    return {f"images/{view.id}.png": view.shown, f"depth/{view.id}.exr": depth}


def _row(view: ChosenView) -> dict[str, Any]:
    image, k, (width, height) = f"images/{view.id}.png", view.k_of_whole_centres, view.size
    return {
        "frame_name": view.id,
        "image": image,
        "file_path": image,
        "depth": f"depth/{view.id}.exr",
        "transform_matrix": view.pose.tolist(),
        "h": height,
        "w": width,
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
    depth, pose = view.depth_m, view.pose
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
    takes=PICTURES,
    lenses=("pinhole",),
    convention=Convention(0, axes="OpenCV's; world y up, m", depth="m, along the axis"),
)
