"""What training and judging ask of a task; a protocol, no effects."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

Arrays = dict[str, NDArray[Any]]
Batch = dict[str, Tensor]


class TaskScorer(Protocol):
    """Takes views one by one and says how good the predictions were."""

    def add(self, prediction: NDArray[Any], truth: Arrays) -> float:
        """Count a view; its own error, larger is worse, NaN where it has no truth."""
        ...

    def figures(self) -> dict[str, float]:
        """What the field reports, by the names of Task.figures."""
        ...


class StudyTask(Protocol):
    """One of normals, segmentation, boundaries and depth."""

    name: str
    layers: tuple[str, ...]  # of a Request
    figures: tuple[str, ...]  # what a table shows, runs are compared by the first
    error_name: str  # what `error` is, with its unit
    error_scale: float  # of an error as it is written: 1, or 100 for shares
    error_unit: str  # written behind it: " degrees", " %"
    truth: str  # which truth and which mask, in words

    def n_out(self, plan: TrainingPlan) -> int:
        """Channels of the network's output."""
        ...

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """What of a view is trained and judged on, small; BadInput names what cannot be."""
        ...

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        """(B,) whose mean is the loss."""
        ...

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """The batch with the views where flips (B,) turned left to right."""
        ...

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """The batch where directions are turned by rotation (B, 3, 3); pixels have moved already."""
        ...

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, ...) what the output says of each pixel, as Scorer.add takes it."""
        ...

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """Its name, and the prediction that needs no picture, from the training views' targets."""
        ...

    def scorer(self, plan: TrainingPlan) -> TaskScorer:
        """An empty one."""
        ...

    def error(self, figures: dict[str, float]) -> float:
        """One number, 0 for perfect, that "underfit" is decided by."""
        ...

    def error_text(self, error: float) -> str:
        """A view's own error in words, as "12.3 degrees" or "8 % wrong"."""
        ...

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """(H, W) how wrong each pixel is, 0 = right, 1 or more = as wrong as is shown; (H, W) has a truth."""
        ...

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """(H, W, 3) colours of a prediction or of a truth's prediction_of."""
        ...

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        """The truth in the form of a prediction."""
        ...
