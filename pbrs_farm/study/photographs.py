"""Photographs with depth as training has them: cut to a plan's form, the truth of their depth; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.curate.photographs import Photo
from pbrs_farm.study.plane_normals import normals_of_depth
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training_plan import TrainingPlan

PLANE_TRUTH: Final = (
    "planes fitted to depth in windows of 1/40 of the width; mask: at least 60 % of the window on"
    " one surface, within 1 % of its depth, not seen edge-on"
)
DEPTH_TRUTH: Final = "the photograph's own depth along the axis, where it has one"
PHOTO_TRUTHS: Final = {
    "normals": PLANE_TRUTH,
    "depth": DEPTH_TRUTH,
    "segmentation": "NYU40 classes of the picture's own label, where labelled",
}


def photo_truth(photo: Photo, K: F64, plan: TrainingPlan) -> Arrays:
    """What a photograph's depth says, at its own size, in the form of the task's targets.

    Depth stands beside normals, which are judged by it.
    """
    depth_m = photo.depth_mm / np.float64(1000)
    depth = {"depth": depth_m.astype(np.float32)}
    if plan.task == "depth":
        return depth
    normal, valid = normals_of_depth(depth_m, K)
    return {"normal": np.rint(normal * 32767).astype(np.int16), "valid": valid, **depth}


def crop_to_plan(
    rgb: NDArray[np.uint8], plan: TrainingPlan
) -> tuple[NDArray[np.uint8], slice, slice]:
    """The middle of a photograph in the plan's form, at the plan's size; the rows and columns taken."""
    rows, columns = middle_of_form(rgb.shape[0], rgb.shape[1], plan.width_px, plan.height_px)
    return resized_by_area(rgb[rows, columns], plan.width_px, plan.height_px), rows, columns


def camera_of_crop(K: F64, rows: slice, columns: slice, plan: TrainingPlan) -> F32:
    """(4,) fx, fy, cx, cy at the plan's size of what crop_to_plan took of a photograph of camera K (3, 3)."""
    x = plan.width_px / (columns.stop - columns.start)
    y = plan.height_px / (rows.stop - rows.start)
    cx, cy = K[0, 2] - columns.start, K[1, 2] - rows.start
    return np.array([K[0, 0] * x, K[1, 1] * y, cx * x, cy * y], np.float32)


def middle_of_form(
    height: int, width: int, form_width: int, form_height: int
) -> tuple[slice, slice]:
    """Rows and columns of the largest part in the middle that is as wide to high as the form."""
    share = form_width / form_height
    new_width = min(width, round(height * share))
    new_height = min(height, round(width / share))
    top, left = (height - new_height) // 2, (width - new_width) // 2
    return slice(top, top + new_height), slice(left, left + new_width)
