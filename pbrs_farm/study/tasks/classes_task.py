"""Semantic segmentation into the classes of NYU40 or NYU13, scored by one confusion matrix."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.metrics.confusion import Confusion
from pbrs_farm.study.tasks.losses import class_loss
from pbrs_farm.study.tasks.study_task import Arrays, Batch, StudyTask, TaskScorer
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

_NYU13: Final = len(NYU13_NAMES) - 1


def class_names(plan: TrainingPlan) -> tuple[str, ...]:
    """Name of each class id of a plan; 0 is "none"."""
    return NYU13_NAMES if plan.n_classes == _NYU13 else NYU40_NAMES


def classes_of(class40: NDArray[np.uint8], plan: TrainingPlan) -> NDArray[np.uint8]:
    """NYU40 ids as the plan's classes: grouped to NYU13 if it has 13, else unchanged."""
    if plan.n_classes != _NYU13:
        return class40
    return np.asarray(NYU13_FROM_NYU40[np.minimum(class40, len(NYU40_NAMES) - 1)], np.uint8)


class ClassesTask(StudyTask):
    """Ids 1 to n_classes; 0 is no label and does not count."""

    name = "segmentation"
    layers = ("colour", "class40")
    targets_of_pixels = ("labels",)
    figures = ("mean_iou", "pixel_accuracy", "mean_accuracy", "weighted_iou")
    error_name = "share of pixels of another class"
    truth = "rendered: class of the surface seen, where it has one"

    def n_out(self, plan: TrainingPlan) -> int:
        return plan.n_classes

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """labels (H, W) uint8."""
        if sample.class40 is None:
            raise BadInput(sample.id, "class40", "the view has no classes")
        # A class beyond n_classes would be an index outside the network's scores.
        labels = classes_of(sample.class40, plan)
        highest = int(labels.max(initial=0))
        if highest > plan.n_classes:
            name = f" ({NYU40_NAMES[highest]})" if highest < len(NYU40_NAMES) else ""
            text = f"has class {highest}{name}; the network has {plan.n_classes}"
            raise BadInput(sample.id, "class40", text)
        return {"labels": labels}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        return class_loss(output, batch["labels"], over=plan.loss_over)

    def mirror_mean(self, output: Tensor, mirrored: Tensor) -> Tensor:
        """Mean probability of each class."""
        return (output.softmax(1) + mirrored.softmax(1)) / 2

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W) uint8 ids of the highest score; channel 0 is class 1."""
        return np.asarray((output.argmax(1) + 1).byte().numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The class with the most pixels in the training views."""
        counts = np.zeros(256, np.int64)
        for target in targets:
            counts += np.bincount(target["labels"].ravel(), minlength=256)
        counts[0] = 0
        most = max(int(counts.argmax()), 1)
        names = class_names(plan)
        name = names[most] if most < len(names) else str(most)
        return f"always {name}", np.full(targets[0]["labels"].shape, most, np.float32)

    def scorer(self, plan: TrainingPlan) -> TaskScorer:
        confusion = Confusion(plan.n_classes)

        def add(prediction: NDArray[Any], truth: Arrays) -> float:
            try:
                return 1 - confusion.add(prediction, truth["labels"])
            except ValueError as error:
                raise BadInput("labels", "", str(error)) from None

        return TaskScorer(add, confusion.score)

    def error(self, figures: dict[str, float]) -> float:
        return 1 - figures["pixel_accuracy"]

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        wrong = (prediction != truth["labels"]).astype(np.float64)
        return wrong, truth["labels"] > 0

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """A colour per class, black for none."""
        return np.asarray(_colours()[prediction.astype(np.intp)], np.uint8)

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        return truth["labels"]

    def file_kind(self, plan: TrainingPlan) -> str:
        return "nyu13" if plan.n_classes == _NYU13 else "semantic"

    def stored(self, prediction: NDArray[Any]) -> NDArray[Any]:
        return prediction.astype(np.uint8)

    def restored(self, stored: NDArray[Any]) -> NDArray[Any]:
        return stored


def _colours() -> NDArray[np.uint8]:
    """(256, 3) colours; hues a golden angle apart, so that consecutive ids differ."""
    k = np.arange(256)
    # Three cosines a third of a turn apart are the red, green and blue of a hue.
    phase = (k[:, None] * 0.618034 + np.array([0, 1 / 3, 2 / 3])) % 1
    # Three alternating brightnesses separate similar hues.
    light = 0.55 + 0.35 * ((k % 3) / 2)[:, None]
    colours = 255 * light * (0.5 + 0.5 * np.cos(2 * np.pi * phase))
    colours[0] = 0
    return np.asarray(colours, np.uint8)
