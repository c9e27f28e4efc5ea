"""Depth along the camera's axis, trained and scored up to the scale of the room."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.metrics.depth_errors import DepthErrors
from pbrs_farm.study.tasks.losses import depth_loss
from pbrs_farm.study.tasks.study_task import (
    WITHOUT_TRUTH,
    Arrays,
    Batch,
    StudyTask,
    TaskScorer,
    grey_picture,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

_FARTHEST_M: Final = 8.0  # depth from which pictures are black
_LN_RANGE: Final = (-3.0, 5.0)  # clamp of predicted ln metres: 5 cm to 148 m


class DepthTask(StudyTask):
    """Metres along the axis, 0 = unknown; the network predicts their logarithm."""

    name = "depth"
    layers = ("colour", "depth")
    targets_of_pixels = ("depth",)
    figures = ("scale_invariant", "abs_rel", "below_1_25", "rms_m")
    error_name = "spread of ln depth, scale-invariant"
    truth = "rendered: depth along the axis, where a pixel sees a surface"

    def n_out(self, plan: TrainingPlan) -> int:
        return 1

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """depth (H, W) float32 metres, 0 = unknown."""
        if sample.depth is None:
            raise BadInput(sample.id, "depth", "the view has no depth")
        return {"depth": sample.depth}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        return depth_loss(output, batch["depth"])

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        """Not implemented: a rotation changes every depth, so plans for depth have no rotation."""
        raise NotImplementedError

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W) float32 metres."""
        return np.asarray(torch.exp(output.float()[:, 0].clamp(*_LN_RANGE)).numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The geometric mean of each pixel, metres."""
        total = np.zeros(targets[0]["depth"].shape)
        n = np.zeros(total.shape, np.int64)
        for target in targets:
            valid = target["depth"] > 0
            total += np.log(np.where(valid, target["depth"], 1))
            n += valid
        overall = total.sum() / max(int(n.sum()), 1)
        mean = np.where(n > 0, total / np.maximum(n, 1), overall)
        return "mean depth", np.asarray(np.exp(mean), np.float32)

    def scorer(self, plan: TrainingPlan) -> TaskScorer:
        errors = DepthErrors()
        return TaskScorer(lambda p, t: errors.add(p, t["depth"], t["depth"] > 0), errors.score)

    def error(self, figures: dict[str, float]) -> float:
        return figures["scale_invariant"]

    def error_text(self, error: float) -> str:
        return f"{100 * error:.0f} % spread of depth"

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """Error of the logarithm; a factor of two is 1."""
        valid = truth["depth"] > 0
        ratio = np.log(np.maximum(prediction, 1e-6) / np.where(valid, truth["depth"], 1))
        return np.abs(ratio) / np.log(2), valid

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """Light for near, black from eight metres on, dark blue for unknown."""
        depth = np.asarray(prediction, np.float64)
        picture = grey_picture(1 - np.clip(depth / _FARTHEST_M, 0, 1))
        picture[depth <= 0] = WITHOUT_TRUTH
        return picture

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        return truth["depth"]

    def file_kind(self, plan: TrainingPlan) -> str:
        return "depth"

    def stored(self, prediction: NDArray[Any]) -> NDArray[Any]:
        """Millimetres, clipped to 16 bits."""
        return np.asarray(np.clip(np.rint(prediction * 1000), 1, 65535), np.uint16)

    def restored(self, stored: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(stored / 1000.0)
