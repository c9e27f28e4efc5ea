"""Semantic segmentation: NYU40's or NYU13's classes, judged by one confusion matrix; no effects."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.metrics.confusion import Confusion
from pbrs_farm.study.tasks.losses import class_loss
from pbrs_farm.study.tasks.study_task import Arrays, Batch
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

_NYU13: Final = len(NYU13_NAMES) - 1


def class_names(plan: TrainingPlan) -> tuple[str, ...]:
    """Name of each id of a plan's classes; 0 is "none"."""
    return NYU13_NAMES if plan.n_classes == _NYU13 else NYU40_NAMES


def classes_of(class40: NDArray[np.uint8], plan: TrainingPlan) -> NDArray[np.uint8]:
    """NYU40 ids as the plan's classes: grouped to NYU13 where it has 13, else as they are."""
    if plan.n_classes != _NYU13:
        return class40
    grouped: NDArray[np.uint8] = NYU13_FROM_NYU40[np.minimum(class40, len(NYU40_NAMES) - 1)]
    return grouped


class ClassesTask:
    """Ids 1 to n_classes; 0 is no label and does not count."""

    name: str = "segmentation"
    layers: tuple[str, ...] = ("colour", "class40")
    figures: tuple[str, ...] = ("mean_iou", "pixel_accuracy", "mean_accuracy", "weighted_iou")
    error_name: str = "share of pixels of another class"
    error_scale: float = 100
    error_unit: str = " %"
    truth: str = "rendered: class of the surface seen, where it has one"

    def n_out(self, plan: TrainingPlan) -> int:
        """A score a class."""
        return plan.n_classes

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """labels (H, W) uint8."""
        if sample.class40 is None:
            raise BadInput(sample.id, "class40", "the view has no classes")
        # A class beyond the network's would be an index outside its scores.
        labels = classes_of(sample.class40, plan)
        highest = int(labels.max(initial=0))
        if highest > plan.n_classes:
            name = f" ({NYU40_NAMES[highest]})" if highest < len(NYU40_NAMES) else ""
            text = f"holds class {highest}{name}; the network has {plan.n_classes}"
            raise BadInput(sample.id, "class40", text)
        return {"labels": labels}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        """Cross entropy over labelled pixels."""
        return class_loss(output, batch["labels"], over=plan.loss_over)

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """Left and right change places."""
        labels = batch["labels"]
        turned = torch.where(flips[:, None, None], labels.flip(2), labels)
        return batch | {"labels": turned}

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """Labels have no direction."""
        return batch

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W) uint8 ids of the highest score."""
        # Channel 0 is class 1: no label has no score.
        return np.asarray((output.argmax(1) + 1).to(torch.uint8).numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The class that most pixels of the training views have, everywhere."""
        # No label (0) must not win.
        counts = np.zeros(256, np.int64)
        for target in targets:
            counts += np.bincount(target["labels"].ravel(), minlength=256)
        counts[0] = 0
        most = max(int(counts.argmax()), 1)
        names = class_names(plan)
        name = names[most] if most < len(names) else str(most)
        return f"always {name}", np.full(targets[0]["labels"].shape, most, np.float32)

    def scorer(self, plan: TrainingPlan) -> ClassScorer:
        """One matrix over all views."""
        return ClassScorer(plan.n_classes)

    def error(self, figures: dict[str, float]) -> float:
        """The share of pixels of another class."""
        return 1 - figures["pixel_accuracy"]

    def error_text(self, error: float) -> str:
        """The share of pixels of another class."""
        return f"{100 * error:.0f} % wrong"

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """1 where the class is another."""
        wrong = (prediction != truth["labels"]).astype(np.float64)
        return wrong, truth["labels"] > 0

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """A colour a class, no class black."""
        return np.asarray(_colours()[prediction.astype(np.intp)], np.uint8)

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        """The labels."""
        return truth["labels"]


class ClassScorer:
    """A confusion matrix of views that come one by one."""

    def __init__(self, n_classes: int) -> None:
        self._confusion = Confusion(n_classes)

    def add(self, prediction: NDArray[Any], truth: Arrays) -> float:
        """The view's share of wrong pixels."""
        try:
            return 1 - self._confusion.add(prediction, truth["labels"])
        except ValueError as error:
            raise BadInput("labels", "", str(error)) from None

    def figures(self) -> dict[str, float]:
        """Shares 0..1."""
        return asdict(self._confusion.score())


def _colours() -> NDArray[np.uint8]:
    """(256, 3): hues a golden angle apart, so that neighbours in number differ."""
    k = np.arange(256)
    # Three cosines a third of a turn apart are red, green and blue of a hue.
    phase = (k[:, None] * 0.618034 + np.array([0, 1 / 3, 2 / 3])) % 1
    # Three brightnesses in turn tell apart hues that come close.
    light = 0.55 + 0.35 * ((k % 3) / 2)[:, None]
    colours = 255 * light * (0.5 + 0.5 * np.cos(2 * np.pi * phase))
    colours[0] = 0
    return np.asarray(colours, np.uint8)
