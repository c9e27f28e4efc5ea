"""NYUv2's nyu_depth_v2_labeled.mat as views to judge on: normals, classes, boundaries. Effects: reads files.

Pictures are cut to Eigen's crop. Normals are planes fitted to the filled depth; classes need
classMapping40.mat beside the file (894 names to 40, Gupta et al. 2013); with splits.mat beside it
the 654 test pictures judge, else all.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import NyuMat, Photo
from pbrs_farm.study.judging.pair_views import PLANE_TRUTH, framed, normal_truth, normals_of_photo
from pbrs_farm.study.judging.photo_views import JudgedViews
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.training_plan import Plan
from pbrs_farm.truth.boundary import instance_boundary

# Of the colour camera, as the data set's toolbox has it.
_K: Final = np.array([[518.85790, 0, 325.58245], [0, 519.46961, 253.73617], [0, 0, 1]], np.float64)
_CROP: Final = (slice(44, 471), slice(40, 601))  # Eigen's rows and columns
_TRUTHS: Final = {
    "normals": PLANE_TRUTH,
    "segmentation": "40 classes by classMapping40.mat, where labelled",
    "boundaries": "lines where the instance changes; matched within 0.011 of the diagonal",
}


def nyu_views(path: Path, plan: Plan, name: str) -> JudgedViews:
    """The test pictures of the .mat; BadInput for a file that is none, or lacks what a task needs."""
    splits, mapping = path.parent / "splits.mat", path.parent / "classMapping40.mat"
    tested = set(_numbers(splits, "testNdxs").tolist()) if splits.is_file() else None
    classes = _class_map(mapping) if plan.task == "segmentation" else np.zeros(0, np.uint8)
    ids, colours, truths = [], [], []
    with NyuMat(path) as mat:
        for number, photo in enumerate(mat.photos(), 1):
            if tested is not None and number not in tested:
                continue
            truth = _truth(path, number - 1, photo, plan, classes)
            colour, rows, columns = framed(photo.rgb[_CROP], plan)
            ids.append(photo.id)
            colours.append(colour)
            truths.append({key: array[_CROP][rows, columns] for key, array in truth.items()})
    if not ids:
        raise BadInput(path, "", "no test picture: splits.mat is of another file")
    which = f"{len(ids)} test pictures" if tested is not None else "all pictures, no splits.mat"
    truth_said = f"{_TRUTHS[plan.task]}; Eigen's crop; {which}"
    return JudgedViews(name, truth_said, tuple(ids), np.stack(colours), tuple(truths))


def _truth(path: Path, at: int, photo: Photo, plan: Plan, classes: NDArray[np.uint8]) -> Arrays:
    """A whole picture's truth in the form of the task's targets."""
    if plan.task == "normals":
        return normal_truth(*normals_of_photo(photo, _K))
    labels = _row(path, "labels", at)
    if plan.task == "segmentation":
        if int(labels.max(initial=0)) >= len(classes):
            raise BadInput(path, f"image {at + 1}", f"label {labels.max()} is beyond the class map")
        return {"labels": classes[labels]}
    # An instance is a number within its class.
    instance = labels.astype(np.int64) * 1000 + _row(path, "instances", at)
    return {"edges": instance_boundary(instance) > 0}


def _row(path: Path, table: str, at: int) -> NDArray[Any]:
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
    classes = _numbers(path, "mapClass")
    return np.concatenate([[0], classes]).astype(np.uint8)


def _numbers(path: Path, name: str) -> NDArray[np.int64]:
    """A table of whole numbers of a MATLAB 5 file."""
    from scipy.io import loadmat

    try:
        return np.asarray(loadmat(path)[name], np.int64).ravel()
    except Exception:  # noqa: BLE001  scipy raises of many kinds for a file that is none
        raise BadInput(path, name, "not the MATLAB 5 file that was expected") from None
