"""The training loop, resumable, as random numbers depend on seed and step; DDP under torchrun. Effects: files."""

from __future__ import annotations

import copy
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Final

import torch
from torch import Tensor, nn

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.study.pixel_rays import rays_of_cameras
from pbrs_farm.study.tasks.study_task import Batch, StudyTask
from pbrs_farm.study.training.augmentation import augment
from pbrs_farm.study.training.checkpoint import (
    Position,
    load_checkpoint,
    save_checkpoint,
    save_weights,
)
from pbrs_farm.study.training.optimisers import optimiser_of, running_mean, set_rate
from pbrs_farm.study.training.prediction import as_colour, device_of, move_to_device, network_output
from pbrs_farm.study.training.run_folder import RunFolder, plan_digest
from pbrs_farm.study.training.training_views import CAMERA, BatchRead, TrainingViews
from pbrs_farm.study.training_plan import TrainingPlan, rate_at

_TIMED_STEPS: Final = 2  # steps timed for each arithmetic; the first one warms up
Observer = Callable[[dict[str, float]], None]
Judge = Callable[[nn.Module], dict[str, float]]  # errors of the present network by name


class LossFailed(PbrsError):
    """The loss became infinite or NaN."""


@dataclass(frozen=True, slots=True)
class Share:
    """Number of this process, and of all processes."""

    rank: int = 0
    of: int = 1

    @property
    def is_first(self) -> bool:
        """True for the process that writes files."""
        return self.rank == 0


def share_of_process() -> Share:
    """Share from torchrun's environment; initialises the group of several processes."""
    share = Share(int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1")))
    if share.of > 1 and not torch.distributed.is_initialized():
        # NCCL for GPUs, Gloo otherwise.
        on_gpu = torch.cuda.is_available()
        if on_gpu:
            torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
        torch.distributed.init_process_group("nccl" if on_gpu else "gloo")
    return share


def train_network(
    network: nn.Module,
    views: TrainingViews,
    task: StudyTask,
    plan: TrainingPlan,
    *,
    seed: int,
    folder: RunFolder,
    observe: Observer,
    judge: Judge,
    share: Share,
    stop_on: str = "",
) -> nn.Module:
    """Train from the folder's checkpoint, or from the network's weights; writes the weights at the end.

    observe: called with each row of the metrics. judge: evaluated each plan.judge_every steps, a row
    of its errors. stop_on: name of one of these errors; the weights are then those of its minimum.
    With plan.average the running mean of the weights is evaluated, written and returned. Raises
    LossFailed, naming the view, if the loss is not finite; BadInput for a checkpoint of another
    training.
    """
    if plan.batch % share.of:
        raise BadInput("batch", str(plan.batch), f"cannot be shared by {share.of} processes")
    network = move_to_device(network, plan)
    optimiser = optimiser_of(network, plan)
    # A checkpoint must agree with this to resume.
    start = Position(0, task.name, plan_digest(plan), views.digest(), seed)
    average = running_mean(network, plan)
    first = _resumed(folder, network, optimiser, start, average)
    judged: nn.Module = network if average is None else average.module
    if share.is_first:
        # Drop rows after the checkpoint: their steps are repeated.
        folder.keep_metrics_until(first)
    model = nn.parallel.DistributedDataParallel(network) if share.of > 1 else network
    loop = _Loop(model, optimiser, task, plan, seed, share)

    started, loss_sum, n_summed = time.monotonic(), 0.0, 0
    # Each process takes its rows of the common batch.
    rows = slice(share.rank, None, share.of)
    steps = range(first, plan.steps)
    for step, read in zip(steps, views.batches(steps, plan, seed, rows), strict=True):
        loss_sum, n_summed = loss_sum + loop.step(step, read), n_summed + 1
        done = step + 1
        if average is not None and done % plan.accumulate == 0:
            average.update_parameters(network)
        if not share.is_first:
            continue
        if done % plan.log_every == 0 or done == plan.steps:
            row = _row_since(plan, step, loss_sum, n_summed, time.monotonic() - started)
            folder.add_metrics(row)
            observe(row)
            started, loss_sum, n_summed = time.monotonic(), 0.0, 0
        if _is_judged(plan, done, stop_on):
            judging = time.monotonic()
            errors, least = judge(judged), folder.least(stop_on)
            folder.add_metrics({"step": done} | errors)
            observe({"step": done} | errors)
            if stop_on and (errors[stop_on] < least or least == inf):
                save_weights(folder.best, judged, replace(start, step=done))
            started += time.monotonic() - judging
        # A checkpoint has no gradients, so wait until none are accumulated.
        if done % plan.checkpoint_every == 0 and done % plan.accumulate == 0 and done < plan.steps:
            save_checkpoint(
                folder.checkpoint, network, optimiser, replace(start, step=done), average
            )
    if share.is_first:
        best = load_checkpoint(folder.best, judged) if stop_on else replace(start, step=plan.steps)
        save_weights(folder.weights, judged, best)
    return judged


def _is_judged(plan: TrainingPlan, done: int, stop_on: str) -> bool:
    if not plan.judge_every:
        return False
    return done % plan.judge_every == 0 or bool(stop_on and done == plan.steps)


def seconds_a_step(
    network: nn.Module, views: TrainingViews, task: StudyTask, plan: TrainingPlan
) -> dict[str, float]:
    """Wall seconds of a training step of a copy of the network in each arithmetic."""
    read = next(iter(views.batches(range(1), plan, 0, slice(None))))
    seconds = {}
    for name, bf16 in (("float32", False), ("bfloat16", True)):
        model = move_to_device(copy.deepcopy(network), plan)
        timed_plan = replace(plan, bf16=bf16)
        optimiser = optimiser_of(model, timed_plan)
        loop = _Loop(model, optimiser, task, timed_plan, 0, Share())
        times = []
        for _ in range(_TIMED_STEPS):
            began = time.perf_counter()
            loop.step(0, read)
            times.append(time.perf_counter() - began)
        seconds[name] = round(min(times), 4)
    return seconds


def _row_since(
    plan: TrainingPlan, step: int, loss_sum: float, n_summed: int, seconds: float
) -> dict[str, float]:
    """A row of the metrics: mean loss and views per second since the last row."""
    return {
        "step": step + 1,
        "loss": loss_sum / n_summed,
        "rate": rate_at(plan, step),
        "views_s": round(n_summed * plan.batch / max(seconds, 1e-9), 2),
    }


def _resumed(
    folder: RunFolder,
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    start: Position,
    average: nn.Module | None,
) -> int:
    """Load the checkpoint, if any; the number of steps done."""
    if not folder.checkpoint.exists():
        return 0
    position = load_checkpoint(folder.checkpoint, network, optimiser, average)
    if replace(position, step=0) != start:
        raise BadInput(folder.checkpoint, "", "a checkpoint of another task, plan, seed or views")
    return position.step


@dataclass(slots=True)
class _Loop:
    model: nn.Module
    optimiser: torch.optim.Optimizer
    task: StudyTask
    plan: TrainingPlan
    seed: int
    share: Share

    def step(self, step: int, read: BatchRead) -> float:
        """Forward and backward pass of a batch; its loss."""
        plan = self.plan
        device = device_of(plan)
        random_seed = (self.seed * 1_000_003 + step) * 1024 + self.share.rank
        torch.manual_seed(random_seed)
        ids, arrays = read
        batch: Batch = {
            name: torch.from_numpy(array).to(device, non_blocking=True)
            for name, array in arrays.items()
        }
        batch["colour"] = as_colour(batch["colour"])
        if plan.rays:
            batch["rays"] = rays_of_cameras(batch.pop(CAMERA), *batch["colour"].shape[2:])
        batch = augment(batch, self.task, plan, torch.Generator().manual_seed(random_seed))

        with torch.autocast(device.type, torch.bfloat16, enabled=plan.bf16):
            output = network_output(self.model, batch["colour"], plan, batch.get("rays"))
        losses = self.task.loss(output, batch, plan)
        self._stop_at_nan(losses, ids, step)
        # The weights change after plan.accumulate batches.
        loss = losses.mean()
        (loss / plan.accumulate).backward()
        if (step + 1) % plan.accumulate == 0:
            self._move(step)
        return float(loss.detach())

    def _move(self, step: int) -> None:
        set_rate(self.optimiser, rate_at(self.plan, step))
        if self.plan.clip_norm > 0:
            nn.utils.clip_grad_norm_(self.model.parameters(), self.plan.clip_norm)
        self.optimiser.step()
        self.optimiser.zero_grad(set_to_none=True)

    def _stop_at_nan(self, losses: Tensor, ids: list[str], step: int) -> None:
        finite = torch.isfinite(losses.detach())
        if bool(finite.all()):
            return
        bad = [id for id, good in zip(ids, finite.tolist(), strict=True) if not good]
        raise LossFailed(
            f"the loss is not a finite number at step {step + 1}, at view {bad[0]}"
            f" ({len(bad)} of {len(ids)} views of the step)",
            hint="one view: look at its files; all views: --set rate=... lower",
        )
