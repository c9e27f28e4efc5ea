"""Photographs with depth at the size of a plan, with the truth from their depth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest
from pbrs_farm.curate.photographs import Photo
from pbrs_farm.study.plane_normals import large_planes, normals_of_depth
from pbrs_farm.study.tasks.normals_task import NORMAL_SCALE
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training.training_views import CAMERA, ViewArrays, camera_numbers
from pbrs_farm.study.training_plan import TrainingPlan

PLANE_TRUTH: Final = (
    "planes fitted to {depth} depth in windows of 1/40 of the width; mask: at least 60 % of the window on"
    " one surface, within 1 % of its depth, not seen edge-on"
)
DEPTH_TRUTH: Final = "the photograph's own {depth} depth along the axis, where it has one"
PHOTO_TRUTHS: Final = {
    "normals": PLANE_TRUTH,
    "depth": DEPTH_TRUTH,
    "segmentation": "NYU40 classes of the picture's own label, where labelled",
}


def truth_text(truth: str, depths: Iterable[str]) -> str:
    """Description of a truth for photographs with "raw" depth, or "filled" depth without holes.

    Example:
        >>> truth_text("planes fitted to {depth} depth", ["filled", "raw", "raw"])
        'planes fitted to raw and filled depth'
    """
    return truth.format(depth=" and ".join(sorted(set(depths), reverse=True)))


@dataclass(frozen=True, slots=True, eq=False)
class RealFrame:
    """A photograph cropped to the aspect ratio of a plan."""

    id: str
    colour: NDArray[np.uint8]  # (h, w, 3) at the plan's size
    truth: Arrays  # (H, W, ...) targets of the same crop at the photograph's size
    K: F64  # (3, 3) pixels at the plan's size
    digest: str = ""  # of the picture's file; training pictures are refused as test pictures
    room: str = ""


def cropped_frame(
    id: str,
    rgb: NDArray[np.uint8],
    truth: Arrays,
    K: F64,
    plan: TrainingPlan,
    digest: str = "",
    room: str = "",
) -> RealFrame:
    """The frame of a photograph, its truth and its K (3, 3), all of the whole picture."""
    size = plan.width_px, plan.height_px
    colour, rows, columns = crop_to_size(rgb, size)
    crops = {key: array[rows, columns] for key, array in truth.items()}
    return RealFrame(id, colour, crops, camera_of_crop(K, rows, columns, size), digest, room)


def with_large_planes(frame: RealFrame) -> Arrays:
    """The truth of a frame with "plane" (H, W, 3) int16, the normals of large planes, if it has normals."""
    if "normal" not in frame.truth:
        return frame.truth
    depth, valid = frame.truth["depth"], frame.truth["valid"]
    (height, width), (small_height, small_width) = depth.shape, frame.colour.shape[:2]
    K = np.diag([width / small_width, height / small_height, 1.0]) @ frame.K
    planes = large_planes(depth, frame.truth["normal"] / NORMAL_SCALE, valid, K)
    return frame.truth | {"plane": np.rint(planes * NORMAL_SCALE).astype(np.int16)}


def arrays_of_frames(frames: Iterable[RealFrame], plan: TrainingPlan) -> ViewArrays:
    """Training arrays of colour and truth, without depth beside normals, at the plan's size."""
    ids, rows = [], []
    for frame in frames:
        ids.append(frame.id)
        row: dict[str, NDArray[Any]] = {"colour": frame.colour}
        for name, array in frame.truth.items():
            if name != "depth" or plan.task == "depth":
                resized = resized_any if name == "edges" else resized_nearest
                row[name] = resized(array, plan.width_px, plan.height_px)
        rows.append(row | ({CAMERA: camera_numbers(frame.K)} if plan.rays else {}))
    arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    return ViewArrays(tuple(ids), arrays.pop("colour"), arrays)


def photo_truth(photo: Photo, K: F64, plan: TrainingPlan) -> Arrays:
    """Targets from a photograph's depth at its own size: normals with depth for scoring, or depth."""
    depth_m = photo.depth_mm / np.float64(1000)
    depth = {"depth": depth_m.astype(np.float32)}
    if plan.task == "depth":
        return depth
    normal, valid = normals_of_depth(depth_m, K)
    return {"normal": np.rint(normal * NORMAL_SCALE).astype(np.int16), "valid": valid, **depth}


def crop_to_size(
    rgb: NDArray[np.uint8], size: tuple[int, int]
) -> tuple[NDArray[np.uint8], slice, slice]:
    """The middle of a picture at a size (width, height), and the rows and columns of the crop."""
    rows, columns = middle_of_form(rgb.shape[0], rgb.shape[1], *size)
    return resized_by_area(rgb[rows, columns], *size), rows, columns


def camera_of_crop(K: F64, rows: slice, columns: slice, size: tuple[int, int]) -> F64:
    """(3, 3) K of the crop of a picture with K (3, 3), resized to (width, height)."""
    x = size[0] / (columns.stop - columns.start)
    y = size[1] / (rows.stop - rows.start)
    return np.diag([x, y, 1.0]) @ moved_origin(K, rows, columns)


def moved_origin(K: F64, rows: slice, columns: slice) -> F64:
    """(3, 3) K of a crop at the size of the picture."""
    return K - np.array([[0, 0, columns.start], [0, 0, rows.start], [0, 0, 0]], np.float64)


def middle_of_form(
    height: int, width: int, form_width: int, form_height: int
) -> tuple[slice, slice]:
    """Rows and columns of the largest centred crop with an aspect ratio."""
    share = form_width / form_height
    new_width = max(min(width, round(height * share)), 1)
    new_height = max(min(height, round(width / share)), 1)
    top, left = (height - new_height) // 2, (width - new_width) // 2
    return slice(top, top + new_height), slice(left, left + new_width)
