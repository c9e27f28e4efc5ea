"""Surface normals: unit vectors in the camera's frame, scored by their angle to the truth."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import OPENCV_FROM_OPENGL, PUBLISHED_FROM_OPENGL
from pbrs_farm.study.metrics.angular import AngularErrors, angles_deg
from pbrs_farm.study.tasks.losses import normal_loss
from pbrs_farm.study.tasks.study_task import Arrays, Batch, StudyTask, TaskScorer, flipped
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

NORMAL_SCALE: Final = 32767  # int16 value of a component of 1
_WORST_DEG: Final = 60.0  # angle that an error map shows as 1
_OPENGL_FROM_OPENCV: Final = OPENCV_FROM_OPENGL[:3, :3]  # its own inverse
_PUBLISHED_FROM_OPENCV: Final = PUBLISHED_FROM_OPENGL @ _OPENGL_FROM_OPENCV


class NormalsTask(StudyTask):
    """Axes are OpenCV's: x right, y down, z forward."""

    name = "normals"
    layers = ("colour", "normal")
    targets_of_pixels = ("normal", "valid")
    figures = (
        "mean_deg",
        "median_deg",
        "below_11_25",
        "below_22_5",
        "below_30",
        "below_5",
        "below_7_5",
        "rms_deg",
    )
    error_name = "mean angle, degrees"
    error_scale = 1
    error_unit = " degrees"
    truth = "rendered: the surface's own normal, where a pixel sees a surface"

    def n_out(self, plan: TrainingPlan) -> int:
        return 3

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """normal (H, W, 3) int16, valid (H, W) bool and, if requested for scoring, depth (H, W) metres."""
        if sample.normal is None or sample.valid is None:
            raise BadInput(sample.id, "normal", "the view has no normals")
        depth = {} if sample.depth is None else {"depth": sample.depth}
        normal = np.rint(sample.normal * NORMAL_SCALE).astype(np.int16)
        return {"normal": normal, "valid": sample.valid, **depth}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        normal = batch["normal"].permute(0, 3, 1, 2).float() / NORMAL_SCALE
        return normal_loss(output, normal, batch["valid"], kind=plan.loss, over=plan.loss_over)

    def mirrored(self, batch: Batch, flips: Tensor) -> Batch:
        """The batch with some views mirrored; x changes its sign."""
        mirrored = super().mirrored(batch, flips)
        normal = mirrored["normal"]
        opposite = normal * normal.new_tensor([-1, 1, 1])
        return mirrored | {"normal": flipped(normal, opposite, flips)}

    def turned(self, batch: Batch, rotation: Tensor) -> Batch:
        normal = torch.einsum("bij,bhwj->bhwi", rotation, batch["normal"].float())
        return batch | {"normal": normal.round().to(batch["normal"].dtype)}

    def mirror_mean(self, output: Tensor, mirrored: Tensor) -> Tensor:
        """Sum of the unit vectors; x of the mirrored picture changes its sign."""
        plain, other = (functional.normalize(x, dim=1, eps=1e-6) for x in (output, mirrored))
        return plain + other * other.new_tensor([-1, 1, 1]).view(1, 3, 1, 1)

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W, 3) float32 unit vectors."""
        unit = functional.normalize(output.float(), dim=1, eps=1e-6)
        return np.asarray(unit.permute(0, 2, 3, 1).contiguous().numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The mean normal of each pixel: half of the error of a room needs no picture."""
        total = np.zeros(targets[0]["normal"].shape, np.float64)
        for target in targets:
            total += target["normal"] * target["valid"][..., None]
        # Pixels valid in no view get the mean over all pixels.
        empty = np.linalg.norm(total, axis=-1) == 0
        total[empty] = total.sum((0, 1))
        length = np.linalg.norm(total, axis=-1, keepdims=True)
        return "mean normal", np.asarray(total / np.maximum(length, 1e-9), np.float32)

    def scorer(self, plan: TrainingPlan) -> TaskScorer:
        errors = AngularErrors()
        return TaskScorer(
            lambda p, truth: errors.add(p, truth["normal"], truth["valid"]), errors.score
        )

    def error(self, figures: dict[str, float]) -> float:
        return figures["mean_deg"]

    def error_text(self, error: float) -> str:
        return f"{error:.1f} degrees"

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        return angles_deg(prediction, truth["normal"]) / _WORST_DEG, truth["valid"]

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """Red to the right, green up, blue towards the camera; black without a normal."""
        has_normal = np.linalg.norm(prediction, axis=-1, keepdims=True) > 0
        normal = prediction @ _OPENGL_FROM_OPENCV.astype(np.float32)
        return np.where(has_normal, np.rint((normal + 1) * 127.5), 0).astype(np.uint8)

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        return np.where(truth["valid"][..., None], truth["normal"] / np.float32(NORMAL_SCALE), 0)

    def file_kind(self, plan: TrainingPlan) -> str:
        return "normal"

    def stored(self, prediction: NDArray[Any]) -> NDArray[Any]:
        published = prediction.astype(np.float64) @ _PUBLISHED_FROM_OPENCV.T
        return np.rint((published + 1) * 65535 / 2).astype(np.uint16)

    def restored(self, stored: NDArray[Any]) -> NDArray[Any]:
        return np.asarray((stored.astype(np.float64) * 2 / 65535 - 1) @ _PUBLISHED_FROM_OPENCV)
