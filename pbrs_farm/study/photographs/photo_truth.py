"""Normals of a photograph's depth, and photographs cut to a plan's form; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.curate.photographs import Photo
from pbrs_farm.study.metrics.plane_normals import normals_of_depth
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training_plan import Plan

PLANE_TRUTH: Final = (
    "planes fitted to depth in windows of 1/40 of the width; mask: at least 60 % of the window on"
    " one surface, within 1 % of its depth, not seen edge-on"
)


def normals_of_photo(photo: Photo, K: F64) -> tuple[F32, Mask]:
    """Normals and mask of a photograph's depth."""
    return normals_of_depth(photo.depth_mm / np.float64(1000), K)


def normal_truth(normal: F32, valid: Mask) -> Arrays:
    """In the form of NormalsTask's targets."""
    return {"normal": np.rint(normal * 32767).astype(np.int16), "valid": valid}


def framed(rgb: NDArray[np.uint8], plan: Plan) -> tuple[NDArray[np.uint8], slice, slice]:
    """The middle of a photograph in the plan's form, at the plan's size; the rows and columns taken."""
    height, width = rgb.shape[:2]
    share = plan.width_px / plan.height_px
    new_width = min(width, round(height * share))
    new_height = min(height, round(width / share))
    top, left = (height - new_height) // 2, (width - new_width) // 2
    rows, columns = slice(top, top + new_height), slice(left, left + new_width)
    return resized_by_area(rgb[rows, columns], plan.width_px, plan.height_px), rows, columns
