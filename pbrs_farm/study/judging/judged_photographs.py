"""Photographs with depth as views to judge normals and depth on. Effects: reads files.

A folder of pairs in a layout of docs/selection.md, and the camera: intrinsics.json with fx, fy,
cx, cy in pixels (depth_scale: units a metre), or intrinsics.txt with those four numbers or the
nine of K, beside the pictures or in a folder above. The truth of normals is planes fitted to depth.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import pairs_in, photo_from_pair
from pbrs_farm.regular_files import text_given
from pbrs_farm.study.judging.evaluation import JudgedViews
from pbrs_farm.study.photographs import DEPTH_TRUTH, PLANE_TRUTH, crop_to_plan, photo_truth
from pbrs_farm.study.training_plan import TrainingPlan

_FILES: Final = ("intrinsics.json", "intrinsics.txt")


@dataclass(frozen=True, slots=True)
class PhotoCamera:
    """The pinhole camera of photographs, pixels of the stored size."""

    K: tuple[float, float, float, float]  # fx, fy, cx, cy
    depth_scale: float | None  # units a metre; None = as the file's type says

    def matrix(self) -> F64:
        """(3, 3)."""
        fx, fy, cx, cy = self.K
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)


def pair_views(folder: Path, plan: TrainingPlan, name: str) -> JudgedViews:
    """Every pair below a folder, for normals and depth; BadInput for one without intrinsics.

    All are held in memory, at the plan's size of picture. BadInput also for tasks of which depth
    says nothing.
    """
    if plan.task not in ("normals", "depth"):
        text = f"photographs with depth say nothing of {plan.task}: normals and depth alone"
        raise BadInput(folder, "", text, hint="NYUv2's .mat holds classes and instances")
    ids, colours, truths = [], [], []
    for pair in pairs_in(folder):
        camera = camera_of(pair.rgb.parent, folder)
        photo = photo_from_pair(pair, depth_scale=camera.depth_scale, sun_rgbd=False)
        colour, rows, columns = crop_to_plan(photo.rgb, plan)
        truth = photo_truth(photo, camera.matrix(), plan)
        ids.append(pair.id)
        colours.append(colour)
        truths.append({key: array[rows, columns] for key, array in truth.items()})
    said = PLANE_TRUTH if plan.task == "normals" else DEPTH_TRUTH
    return JudgedViews(name, said, tuple(ids), np.stack(colours), tuple(truths))


def camera_of(folder: Path, top: Path) -> PhotoCamera:
    """The camera of photographs in a folder: the nearest intrinsics file from it up to top's parent.

    folder: where the pictures lie. Raises BadInput where there is none, or one that cannot be read.
    """
    above = [folder, *folder.parents]
    last = above.index(top) if top in above else 0
    for place in above[: last + 1]:
        for name in _FILES:
            if (place / name).is_file():
                return _read_camera(place / name)
    text = "photographs without intrinsics: normals cannot be taken from their depth"
    hint = 'put intrinsics.json there: {"fx": 518.9, "fy": 519.5, "cx": 325.6, "cy": 253.7}'
    raise BadInput(folder, "", text, hint=hint)


def _read_camera(path: Path) -> PhotoCamera:
    text = text_given(path)
    scale: float | None = None
    try:
        if path.suffix == ".json":
            row = json.loads(text)
            values = [float(row[key]) for key in ("fx", "fy", "cx", "cy")]
            scale = float(row["depth_scale"]) if "depth_scale" in row else None
        else:
            values = [float(word) for word in text.replace(",", " ").split()]
            values = [values[k] for k in (0, 4, 2, 5)] if len(values) == 9 else values
    except (ValueError, KeyError, TypeError):
        values = []
    if len(values) != 4 or not np.isfinite(values).all() or min(values[:2]) <= 0:
        raise BadInput(path, "", "expected fx, fy, cx and cy in pixels, or the nine numbers of K")
    fx, fy, cx, cy = values
    return PhotoCamera((fx, fy, cx, cy), scale)
