"""Predictions of other programs for the same pictures, scored like those of a run. Effects: reads files.

One file per picture, named by the picture's id (`kitchen/0001`) or its last part: NAME_normal.png,
NAME_semantic.png (NAME_nyu13.png for 13 classes), NAME_edges.png or NAME_depth.png in the encoding of
`predict`, or NAME.npy: normals (H, W, 3) in OpenCV's axes (x right, y down, z forward), class ids,
edges 0..1, or metres.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import naming_kind, read_given
from pbrs_farm.study.judging.evaluation import JudgedViews
from pbrs_farm.study.photographs import middle_of_form
from pbrs_farm.study.tasks.study_task import StudyTask
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training_plan import TrainingPlan

_MOST_VALUES: Final = 300_000_000  # maximum size of an array


@dataclass(frozen=True, slots=True)
class OthersPredictions:
    """A folder of predictions, and its name in tables."""

    name: str
    folder: Path


def others_predictions(word: str) -> OthersPredictions:
    """Parse `[NAME=]DIR`, by default with the folder's name; BadInput if it is no folder."""
    label, equals, place = word.partition("=")
    folder = Path(place if equals else word)
    if not folder.is_dir():
        raise BadInput(folder, "", "no such folder of predictions")
    return OthersPredictions(label if equals else folder.name, folder)


def predictions_in(
    predictions: OthersPredictions, views: JudgedViews, plan: TrainingPlan
) -> Iterator[NDArray[Any]] | None:
    """A prediction of each view at the size of its truth, in order; None if no view has a file.

    A picture of another aspect ratio is cropped about its middle, as photographs are. Raises
    BadInput if only some views have a file, and for a damaged file.
    """
    task = task_of(plan.task)
    kind = task.file_kind(plan)
    files = _files_of(predictions.folder, views.ids, kind)
    if not any(files):
        return None
    for id, file in zip(views.ids, files, strict=True):
        if file is None:
            text = f"no prediction of {id}: {_prediction_names(id, kind)[0]} and the like"
            raise BadInput(predictions.folder, "", text, hint="all pictures of a place, or none")
    return (
        _cropped_to_size(_read_prediction(file, task), size)
        for file, size in zip(files, views.sizes, strict=True)
        if file is not None
    )


def _files_of(folder: Path, ids: Sequence[str], kind: str) -> list[Path | None]:
    """The file of each view; the last part of an id is enough if it is unique."""
    ends = Counter(id.rpartition("/")[2] for id in ids)
    files: list[Path | None] = []
    for id in ids:
        end = id.rpartition("/")[2]
        names = [
            name
            for stem in dict.fromkeys((id, end))
            if stem == id or ends[end] == 1
            for name in _prediction_names(stem, kind)
        ]
        files.append(next((folder / name for name in names if (folder / name).is_file()), None))
    return files


def _prediction_names(stem: str, kind: str) -> list[str]:
    # The prediction of a photograph NAME_rgb may have that name.
    return [f"{stem}{more}{end}" for more in ("", "_rgb") for end in (f"_{kind}.png", ".npy")]


def _read_prediction(path: Path, task: StudyTask) -> NDArray[Any]:
    """A prediction as the task's scorer takes it."""
    data = read_given(path)
    if path.suffix == ".npy":
        return _checked(_array_of_npy(path, data), path, task)
    stored = array_from_png(data, str(path))
    if task.name == "normals" and (stored.dtype != np.uint16 or stored.ndim != 3):
        raise BadInput(path, "", "expected a picture of three channels of 16 bits")
    return _checked(task.restored(stored), path, task)


def _array_of_npy(path: Path, data: bytes) -> NDArray[Any]:
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, OSError, EOFError):
        with naming_kind(path):
            raise BadInput(path, "", "not an array of numpy, or damaged") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiub":
        raise BadInput(path, "", "expected numbers")
    return array


def _checked(array: NDArray[Any], path: Path, task: StudyTask) -> NDArray[Any]:
    n_axes = 3 if task.name == "normals" else 2
    is_form = array.ndim == n_axes and (n_axes == 2 or array.shape[2] == 3)
    if not is_form or not 0 < array.size <= _MOST_VALUES:
        form = "(H, W, 3)" if n_axes == 3 else "(H, W)"
        raise BadInput(path, "", f"expected {form}, got {array.shape}")
    if not np.isfinite(array).all():
        raise BadInput(path, "", "has a value that is not a finite number")
    if task.name == "segmentation":
        return np.asarray(np.clip(array, 0, 255), np.uint8)
    values: NDArray[Any] = array.astype(np.float32)
    if task.name == "normals":
        values = values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-6)
    return values


def _cropped_to_size(prediction: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """The middle of a prediction at (height, width)."""
    height, width = size
    rows, columns = middle_of_form(prediction.shape[0], prediction.shape[1], width, height)
    return np.asarray(resized_nearest(prediction[rows, columns], width, height))
