"""The training loop: batches, loss, optimiser, checkpoints. Effects: the run's folder.

Everything random is drawn from the seed and the step, so that a run which was killed goes on to the
same weights. Under torchrun each process takes its share of every batch (DDP).
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.study.tasks.study_task import Batch, Task
from pbrs_farm.study.training.augmentation import augmented
from pbrs_farm.study.training.checkpoint import (
    Position,
    load_checkpoint,
    save_checkpoint,
    save_weights,
)
from pbrs_farm.study.training.optimisers import optimiser_of, set_rate
from pbrs_farm.study.training.prediction import as_colour, device_of, network_output, placed
from pbrs_farm.study.training.run_folder import RunFolder, plan_digest
from pbrs_farm.study.training.training_views import BatchRead, TrainingViews
from pbrs_farm.study.training_plan import Plan, rate_at

Observer = Callable[[dict[str, float]], None]
Judge = Callable[[nn.Module], dict[str, float]]  # errors of the network as it is, by name


class LossFailed(PbrsError):
    """The loss is no finite number any more."""


@dataclass(frozen=True, slots=True)
class Share:
    """Which process of how many this one is."""

    rank: int = 0
    of: int = 1

    @property
    def is_first(self) -> bool:
        """The one that writes files."""
        return self.rank == 0


def share_of_process() -> Share:
    """As torchrun's environment says; begins the process group where there are several."""
    share = Share(int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1")))
    if share.of > 1 and not torch.distributed.is_initialized():
        # NCCL joins GPUs, Gloo processes without one.
        on_gpu = torch.cuda.is_available()
        if on_gpu:
            torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
        torch.distributed.init_process_group("nccl" if on_gpu else "gloo")
    return share


def train_network(
    network: nn.Module, views: TrainingViews, task: Task, plan: Plan, *, seed: int,
    folder: RunFolder, observe: Observer, judge: Judge, share: Share,
) -> nn.Module:  # fmt: skip
    """Train from the folder's checkpoint, or from the network's own weights; writes weights last.

    judge: asked each plan.judge_every steps; what it says becomes a row of the metrics. Raises
    LossFailed, naming the view, when the loss is no number; BadInput when the checkpoint is of
    something else.
    """
    if plan.batch % share.of:
        raise BadInput("batch", str(plan.batch), f"cannot be shared by {share.of} processes")
    network = placed(network, plan)
    optimiser = optimiser_of(network, plan)
    # What a checkpoint must agree with to be gone on from.
    where = Position(0, task.name, plan_digest(plan), views.digest(), seed)
    first = _resumed(folder, network, optimiser, where)
    if share.is_first:
        # Rows of steps after the checkpoint go: these steps are run again.
        folder.keep_metrics_until(first)
    model = nn.parallel.DistributedDataParallel(network) if share.of > 1 else network
    loop = _Loop(model, optimiser, task, plan, seed, share)

    started, loss_sum, n_summed = time.monotonic(), 0.0, 0
    # Each process takes its own rows of the one batch.
    own = slice(share.rank, None, share.of)
    steps = range(first, plan.steps)
    for step, read in zip(steps, views.batches(steps, plan, seed, own), strict=True):
        loss_sum, n_summed = loss_sum + loop.step(step, read), n_summed + 1
        done = step + 1
        if not share.is_first:
            continue
        if done % plan.log_every == 0 or done == plan.steps:
            row = _row_since(plan, step, loss_sum, n_summed, time.monotonic() - started)
            folder.add_metrics(row)
            observe(row)
            started, loss_sum, n_summed = time.monotonic(), 0.0, 0
        if plan.judge_every and done % plan.judge_every == 0:
            judging = time.monotonic()
            folder.add_metrics({"step": done} | judge(network))
            started += time.monotonic() - judging
        # A checkpoint holds no gradients, so it waits until none are accumulated.
        if done % plan.checkpoint_every == 0 and done % plan.accumulate == 0 and done < plan.steps:
            save_checkpoint(folder.checkpoint, network, optimiser, _at(where, done))
    if share.is_first:
        save_weights(folder.weights, network, _at(where, plan.steps))
    return network


def _row_since(
    plan: Plan, step: int, loss_sum: float, n_summed: int, seconds: float
) -> dict[str, float]:
    """A row of the metrics: means since the last one of the loss, and views a second."""
    return {
        "step": step + 1,
        "loss": loss_sum / n_summed,
        "rate": rate_at(plan, step),
        "views_s": round(n_summed * plan.batch / max(seconds, 1e-9), 2),
    }


def _at(position: Position, step: int) -> Position:
    return Position(step, position.task, position.plan_digest, position.views_digest, position.seed)


def _resumed(
    folder: RunFolder, network: nn.Module, optimiser: torch.optim.Optimizer, where: Position
) -> int:
    """Take up the checkpoint, if there is one; the number of steps that are done. Writes nothing."""
    if not folder.checkpoint.exists():
        return 0
    position = load_checkpoint(folder.checkpoint, network, optimiser)
    if _at(position, 0) != where:
        raise BadInput(folder.checkpoint, "", "a checkpoint of another task, plan, seed or views")
    return position.step


@dataclass(slots=True)
class _Loop:
    model: nn.Module
    optimiser: torch.optim.Optimizer
    task: Task
    plan: Plan
    seed: int
    share: Share

    def step(self, step: int, read: BatchRead) -> float:
        """One batch forth and back; its loss."""
        plan = self.plan
        device = device_of(plan)
        # Draw what is random from the seed and the step alone.
        chance = (self.seed * 1_000_003 + step) * 1024 + self.share.rank
        torch.manual_seed(chance)
        ids, arrays = read
        batch: Batch = {
            name: torch.from_numpy(array).to(device, non_blocking=True)
            for name, array in arrays.items()
        }
        batch["colour"] = as_colour(batch["colour"])
        batch = augmented(batch, self.task, plan, torch.Generator().manual_seed(chance))

        with torch.autocast(device.type, torch.bfloat16, enabled=plan.bf16):
            output = network_output(self.model, batch["colour"], plan)
        losses = self.task.loss(output, batch, plan)
        self._stop_at_nan(losses, ids, step)
        # Gradients add up over plan.accumulate batches before the weights move.
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
        bad = [at for at, good in zip(ids, finite.tolist(), strict=True) if not good]
        raise LossFailed(
            f"the loss is not a finite number at step {step + 1}, at view {bad[0]}"
            f" ({len(bad)} of {len(ids)} views of the step)",
            hint="one view: look at its files; all views: --set rate=... lower",
        )
