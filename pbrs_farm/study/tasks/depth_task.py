"""Depth along the camera's axis, trained and judged up to the room's scale; no effects."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.metrics.depth_errors import DepthErrors
from pbrs_farm.study.tasks.study_task import Arrays, Batch
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

_SCALE_SHARE: Final = 0.5  # of the common error of a view that the loss forgives
_FARTHEST_M: Final = 8.0  # of the pictures for eyes: from there on all is alike
_LN_RANGE: Final = (-3.0, 5.0)  # of what a network may say: 5 cm to 148 m


def depth_loss(output: Tensor, depth: Tensor) -> Tensor:
    """(B,) of log depths (B, 1, H, W) and metres (B, H, W), 0 = unknown.

    Eigen et al. 2014, equation 4: the mean square of d = output - ln depth, less half the square of
    its mean, so that a wrong scale of the whole view costs half.
    """
    known = depth > 0
    n = known.sum((1, 2)).clamp(min=1)
    d = output.float()[:, 0] - torch.log(torch.where(known, depth, torch.ones_like(depth)))
    d = torch.where(known, d, torch.zeros_like(d))
    return (d**2).sum((1, 2)) / n - _SCALE_SHARE * (d.sum((1, 2)) / n) ** 2


class DepthTask:
    """Metres along the axis, 0 = unknown; the network says their logarithm."""

    name: str = "depth"
    layers: tuple[str, ...] = ("colour", "depth")
    figures: tuple[str, ...] = ("scale_invariant", "abs_rel", "below_1_25", "rms_m")
    error_name: str = "spread of ln depth, scale-invariant"
    error_scale: float = 100
    error_unit: str = " %"
    truth: str = "rendered: depth along the axis, where a pixel sees a surface"

    def n_out(self, plan: TrainingPlan) -> int:
        """The logarithm of metres."""
        return 1

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """depth (H, W) float32 metres, 0 = unknown."""
        if sample.depth is None:
            raise BadInput(sample.id, "depth", "the view has no depth")
        return {"depth": sample.depth}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        """Of the logarithm, half forgiving a view's scale."""
        return depth_loss(output, batch["depth"])

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """Left and right change places."""
        depth = batch["depth"]
        return batch | {"depth": torch.where(flips[:, None, None], depth.flip(2), depth)}

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """Never asked: a plan for depth turns no camera, whose new axis would change every depth."""
        raise NotImplementedError

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W) float32 metres."""
        return np.asarray(torch.exp(output.float()[:, 0].clamp(*_LN_RANGE)).numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The mean logarithm of each pixel, as metres."""
        total = np.zeros(targets[0]["depth"].shape)
        n = np.zeros(total.shape, np.int64)
        for target in targets:
            known = target["depth"] > 0
            total += np.log(np.where(known, target["depth"], 1))
            n += known
        overall = total.sum() / max(int(n.sum()), 1)
        mean = np.where(n > 0, total / np.maximum(n, 1), overall)
        return "mean depth", np.asarray(np.exp(mean), np.float32)

    def scorer(self, plan: TrainingPlan) -> DepthScorer:
        """Errors over all known pixels of all views."""
        return DepthScorer()

    def error(self, figures: dict[str, float]) -> float:
        """The scale-invariant one."""
        return figures["scale_invariant"]

    def error_text(self, error: float) -> str:
        """The spread of ln depth."""
        return f"{100 * error:.0f} % spread of depth"

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """The logarithm's error: twice or half as far is 1."""
        known = truth["depth"] > 0
        ratio = np.log(np.maximum(prediction, 1e-6) / np.where(known, truth["depth"], 1))
        return np.abs(ratio) / np.log(2), known

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """Near is light, from eight metres on black; unknown is dark blue."""
        depth = np.asarray(prediction, np.float64)
        grey = np.rint(255 * (1 - np.clip(depth / _FARTHEST_M, 0, 1)))
        picture = np.repeat(grey[..., None], 3, axis=-1).astype(np.uint8)
        picture[depth <= 0] = (24, 34, 72)
        return picture

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        """The metres."""
        return truth["depth"]


class DepthScorer:
    """Depths of views that come one by one."""

    def __init__(self) -> None:
        self._errors = DepthErrors()

    def add(self, prediction: NDArray[Any], truth: Arrays) -> float:
        """The view's own spread."""
        return self._errors.add(prediction, truth["depth"], truth["depth"] > 0)

    def figures(self) -> dict[str, float]:
        """Shares and metres."""
        return asdict(self._errors.score())
