"""Boundaries of instances: HED's sides, judged after thinning by matching pixels one to one; no effects."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pbrs_farm.core.arrays import F32, F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.networks.edge_hed import edges_of_sides
from pbrs_farm.study.tasks.losses import edge_loss
from pbrs_farm.study.tasks.study_task import Arrays, Batch
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

N_THRESHOLDS = 33  # of judging; the benchmark's own number is 99


class EdgesTask:
    """The truth are lines where the instance changes (Gupta et al. 2013)."""

    name: str = "boundaries"
    layers: tuple[str, ...] = ("colour", "boundary")
    figures: tuple[str, ...] = ("ods", "ois", "ap", "r50")
    error_name: str = "1 - ODS at 9 thresholds"
    error_scale: float = 100
    error_unit: str = " %"
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

    def error_text(self, error: float) -> str:
        """What the view's best F lacks to 1."""
        return f"{100 * error:.0f} % wrong"

    def error_map(self, prediction: NDArray[Any], truth: Arrays) -> tuple[F64, Mask]:
        """Missed edges and invented ones alike."""
        errors = np.abs(prediction - truth["edges"])
        return errors, np.ones(truth["edges"].shape, bool)

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
