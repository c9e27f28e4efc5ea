"""NYUv2's pictures in memory at a plan's size, to tune on. Effects: reads the .mat."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.resampling import resized_any, resized_nearest
from pbrs_farm.study.photographs.nyu_pictures import nyu_pictures
from pbrs_farm.study.training.view_arrays import ViewArrays
from pbrs_farm.study.training_plan import Plan

NYU_HOME = "NYUv2"  # what stands for a home in the ids of its pictures


def nyu_arrays(path: Path, plan: Plan, split: str) -> ViewArrays:
    """The pictures of a split ("train", "test"), truth by the nearest pixel, lines kept whole.

    Raises BadInput for a file that is none, or has no splits.mat beside it.
    """
    ids, rows = [], []
    for picture in nyu_pictures(path, plan, split):
        ids.append(f"{NYU_HOME}/{picture.id}")
        truth = {name: _resized(name, array, plan) for name, array in picture.truth.items()}
        rows.append({"colour": picture.colour, **truth})
    arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    return ViewArrays(tuple(ids), arrays.pop("colour"), arrays)


def _resized(name: str, array: NDArray[Any], plan: Plan) -> NDArray[Any]:
    resized = resized_any if name == "edges" else resized_nearest
    return resized(array, plan.width_px, plan.height_px)
