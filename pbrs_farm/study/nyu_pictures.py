"""NYUv2's nyu_depth_v2_labeled.mat: pictures with normals, classes, boundaries. Effects: reads files.

Pictures are cropped as in Eigen et al. Normals are planes fitted to rawDepths, or to depths without it; classes need
classMapping40.mat beside the file (894 names to 40, Gupta et al. 2013), and
splits.mat lists the training (795) and test pictures (654).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import NyuMat, Photo
from pbrs_farm.study.photographs import (
    DEPTH_TRUTH,
    PLANE_TRUTH,
    RealFrame,
    cropped_frame,
    moved_origin,
    photo_truth,
    truth_text,
)
from pbrs_farm.study.tasks.classes_task import classes_of
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.truth.boundary import instance_boundary

# Intrinsics of the colour camera in the data set's toolbox.
_K: Final = np.array([[518.85790, 0, 325.58245], [0, 519.46961, 253.73617], [0, 0, 1]], np.float64)
_CROP: Final = (slice(44, 471), slice(40, 601))  # rows and columns of Eigen et al.
_TRUTHS: Final = {
    "normals": PLANE_TRUTH,
    "depth": DEPTH_TRUTH,
    "segmentation": "classes by classMapping40.mat, where labelled",
    "boundaries": "lines where the instance changes; matched within 0.011 of the diagonal",
}
NYU_HOME: Final = "NYUv2"  # home in the ids of its pictures


def nyu_pictures(path: Path, plan: TrainingPlan, split: str) -> Iterator[RealFrame]:
    """The pictures of a split of splits.mat ("train", "test"), or "all", ids of four digits; BadInput."""
    numbers = None if split == "all" else _numbers_of_split(path, split)
    mapping = path.parent / "classMapping40.mat"
    classes = _class_map(mapping) if plan.task == "segmentation" else np.zeros(0, np.uint8)
    is_empty = True
    with NyuMat(path, raw=True) as mat:
        for photo in mat.photos(numbers):
            is_empty = False
            truth = _truth(path, int(photo.id) - 1, photo, plan, classes)
            crops = {key: array[_CROP] for key, array in truth.items()}
            K, room = moved_origin(_K, *_CROP), photo.room or photo.id
            yield cropped_frame(photo.id, photo.rgb[_CROP], crops, K, plan, room=room)
    if is_empty:
        raise BadInput(path, "", f"no {split} picture: splits.mat is of another file")


def truth_of_nyu(path: Path, task_name: str) -> str:
    """Description of the truth of a task; BadInput for another file."""
    with NyuMat(path, raw=True) as mat:
        return truth_text(_TRUTHS[task_name], ["raw" if mat.is_raw else "filled"])


def has_splits(path: Path) -> bool:
    """True if splits.mat, the list of training and test pictures, is beside the .mat."""
    return _splits_of(path).is_file()


def _splits_of(path: Path) -> Path:
    return path.parent / "splits.mat"


def _numbers_of_split(path: Path, split: str) -> set[int]:
    if not has_splits(path):
        text, hint = "needed beside the .mat: it has the split", "it comes with NYUv2's data set"
        raise BadInput(_splits_of(path), "", text, hint=hint)
    # Numbers start at 1.
    return {n for n in _mat_numbers(_splits_of(path), f"{split}Ndxs").tolist() if n > 0}


def _truth(
    path: Path, index: int, photo: Photo, plan: TrainingPlan, classes: NDArray[np.uint8]
) -> Arrays:
    """Targets of a whole picture."""
    if plan.task in ("normals", "depth"):
        return photo_truth(photo, _K, plan)
    labels = _mat_row(path, "labels", index)
    if plan.task == "segmentation":
        if int(labels.max(initial=0)) >= len(classes):
            text = f"label {labels.max()} is beyond the class map"
            raise BadInput(path, f"image {index + 1}", text)
        return {"labels": classes_of(classes[labels], plan)}
    # Instances are numbered within their class.
    instance = labels.astype(np.int64) * 1000 + _mat_row(path, "instances", index)
    return {"edges": instance_boundary(instance) > 0}


def _mat_row(path: Path, table: str, index: int) -> NDArray[Any]:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return np.asarray(file[table][index]).T
    except (OSError, KeyError, ValueError, RuntimeError):
        text = "missing or damaged; is this nyu_depth_v2_labeled.mat?"
        raise BadInput(path, table, text) from None


def _class_map(path: Path) -> NDArray[np.uint8]:
    """(895,) class 0..40 of each of NYUv2's labels, 0 first."""
    if not path.is_file():
        hint = "from the code of Gupta et al. 2013"
        raise BadInput(path, "", "needed beside the .mat for classes", hint=hint)
    return np.concatenate([[0], _mat_numbers(path, "mapClass")]).astype(np.uint8)


def _mat_numbers(path: Path, name: str) -> NDArray[np.int64]:
    """A table of whole numbers from a MATLAB 5 file."""
    from scipy.io import loadmat

    try:
        return np.asarray(loadmat(path)[name], np.int64).ravel()
    except Exception:  # noqa: BLE001  scipy raises many kinds of errors for another file
        raise BadInput(path, name, "not the expected MATLAB 5 file") from None
