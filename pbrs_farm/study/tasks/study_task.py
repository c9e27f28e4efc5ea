"""Base class of the tasks: targets, loss, figures, and the files and pictures of predictions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

Arrays = dict[str, NDArray[Any]]
Batch = dict[str, Tensor]
WITHOUT_TRUTH: Final = (24, 34, 72)  # sRGB of pixels without truth, dark blue


@dataclass(frozen=True, slots=True)
class TaskScorer:
    """Figures of a task, accumulated view by view."""

    add: Callable[[NDArray[Any], Arrays], float]  # (prediction, truth) -> error of the view, or NaN
    score: Callable[[], Any]  # a dataclass of figures

    def figures(self) -> dict[str, float]:
        """The figures of the views so far, by the names of StudyTask.figures."""
        return asdict(self.score())


class StudyTask(ABC):
    """One of normals, segmentation, boundaries and depth."""

    name: str
    layers: tuple[str, ...]  # requested of each view
    targets_of_pixels: tuple[str, ...]  # arrays (B, H, W, ...) of targets in a batch
    figures: tuple[str, ...]  # columns of a table; runs are ranked by the first
    error_name: str  # description of `error`, with its unit
    error_scale: float = 100  # factor of an error in texts: 1, or 100 for shares
    error_unit: str = " %"  # suffix of an error in texts
    truth: str  # description of the truth and its mask

    @abstractmethod
    def n_out(self, plan: TrainingPlan) -> int:
        """Channels of the network's output."""

    @abstractmethod
    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """Training targets of a view; BadInput for a view without them."""

    @abstractmethod
    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        """(B,) losses, averaged by the caller."""

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """The batch with the targets of some views mirrored left to right; flips (B,) bool."""
        targets = {name: batch[name] for name in self.targets_of_pixels}
        return batch | {name: flipped(x, x.flip(2), flips) for name, x in targets.items()}

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """The batch with directions rotated by (B, 3, 3), after its pixels were moved."""
        return batch

    def mirror_mean(self, output: Tensor, mirrored: Tensor) -> Tensor:
        """Mean output of a picture and of its mirrored copy, whose output was flipped back."""
        return (output + mirrored) / 2

    @abstractmethod
    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W, ...) predictions from the network's output."""

    @abstractmethod
    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """Name and value of the best constant prediction for the training views."""

    @abstractmethod
    def scorer(self, plan: TrainingPlan) -> TaskScorer:
        """A scorer without views."""

    @abstractmethod
    def error(self, figures: dict[str, float]) -> float:
        """One number from the figures, 0 for a perfect network; decides "underfit"."""

    def error_text(self, error: float) -> str:
        """The error of a view as text, such as "12.3 degrees" or "8 % wrong"."""
        return f"{100 * error:.0f} % wrong"

    @abstractmethod
    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """(H, W) error of each pixel, 0 for none and 1 for the largest shown, and (H, W) the mask of the truth."""

    @abstractmethod
    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """(H, W, 3) colours of a prediction."""

    @abstractmethod
    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        """The truth in the form of a prediction."""

    @abstractmethod
    def file_kind(self, plan: TrainingPlan) -> str:
        """Suffix of the file of a prediction: normal, semantic (NYU40), nyu13, edges or depth."""

    @abstractmethod
    def stored(self, prediction: NDArray[Any]) -> NDArray[Any]:
        """A prediction in the encoding of its file, uint8 or uint16."""

    @abstractmethod
    def restored(self, stored: NDArray[Any]) -> NDArray[Any]:
        """A prediction from the encoding of its file."""


def flipped(plain: Tensor, mirrored: Tensor, flips: Tensor) -> Tensor:
    """(B, ...) mirrored where flips (B,) is set, else plain."""
    return torch.where(flips.view(-1, *(1,) * (plain.ndim - 1)), mirrored, plain)


def grey_picture(values: NDArray[Any]) -> NDArray[np.uint8]:
    """(H, W, 3) grey levels of values (H, W), 0 black to 1 white."""
    grey = np.rint(255 * values).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)
