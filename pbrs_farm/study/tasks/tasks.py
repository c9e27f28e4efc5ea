"""The task by its name; no effects."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.metrics.angular import AngularErrors
from pbrs_farm.study.metrics.confusion import Confusion
from pbrs_farm.study.networks.vgg import edges_of_sides
from pbrs_farm.study.tasks.depth_task import DepthTask
from pbrs_farm.study.tasks.study_task import Arrays, Batch, StudyTask
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

# The three losses, a number for each view whose mean is the loss; pure.


def normal_loss(output: Tensor, normal: Tensor, valid: Tensor, *, kind: str, over: str) -> Tensor:
    """(B,) of output and unit normals (B, 3, H, W) and valid (B, H, W); its mean is the loss.

    kind: "cosine", 1 - cos of the angle (paper section 4.1), or "chord", the distance of the unit
    vectors, which far outliers pull less. The gradient of a pixel that is not valid is exactly 0.
    over: the mean is over "valid" pixels, or over "all", as released: what is not valid dilutes it.
    """
    unit = functional.normalize(output.float(), dim=1, eps=1e-6)
    cosine = (unit * normal).sum(1)
    miss = 1 - cosine
    if kind == "chord":
        miss = torch.sqrt((2 * miss).clamp(min=0) + 1e-6)
    miss = torch.where(valid, miss, torch.zeros_like(miss))
    return miss.sum((1, 2)) / _n_mean(valid, over)


def class_loss(output: Tensor, labels: Tensor, *, over: str) -> Tensor:
    """(B,) cross entropy of scores (B, C, H, W) and labels (B, H, W): ids 1..C, 0 is left out."""
    target = labels.long() - 1
    entropy = functional.cross_entropy(output.float(), target, reduction="none", ignore_index=-1)
    return entropy.sum((1, 2)) / _n_mean(labels > 0, over)


def edge_loss(scores: Tensor, edges: Tensor, *, as_sum: bool) -> Tensor:
    """(B,) class-balanced cross entropy of scores (B, S, H, W), summed over S; edges (B, H, W) bool.

    Of each view an edge weighs the share of pixels that are none, and the other way round (Xie and
    Tu 2015, equation 2). as_sum: over the pixels, as released, else their mean.
    """
    target = edges.float()
    share = target.mean((1, 2), keepdim=True)
    weights = torch.where(edges, 1 - share, share)[:, None]
    target = target[:, None].expand_as(scores)
    loss = weights * functional.binary_cross_entropy_with_logits(
        scores.float(), target, reduction="none"
    )
    pixels = edges.shape[1] * edges.shape[2]
    return loss.sum((1, 2, 3)) / (1 if as_sum else pixels)


def _n_mean(counted: Tensor, over: str) -> Tensor | float:
    """What each view's sum is divided by, so that the mean over views is one over pixels."""
    if over == "all":
        return float(counted.shape[1] * counted.shape[2])
    return counted.sum().clamp(min=1) / counted.shape[0]


# Semantic segmentation: NYU40's or NYU13's classes, judged by one confusion matrix; pure.

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


# Surface normals: unit vectors in the camera's frame, judged by their angle to the truth; pure.


_SCALE = 32767  # a stored component of 1


class NormalsTask:
    """Axes are OpenCV's: x right, y down, z forward."""

    name: str = "normals"
    layers: tuple[str, ...] = ("colour", "normal")
    figures: tuple[str, ...] = (
        "mean_deg", "median_deg", "below_11_25", "below_22_5", "below_30", "below_5", "below_7_5", "rms_deg",
    )  # fmt: skip
    error_name: str = "mean angle, degrees"
    truth: str = "rendered: the surface's own normal, where a pixel sees a surface"

    def n_out(self, plan: TrainingPlan) -> int:
        """x, y and z."""
        return 3

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """normal (H, W, 3) int16 and valid (H, W)."""
        if sample.normal is None or sample.valid is None:
            raise BadInput(sample.id, "normal", "the view has no normals")
        return {"normal": np.rint(sample.normal * _SCALE).astype(np.int16), "valid": sample.valid}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        """The angle's cosine over valid pixels."""
        normal = batch["normal"].permute(0, 3, 1, 2).float() / _SCALE
        valid = batch["valid"]
        return normal_loss(output, normal, valid, kind=plan.loss, over=plan.loss_over)

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """Left and right change places, and what points right points left."""
        turned = dict(batch)
        turned["valid"] = _where(flips, batch["valid"].flip(2), batch["valid"])
        # Mirroring flips the sign of x.
        signs = torch.tensor([-1, 1, 1], dtype=batch["normal"].dtype, device=flips.device)
        turned["normal"] = _where(flips, batch["normal"].flip(2) * signs, batch["normal"])
        return turned

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """Normals turn with the camera."""
        normal = torch.einsum("bij,bhwj->bhwi", rotation, batch["normal"].float())
        return batch | {"normal": normal.round().to(batch["normal"].dtype)}

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W, 3) float32 unit vectors."""
        unit = functional.normalize(output.float(), dim=1, eps=1e-6)
        return np.asarray(unit.permute(0, 2, 3, 1).contiguous().numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The mean normal of each pixel: half of what is known of a room needs no picture."""
        total = np.zeros(targets[0]["normal"].shape, np.float64)
        for target in targets:
            total += target["normal"] * target["valid"][..., None]
        # Where no view is valid take the mean of all.
        empty = np.linalg.norm(total, axis=-1) == 0
        total[empty] = total.sum((0, 1))
        length = np.linalg.norm(total, axis=-1, keepdims=True)
        return "mean normal", np.asarray(total / np.maximum(length, 1e-9), np.float32)

    def scorer(self, plan: TrainingPlan) -> NormalScorer:
        """Degrees over all valid pixels of all views."""
        return NormalScorer()

    def error(self, figures: dict[str, float]) -> float:
        """The mean angle."""
        return figures["mean_deg"]

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """Red to the right, green up, blue towards the camera; nothing is black."""
        known = np.linalg.norm(prediction, axis=-1, keepdims=True) > 0
        # From OpenCV's axes to the usual colours: y up, z towards the camera.
        seen = prediction * np.array([1, -1, -1], np.float32)
        return np.where(known, np.rint((seen + 1) * 127.5), 0).astype(np.uint8)

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        """(H, W, 3) float32, 0 where not valid."""
        return np.where(truth["valid"][..., None], truth["normal"] / np.float32(_SCALE), 0)


class NormalScorer:
    """Angles of views that come one by one."""

    def __init__(self) -> None:
        self._errors = AngularErrors()

    def add(self, prediction: NDArray[Any], truth: Arrays) -> float:
        """The view's own mean angle."""
        return self._errors.add(prediction, truth["normal"], truth["valid"])

    def figures(self) -> dict[str, float]:
        """Degrees and shares."""
        return asdict(self._errors.score())


def _where(flips: Tensor, turned: Tensor, plain: Tensor) -> Tensor:
    return torch.where(flips.view(-1, *(1,) * (plain.ndim - 1)), turned, plain)


# Boundaries of instances: HED's sides, judged after thinning by matching pixels one to one; pure.


N_THRESHOLDS = 33  # of judging; the benchmark's own number is 99


class EdgesTask:
    """The truth are lines where the instance changes (Gupta et al. 2013)."""

    name: str = "boundaries"
    layers: tuple[str, ...] = ("colour", "boundary")
    figures: tuple[str, ...] = ("ods", "ois", "ap", "r50")
    error_name: str = "1 - ODS at 9 thresholds"
    truth: str = "rendered: lines where the instance changes; matched within 0.011 of the diagonal"

    def __init__(self, n_thresholds: int = N_THRESHOLDS) -> None:
        """n_thresholds: of judging."""
        self.n_thresholds = n_thresholds

    def n_out(self, plan: TrainingPlan) -> int:
        """One for networks without sides."""
        return 1

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """edges (H, W) bool."""
        if sample.boundary is None:
            raise BadInput(sample.id, "boundary", "the view has no boundaries")
        return {"edges": sample.boundary}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        """Balanced cross entropy of each side and of the fused map."""
        return edge_loss(output, batch["edges"], as_sum=plan.edge_sum)

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """Left and right change places."""
        edges = batch["edges"]
        return batch | {"edges": torch.where(flips[:, None, None], edges.flip(2), edges)}

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """Labels have no direction."""
        return batch

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W) float32 strengths 0..1."""
        output = output.float()
        # HED gives six maps of scores (five sides, and one fused), other networks one.
        edges = edges_of_sides(output) if output.shape[1] > 1 else torch.sigmoid(output[:, 0])
        return np.asarray(edges.numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """How often each pixel of the training views is an edge."""
        mean = np.mean([target["edges"] for target in targets], axis=0)
        return "mean edges", np.asarray(mean / max(float(mean.max()), 1e-6), np.float32)

    def scorer(self, plan: TrainingPlan) -> EdgeScorer:
        """Counts at each threshold over all views."""
        return EdgeScorer(self.n_thresholds)

    def error(self, figures: dict[str, float]) -> float:
        """What ODS lacks to 1."""
        return 1 - figures["ods"]

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """Edges black on white."""
        grey = np.rint(255 * (1 - np.asarray(prediction, np.float32)))
        return np.repeat(grey[..., None], 3, axis=-1).astype(np.uint8)

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        """The lines, 1."""
        return truth["edges"].astype(np.float32)


class EdgeScorer:
    """Edge counts of views that come one by one."""

    def __init__(self, n_thresholds: int) -> None:
        # Imported where needed: edges are trained without scipy, and judged with it.
        from pbrs_farm.study.metrics.edge_scores import EdgeScores

        self._scores, self._n_thresholds = EdgeScores(), n_thresholds

    def add(self, prediction: NDArray[Any], truth: Arrays) -> float:
        """What the view's own best F lacks to 1."""
        from pbrs_farm.study.metrics.edge_scores import edge_counts

        return 1 - self._scores.add(edge_counts(prediction, truth["edges"], self._n_thresholds))

    def figures(self) -> dict[str, float]:
        """Shares 0..1."""
        return asdict(self._scores.score())


# The task by its name.


def task_of(name: str, n_thresholds: int = 0) -> StudyTask:
    """Raises BadInput for a name that is none.

    n_thresholds: at which boundaries are judged, 0 = the task's own number.
    """
    edges = EdgesTask(n_thresholds) if n_thresholds else EdgesTask()
    tasks: dict[str, StudyTask] = {
        t.name: t for t in (NormalsTask(), ClassesTask(), edges, DepthTask())
    }
    if name not in tasks:
        raise BadInput("task", name, "no such task", hint=f"of {', '.join(tasks)}")
    return tasks[name]
