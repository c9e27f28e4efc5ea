"""Optimisers of a plan, with separate rates for some layers."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from pbrs_farm.study.networks.edge_hed import RATE_OF_FUSE, RATE_OF_SIDES, RATE_OF_STAGE_5, EdgeHed
from pbrs_farm.study.training_plan import TrainingPlan


def optimiser_of(network: nn.Module, plan: TrainingPlan) -> torch.optim.Optimizer:
    """The optimiser; "scale" of a group is its rate as a multiple of the plan's."""
    groups = _released_groups(network, plan) if plan.released_rates else _groups(network, plan)
    if plan.optimiser == "rmsprop":
        return torch.optim.RMSprop(groups, lr=plan.rate, alpha=plan.alpha, eps=plan.epsilon)
    if plan.optimiser == "sgd":
        return torch.optim.SGD(groups, lr=plan.rate, momentum=plan.momentum)
    return torch.optim.AdamW(groups, lr=plan.rate, eps=plan.epsilon)


def set_rate(optimiser: torch.optim.Optimizer, rate: float) -> None:
    """Set the rate of every group."""
    for group in optimiser.param_groups:
        group["lr"] = rate * group["scale"]


def _groups(network: nn.Module, plan: TrainingPlan) -> list[dict[str, Any]]:
    """Two groups: weights with decay; biases and normalisation without."""
    named = [p for p in network.parameters() if p.requires_grad]
    return [
        {"params": [p for p in named if p.ndim > 1], "weight_decay": plan.weight_decay, "scale": 1},
        {"params": [p for p in named if p.ndim <= 1], "weight_decay": 0.0, "scale": 1},
    ]


def _released_groups(network: nn.Module, plan: TrainingPlan) -> list[dict[str, Any]]:
    """HED's released rates; biases have twice the rate of their weights and no decay."""
    if not isinstance(network, EdgeHed):
        return _groups(network, plan)
    *early, last = network.stages
    scaled = [(module, 1.0) for module in early]
    scaled += [
        (last, RATE_OF_STAGE_5),
        (network.sides, RATE_OF_SIDES),
        (network.fuse, RATE_OF_FUSE),
    ]
    groups = []
    for module, scale in scaled:
        for is_bias in (False, True):
            chosen = [p for p in module.parameters() if (p.ndim <= 1) == is_bias]
            decay = 0.0 if is_bias else plan.weight_decay
            factor = scale * (2 if is_bias else 1)
            groups.append({"params": chosen, "weight_decay": decay, "scale": factor})
    return groups


def running_mean(network: nn.Module, plan: TrainingPlan) -> AveragedModel | None:
    """Exponential mean over steps of weights and normalisation statistics; None without plan.average.

    The decay is plan.average, but (1 + n) / (10 + n) in the first steps, after n of them, so that
    random first weights fade quickly.
    """
    if not plan.average:
        return None

    def mean(older: Tensor, newer: Tensor, n_averaged: Tensor | int) -> Tensor:
        n = int(n_averaged)
        decay = min(plan.average, (1 + n) / (10 + n))
        return decay * older + (1 - decay) * newer

    return AveragedModel(network, avg_fn=mean, use_buffers=True)
