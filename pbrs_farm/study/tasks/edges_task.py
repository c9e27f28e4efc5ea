"""Boundaries of instances, scored after thinning by matching pixels one to one."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.networks.edge_hed import edges_of_sides
from pbrs_farm.study.tasks.losses import edge_loss
from pbrs_farm.study.tasks.study_task import Arrays, Batch, StudyTask, TaskScorer, grey_picture
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

N_THRESHOLDS = 33  # of scoring; the benchmark has 99


class EdgesTask(StudyTask):
    """The truth is the lines where the instance changes (Gupta et al. 2013)."""

    name = "boundaries"
    layers = ("colour", "boundary")
    targets_of_pixels = ("edges",)
    figures = ("ods", "ois", "ap", "r50")
    error_name = "1 - ODS at 9 thresholds"
    truth = "rendered: lines where the instance changes; matched within 0.011 of the diagonal"

    def __init__(self, n_thresholds: int = N_THRESHOLDS) -> None:
        """n_thresholds: of scoring."""
        self.n_thresholds = n_thresholds

    def n_out(self, plan: TrainingPlan) -> int:
        """1; HED has six maps whatever this says."""
        return 1

    def targets(self, sample: Sample, plan: TrainingPlan) -> Arrays:
        """edges (H, W) bool."""
        if sample.boundary is None:
            raise BadInput(sample.id, "boundary", "the view has no boundaries")
        return {"edges": sample.boundary}

    def loss(self, output: Tensor, batch: Batch, plan: TrainingPlan) -> Tensor:
        return edge_loss(output, batch["edges"], as_sum=plan.edge_sum)

    def mirror_mean(self, output: Tensor, mirrored: Tensor) -> Tensor:
        """Score of the mean probability."""
        return torch.logit((output.sigmoid() + mirrored.sigmoid()) / 2, eps=1e-6)

    def predictions(self, output: Tensor) -> NDArray[Any]:
        """(B, H, W) float32 strengths 0..1."""
        output = output.float()
        # HED has six maps (five sides and their fusion), other networks one.
        edges = edges_of_sides(output) if output.shape[1] > 1 else torch.sigmoid(output[:, 0])
        return np.asarray(edges.numpy(force=True))

    def baseline(self, targets: list[Arrays], plan: TrainingPlan) -> tuple[str, F32]:
        """The frequency of edges at each pixel of the training views, scaled to a maximum of 1."""
        mean = np.mean([target["edges"] for target in targets], axis=0)
        return "mean edges", np.asarray(mean / max(float(mean.max()), 1e-6), np.float32)

    def scorer(self, plan: TrainingPlan) -> TaskScorer:
        # Imported here because training needs no scipy.
        from pbrs_farm.study.metrics.edge_scores import EdgeScores, edge_counts

        scores, n = EdgeScores(), self.n_thresholds
        return TaskScorer(lambda p, t: 1 - scores.add(edge_counts(p, t["edges"], n)), scores.score)

    def error(self, figures: dict[str, float]) -> float:
        return 1 - figures["ods"]

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        errors = np.abs(prediction - truth["edges"])
        return errors, np.ones(truth["edges"].shape, bool)

    def picture(self, prediction: NDArray[Any]) -> NDArray[np.uint8]:
        """Black edges on white."""
        return grey_picture(1 - np.asarray(prediction, np.float32))

    def prediction_of(self, truth: Arrays) -> NDArray[Any]:
        return truth["edges"].astype(np.float32)

    def file_kind(self, plan: TrainingPlan) -> str:
        return "edges"

    def stored(self, prediction: NDArray[Any]) -> NDArray[Any]:
        """255 times the strength."""
        return np.rint(255 * np.clip(np.asarray(prediction, np.float64), 0, 1)).astype(np.uint8)

    def restored(self, stored: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(stored / 255.0)
