"""The training loop: batches, loss, optimiser, checkpoints. Effects: the run's folder.

Everything random is drawn from the seed and the step, so that a run which was killed goes on to the
same weights. Under torchrun each process takes its share of every batch (DDP).
"""

from __future__ import annotations

import copy
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, pi, sqrt, tan
from typing import Any, Final

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.study.networks.vgg import RATE_OF_FUSE, RATE_OF_SIDES, RATE_OF_STAGE_5, EdgeHed
from pbrs_farm.study.tasks.study_task import Batch, StudyTask
from pbrs_farm.study.training.checkpoint import (
    Position,
    load_checkpoint,
    save_checkpoint,
    save_weights,
)
from pbrs_farm.study.training.prediction import as_colour, device_of, network_output, placed
from pbrs_farm.study.training.run_folder import RunFolder, plan_digest
from pbrs_farm.study.training.training_views import BatchRead, TrainingViews
from pbrs_farm.study.training_plan import TrainingPlan, rate_at

# Random changes to a batch that leave its labels true: mirror, enlarge, hue, light; torch.


def augmented(batch: Batch, task: StudyTask, plan: TrainingPlan, dice: torch.Generator) -> Batch:
    """The batch, colour (B, 3, H, W) float 0..1 in it, changed by what dice (on the CPU) draw."""
    n, device = len(batch["colour"]), batch["colour"].device

    def drawn(*shape: int) -> Tensor:
        return torch.rand((n, *shape), generator=dice).to(device)

    if plan.flip:
        flips = drawn() < 0.5
        batch = task.mirrored(batch, flips)
        colour = batch["colour"]
        batch["colour"] = torch.where(flips.view(-1, 1, 1, 1), colour.flip(3), colour)
    if plan.turn_deg > 0:
        angles = torch.randn((n, 2), generator=dice).to(device).clamp(-2, 2)
        batch = turned(batch, task, angles * (plan.turn_deg * pi / 180), plan.hfov_deg)
    if plan.zoom > 1:
        batch = _enlarged(batch, 1 / (1 + drawn() * (plan.zoom - 1)), 2 * drawn(2) - 1)
    if plan.hue > 0:
        batch["colour"] = turned_hue(batch["colour"], plan.hue * pi * (2 * drawn() - 1))
    batch["colour"] = _relit(batch["colour"], plan, drawn)
    if plan.noise > 0:
        noise = torch.randn(batch["colour"].shape, generator=dice).to(device)
        batch["colour"] = batch["colour"] + plan.noise * noise
    return batch


def turned_hue(colour: Tensor, angles: Tensor) -> Tensor:
    """Colours (B, 3, H, W) turned about the grey axis by angles (B,), radians: other paint, same light."""
    cos, sin = torch.cos(angles), torch.sin(angles)
    # Rodrigues' formula about (1, 1, 1) / sqrt(3): three numbers that go round.
    same = cos + (1 - cos) / 3
    next_, last = (1 - cos) / 3 - sin / sqrt(3), (1 - cos) / 3 + sin / sqrt(3)
    rows = torch.stack([same, next_, last], 1)
    turn = torch.stack([rows, rows.roll(1, 1), rows.roll(2, 1)], 1)
    return torch.einsum("bij,bjhw->bihw", turn, colour).clamp(0, 1)


def _relit(colour: Tensor, plan: TrainingPlan, drawn: object) -> Tensor:
    """Another exposure, tone and white balance."""
    assert callable(drawn)
    if plan.gain == plan.gamma == plan.tint == 0:
        return colour
    gain = 1 + plan.gain * (2 * drawn(1, 1, 1) - 1)
    tint = 1 + plan.tint * (2 * drawn(3, 1, 1) - 1)
    gamma = 1 + plan.gamma * (2 * drawn(1, 1, 1) - 1)
    return (colour.clamp(min=1e-4) ** gamma * gain * tint).clamp(0, 1)


def _enlarged(batch: Batch, shares: Tensor, shifts: Tensor) -> Batch:
    """A part of each view at full size: shares (B,) of its width, shifts (B, 2) -1..1 within it.

    Directions stay, as if seen by a longer lens.
    """
    n, _, height, width = batch["colour"].shape
    theta = torch.zeros((n, 2, 3), device=shares.device)
    theta[:, 0, 0] = theta[:, 1, 1] = shares
    theta[:, :, 2] = shifts * (1 - shares)[:, None]
    return _sampled(
        batch, functional.affine_grid(theta, [n, 1, height, width], align_corners=False)
    )


def turned(batch: Batch, task: StudyTask, angles: Tensor, hfov_deg: float) -> Batch:
    """The views as cameras would see them that are pitched up and rolled clockwise by angles (B, 2).

    A turned camera's picture is a homography of the old one, whatever the depth; normals turn with
    the camera. angles: radians. hfov_deg: of the views. What the old picture does not show has the
    border's colour and no label.
    """
    height, width = batch["colour"].shape[2:]
    rotation = _rotations(angles)
    # Rays through the new pixels, in units of the old picture's half width.
    half = tan(hfov_deg * pi / 360)
    x = ((torch.arange(width, device=angles.device) + 0.5) * 2 / width - 1) * half
    y = (
        ((torch.arange(height, device=angles.device) + 0.5) * 2 / height - 1)
        * half
        * height
        / width
    )
    rays = torch.stack(
        [x.expand(height, -1), y[:, None].expand(-1, width), x.new_ones(height, width)], -1
    )
    old = torch.einsum("bji,hwj->bhwi", rotation, rays)  # by the inverse of what turns directions
    plane = old[..., :2] / old[..., 2:].clamp(min=1e-3) / half
    grid = plane * plane.new_tensor([1.0, width / height])
    return task.turned(_sampled(batch, grid), rotation)


def _rotations(angles: Tensor) -> Tensor:
    """(B, 3, 3) that take directions of the old camera's axes (x right, y down) to the turned one's."""
    cos, sin = torch.cos(angles), torch.sin(angles)
    one, zero = torch.ones_like(cos[:, 0]), torch.zeros_like(cos[:, 0])
    # A camera that looks up sees what was ahead lower: z goes to y.
    pitch = [one, zero, zero, zero, cos[:, 0], sin[:, 0], zero, -sin[:, 0], cos[:, 0]]
    # One that rolls clockwise sees the world turn the other way.
    roll = [cos[:, 1], sin[:, 1], zero, -sin[:, 1], cos[:, 1], zero, zero, zero, one]
    pitched, rolled = (torch.stack(rows, 1).view(-1, 3, 3) for rows in (pitch, roll))
    return rolled @ pitched


def _sampled(batch: Batch, grid: Tensor) -> Batch:
    """The batch at places of its pictures: grid (B, H, W, 2), -1..1 from edge to edge.

    Colour is interpolated, labels are the nearest pixel's, 0 outside.
    """
    n, _, height, width = batch["colour"].shape
    colour = functional.grid_sample(
        batch["colour"], grid, mode="bilinear", padding_mode="border", align_corners=False
    )
    # Turn the grid into rows and columns of labels.
    columns = ((grid[..., 0] + 1) * width / 2 - 0.5).round().long().clamp(0, width - 1)
    rows = ((grid[..., 1] + 1) * height / 2 - 0.5).round().long().clamp(0, height - 1)
    views = torch.arange(n, device=grid.device).view(-1, 1, 1)
    labels = {name: x[views, rows, columns] for name, x in batch.items() if name != "colour"}
    # Beyond the picture nothing is known.
    outside = (grid.abs() > 1).any(-1)
    if outside.any():
        for label in labels.values():
            label[outside] = 0
    return labels | {"colour": colour}


# Optimisers as a plan names them, with the rates of layers apart; torch.


def optimiser_of(network: nn.Module, plan: TrainingPlan) -> torch.optim.Optimizer:
    """The optimiser; groups carry "scale", what their rate is of the plan's."""
    groups = _released_groups(network, plan) if plan.released_rates else _groups(network, plan)
    if plan.optimiser == "rmsprop":
        return torch.optim.RMSprop(groups, lr=plan.rate, alpha=plan.alpha, eps=plan.epsilon)
    if plan.optimiser == "sgd":
        return torch.optim.SGD(groups, lr=plan.rate, momentum=plan.momentum)
    return torch.optim.AdamW(groups, lr=plan.rate, eps=plan.epsilon)


def set_rate(optimiser: torch.optim.Optimizer, rate: float) -> None:
    """Give every group its share of the rate."""
    for group in optimiser.param_groups:
        group["lr"] = rate * group["scale"]


def _groups(network: nn.Module, plan: TrainingPlan) -> list[dict[str, Any]]:
    """Weights decay; biases and the two numbers of each normalisation do not."""
    named = [p for p in network.parameters() if p.requires_grad]
    return [
        {"params": [p for p in named if p.ndim > 1], "weight_decay": plan.weight_decay, "scale": 1},
        {"params": [p for p in named if p.ndim <= 1], "weight_decay": 0.0, "scale": 1},
    ]


def _released_groups(network: nn.Module, plan: TrainingPlan) -> list[dict[str, Any]]:
    """HED's released rates: biases twice their weights', without decay."""
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
    """The exponential mean over steps of weights and of what normalisation knows; None without one.

    A step keeps plan.average of it, and less in the first steps ((1 + n) / (10 + n) after n of them),
    so that random first weights are soon forgotten.
    """
    if not plan.average:
        return None

    def mean(older: Tensor, newer: Tensor, n_averaged: Tensor | int) -> Tensor:
        n = int(n_averaged)
        kept = min(plan.average, (1 + n) / (10 + n))
        return kept * older + (1 - kept) * newer

    return AveragedModel(network, avg_fn=mean, use_buffers=True)


# The training loop.


_TIMED_STEPS: Final = 2  # of each arithmetic; the first makes what others find made

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
    network: nn.Module, views: TrainingViews, task: StudyTask, plan: TrainingPlan, *, seed: int,
    folder: RunFolder, observe: Observer, judge: Judge, share: Share, stop_on: str = "",
) -> nn.Module:  # fmt: skip
    """Train from the folder's checkpoint, or from the network's own weights; writes weights last.

    observe: hears each row of the metrics. judge: asked each plan.judge_every steps; what it says
    becomes such a row. stop_on: the
    name of one of its errors; the weights are then those of the step where it was least. With
    plan.average the running mean of the weights is judged, written and given back. Raises
    LossFailed, naming the view, when the loss is no number; BadInput when the checkpoint is of
    something else.
    """
    if plan.batch % share.of:
        raise BadInput("batch", str(plan.batch), f"cannot be shared by {share.of} processes")
    network = placed(network, plan)
    optimiser = optimiser_of(network, plan)
    # What a checkpoint must agree with to be gone on from.
    where = Position(0, task.name, plan_digest(plan), views.digest(), seed)
    average = running_mean(network, plan)
    first = _resumed(folder, network, optimiser, where, average)
    told: nn.Module = network if average is None else average.module
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
            errors, least = judge(told), folder.least(stop_on)
            folder.add_metrics({"step": done} | errors)
            observe({"step": done} | errors)
            if stop_on and (errors[stop_on] < least or least == inf):
                save_weights(folder.best, told, _at(where, done))
            started += time.monotonic() - judging
        # A checkpoint holds no gradients, so it waits until none are accumulated.
        if done % plan.checkpoint_every == 0 and done % plan.accumulate == 0 and done < plan.steps:
            save_checkpoint(folder.checkpoint, network, optimiser, _at(where, done), average)
    if share.is_first:
        best = load_checkpoint(folder.best, told) if stop_on else _at(where, plan.steps)
        save_weights(folder.weights, told, best)
    return told


def _is_judged(plan: TrainingPlan, done: int, stop_on: str) -> bool:
    if not plan.judge_every:
        return False
    return done % plan.judge_every == 0 or bool(stop_on and done == plan.steps)


def seconds_a_step(
    network: nn.Module, views: TrainingViews, task: StudyTask, plan: TrainingPlan
) -> dict[str, float]:
    """Wall seconds of a step forth and back in each arithmetic, the network itself left as it is."""
    read = next(iter(views.batches(range(1), plan, 0, slice(None))))
    seconds = {}
    for name, bf16 in (("float32", False), ("bfloat16", True)):
        model = placed(copy.deepcopy(network), plan)
        each = replace(plan, bf16=bf16)
        loop = _Loop(model, optimiser_of(model, each), task, each, 0, Share())
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
    folder: RunFolder, network: nn.Module, optimiser: torch.optim.Optimizer, where: Position,
    average: nn.Module | None,
) -> int:  # fmt: skip
    """Take up the checkpoint, if there is one; the number of steps that are done. Writes nothing."""
    if not folder.checkpoint.exists():
        return 0
    position = load_checkpoint(folder.checkpoint, network, optimiser, average)
    if _at(position, 0) != where:
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
