"""Surface normals: unit vectors in the camera's frame, judged by their angle to the truth; no effects."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.metrics.angular import AngularErrors, angles_deg
from pbrs_farm.study.tasks.losses import normal_loss
from pbrs_farm.study.tasks.study_task import Arrays, Batch
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

_SCALE = 32767  # a stored component of 1


_WORST_DEG: Final = 60.0  # of the pictures for eyes: from there on all is alike


class NormalsTask:
    """Axes are OpenCV's: x right, y down, z forward."""

    name: str = "normals"
    layers: tuple[str, ...] = ("colour", "normal")
    figures: tuple[str, ...] = (
        "mean_deg", "median_deg", "below_11_25", "below_22_5", "below_30", "below_5", "below_7_5", "rms_deg",
    )  # fmt: skip
    error_name: str = "mean angle, degrees"
    error_scale: float = 1
    error_unit: str = " degrees"
    truth: str = "rendered: the surface's own normal, where a pixel sees a surface"

    def n_out(self, plan: TrainingPlan) -> int:
        """x, y and z."""
        return 3

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """normal (H, W, 3) int16 and valid (H, W); depth (H, W) metres where it was asked for, to judge by."""
        if sample.normal is None or sample.valid is None:
            raise BadInput(sample.id, "normal", "the view has no normals")
        depth = {} if sample.depth is None else {"depth": sample.depth}
        normal = np.rint(sample.normal * _SCALE).astype(np.int16)
        return {"normal": normal, "valid": sample.valid, **depth}

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

    def error_text(self, error: float) -> str:
        """Degrees."""
        return f"{error:.1f} degrees"

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """The angle, in units of 60 degrees."""
        return angles_deg(prediction, truth["normal"]) / _WORST_DEG, truth["valid"]

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
