"""What other programs say of the same pictures, as files: judged as a run's own predictions. Effects: reads them.

A file a picture, named by the picture's id (`kitchen/0001`) or its last part: NAME_normal.png,
NAME_semantic.png (NAME_nyu13.png of 13 classes), NAME_edges.png or NAME_depth.png as `predict` writes
them, or NAME.npy: normals (H, W, 3) in OpenCV's axes (x right, y down, z forward), ids of classes, edges
0..1, or metres.
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

from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.images import array_from_png
from pbrs_farm.regular_files import naming_kind, read_given
from pbrs_farm.study.judging.evaluation import JudgedViews
from pbrs_farm.study.tasks.classes_task import class_names
from pbrs_farm.study.training_plan import TrainingPlan

_KINDS: Final = {
    "normals": "normal",
    "segmentation": "semantic",
    "boundaries": "edges",
    "depth": "depth",
}
_MOST_VALUES: Final = 300_000_000  # of an array; more is refused


def file_kind(plan: TrainingPlan) -> str:
    """What the names of a plan's predictions end with: normal, semantic (NYU40), nyu13, edges, depth."""
    is_grouped = plan.task == "segmentation" and class_names(plan) == NYU13_NAMES
    return "nyu13" if is_grouped else _KINDS[plan.task]


@dataclass(frozen=True, slots=True)
class OthersPredictions:
    """A folder of them. name: what a table calls them."""

    name: str
    folder: Path


def others_predictions(word: str) -> OthersPredictions:
    """`[NAME=]DIR`. Raises BadInput for what is no folder.

    Without a NAME the folder's own. Which files are in it is asked later, a view at a time.
    """
    label, equals, place = word.partition("=")
    folder = Path(place if equals else word)
    if not folder.is_dir():
        raise BadInput(folder, "", "no such folder of predictions")
    return OthersPredictions(label if equals else folder.name, folder)


def predictions_in(
    others: OthersPredictions, views: JudgedViews, plan: TrainingPlan
) -> Iterator[NDArray[Any]] | None:
    """A prediction of each view, of its truth's size, in order; None where there is a file for none.

    A picture of another form than the truth is cut about its middle, as photographs are. Raises
    BadInput for a view that alone has no file, and for a file that is none.
    """
    kind = file_kind(plan)
    files = _files_of(others.folder, views.ids, kind)
    if not any(files):
        return None
    for at, file in zip(views.ids, files, strict=True):
        if file is None:
            text = f"no prediction of {at}: {_prediction_names(at, kind)[0]} and the like"
            raise BadInput(others.folder, "", text, hint="all pictures of a place, or none")
    return (
        _fitted(_read_prediction(file, plan.task), size)
        for file, size in zip(files, views.sizes, strict=True)
        if file is not None
    )


def _files_of(folder: Path, ids: Sequence[str], kind: str) -> list[Path | None]:
    """The file of each view. The last part of an id names it where no other id ends so."""
    ends = Counter(at.rpartition("/")[2] for at in ids)
    found: list[Path | None] = []
    for at in ids:
        end = at.rpartition("/")[2]
        names = _prediction_names(at, kind) + (
            _prediction_names(end, kind) if ends[end] == 1 else []
        )
        found.append(next((folder / name for name in names if (folder / name).is_file()), None))
    return found


def _prediction_names(at: str, kind: str) -> list[str]:
    # A photograph that is called NAME_rgb is predicted under that name.
    return [f"{at}{more}{end}" for more in ("", "_rgb") for end in (f"_{kind}.png", ".npy")]


def _read_prediction(path: Path, task: str) -> NDArray[Any]:
    """A prediction as a task's scorer takes it."""
    data = read_given(path)
    if path.suffix == ".npy":
        return _checked(_prediction_array(path, data), path, task)
    stored = array_from_png(data, str(path))
    if task == "normals":
        if stored.dtype != np.uint16 or stored.ndim != 3:
            raise BadInput(path, "", "expected a picture of three channels of 16 bits")
        # From the layer's axes, x right, y forward, z up, to OpenCV's.
        x, y, z = np.moveaxis(stored.astype(np.float64) * 2 / 65535 - 1, -1, 0)
        return _checked(np.stack([x, -z, y], -1), path, task)
    # Edges are 255 x how likely, depth is in millimetres.
    unit = {"boundaries": 255.0, "depth": 1000.0}.get(task)
    return _checked(stored / unit if unit else stored, path, task)


def _prediction_array(path: Path, data: bytes) -> NDArray[Any]:
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, OSError, EOFError):
        with naming_kind(path):
            raise BadInput(path, "", "not an array of numpy, or damaged") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiub":
        raise BadInput(path, "", "expected numbers")
    return array


def _checked(array: NDArray[Any], path: Path, task: str) -> NDArray[Any]:
    wanted = 3 if task == "normals" else 2
    is_form = array.ndim == wanted and (wanted == 2 or array.shape[2] == 3)
    if not is_form or not 0 < array.size <= _MOST_VALUES:
        form = "(H, W, 3)" if wanted == 3 else "(H, W)"
        raise BadInput(path, "", f"expected {form}, got {array.shape}")
    if not np.isfinite(array).all():
        raise BadInput(path, "", "holds what is no finite number")
    if task == "segmentation":
        return np.asarray(np.clip(array, 0, 255), np.uint8)
    values: NDArray[Any] = array.astype(np.float32)
    if task == "normals":
        values = values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-6)
    return values


def _fitted(prediction: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """The middle of a prediction in the form of (height, width), at that size."""
    height, width = prediction.shape[:2]
    share = size[1] / size[0]
    rows, columns = min(height, round(width / share)), min(width, round(height * share))
    top, left = (height - rows) // 2, (width - columns) // 2
    middle = prediction[top : top + max(rows, 1), left : left + max(columns, 1)]
    return np.asarray(resized_nearest(middle, size[1], size[0]))
