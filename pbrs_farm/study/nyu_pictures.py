"""NYUv2's nyu_depth_v2_labeled.mat: pictures with normals, classes, boundaries. Effects: reads files.

Pictures are cut to Eigen's crop. Normals are planes fitted to the filled depth; classes need
classMapping40.mat beside the file (894 names to 40, Gupta et al. 2013), and
splits.mat says which pictures train (795) and which judge (654).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import NyuMat, Photo
from pbrs_farm.study.photographs import (
    DEPTH_TRUTH,
    PLANE_TRUTH,
    camera_of_crop,
    crop_to_plan,
    photo_truth,
)
from pbrs_farm.study.real_frames import truth_at_size
from pbrs_farm.study.tasks.classes_task import classes_of
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training.training_views import CAMERA, ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.truth.boundary import instance_boundary

# Of the colour camera, as the data set's toolbox has it.
_K: Final = np.array([[518.85790, 0, 325.58245], [0, 519.46961, 253.73617], [0, 0, 1]], np.float64)
_CROP: Final = (slice(44, 471), slice(40, 601))  # Eigen's rows and columns
_K_OF_CROP: Final = _K - np.array([[0, 0, 40], [0, 0, 44], [0, 0, 0]])
NYU_TRUTHS: Final = {
    "normals": PLANE_TRUTH,
    "depth": DEPTH_TRUTH,
    "segmentation": "classes by classMapping40.mat, where labelled",
    "boundaries": "lines where the instance changes; matched within 0.011 of the diagonal",
}
NYU_HOME = "NYUv2"  # what stands for a home in the ids of its pictures


@dataclass(frozen=True, slots=True, eq=False)
class NyuPicture:
    """A photograph cut to Eigen's crop and a plan's form."""

    id: str  # its number in the file, four digits
    colour: NDArray[np.uint8]  # at the plan's size
    truth: Arrays  # at the photograph's own size, in the form of the task's targets
    camera: F32  # (4,) fx, fy, cx, cy at the plan's size


def nyu_pictures(path: Path, plan: TrainingPlan, split: str) -> Iterator[NyuPicture]:
    """The pictures of a split of splits.mat ("train", "test"), or "all", one by one.

    Raises BadInput for a file that is none, or lacks what the plan's task needs.
    """
    chosen = None if split == "all" else _numbers_of_split(path, split)
    mapping = path.parent / "classMapping40.mat"
    classes = _class_map(mapping) if plan.task == "segmentation" else np.zeros(0, np.uint8)
    n_found = 0
    with NyuMat(path) as mat:
        for photo in mat.photos(chosen):
            n_found += 1
            truth = _truth(path, int(photo.id) - 1, photo, plan, classes)
            colour, rows, columns = crop_to_plan(photo.rgb[_CROP], plan)
            cut = {key: array[_CROP][rows, columns] for key, array in truth.items()}
            camera = camera_of_crop(_K_OF_CROP, rows, columns, plan)
            yield NyuPicture(photo.id, colour, cut, camera)
    if not n_found:
        raise BadInput(path, "", f"no {split} picture: splits.mat is of another file")


def has_splits(path: Path) -> bool:
    """splits.mat, which says what trains and what judges, lies beside the .mat."""
    return _splits_of(path).is_file()


def _splits_of(path: Path) -> Path:
    return path.parent / "splits.mat"


def _numbers_of_split(path: Path, split: str) -> set[int]:
    if not has_splits(path):
        hint = "it comes with NYUv2's data set"
        raise BadInput(
            _splits_of(path), "", "needed beside the .mat: it says which train", hint=hint
        )
    # Numbers below 1 are none.
    return {n for n in _mat_numbers(_splits_of(path), f"{split}Ndxs").tolist() if n > 0}


def _truth(
    path: Path, at: int, photo: Photo, plan: TrainingPlan, classes: NDArray[np.uint8]
) -> Arrays:
    """A whole picture's truth in the form of the task's targets."""
    if plan.task in ("normals", "depth"):
        return photo_truth(photo, _K, plan)
    labels = _mat_row(path, "labels", at)
    if plan.task == "segmentation":
        if int(labels.max(initial=0)) >= len(classes):
            raise BadInput(path, f"image {at + 1}", f"label {labels.max()} is beyond the class map")
        return {"labels": classes_of(classes[labels], plan)}
    # An instance is a number within its class.
    instance = labels.astype(np.int64) * 1000 + _mat_row(path, "instances", at)
    return {"edges": instance_boundary(instance) > 0}


def _mat_row(path: Path, table: str, at: int) -> NDArray[Any]:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return np.asarray(file[table][at]).T
    except (OSError, KeyError, ValueError, RuntimeError):
        raise BadInput(
            path, table, "missing or damaged; is this nyu_depth_v2_labeled.mat?"
        ) from None


def _class_map(path: Path) -> NDArray[np.uint8]:
    """(895,) class 0..40 of each of NYUv2's labels, 0 first."""
    if not path.is_file():
        hint = "from the code of Gupta et al. 2013"
        raise BadInput(path, "", "needed beside the .mat for classes", hint=hint)
    classes = _mat_numbers(path, "mapClass")
    return np.concatenate([[0], classes]).astype(np.uint8)


def _mat_numbers(path: Path, name: str) -> NDArray[np.int64]:
    """A table of whole numbers of a MATLAB 5 file."""
    from scipy.io import loadmat

    try:
        return np.asarray(loadmat(path)[name], np.int64).ravel()
    except Exception:  # noqa: BLE001  scipy raises of many kinds for a file that is none
        raise BadInput(path, name, "not the MATLAB 5 file that was expected") from None


def nyu_arrays(path: Path, plan: TrainingPlan, split: str) -> ViewArrays:
    """The pictures of a split ("train", "test"), truth by the nearest pixel, lines kept whole.

    Raises BadInput for a file that is none, or has no splits.mat beside it.
    """
    ids, rows = [], []
    for picture in nyu_pictures(path, plan, split):
        ids.append(f"{NYU_HOME}/{picture.id}")
        truth = truth_at_size(picture.truth, plan)
        camera = {CAMERA: picture.camera} if plan.rays else {}
        rows.append({"colour": picture.colour, **truth, **camera})
    arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    return ViewArrays(tuple(ids), arrays.pop("colour"), arrays)
