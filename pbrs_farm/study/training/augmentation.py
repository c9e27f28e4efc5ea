"""Random changes to a batch that leave its labels true: mirror, enlarge, hue, light; torch, no effects."""

from __future__ import annotations

from math import pi, sqrt

import torch
from torch import Tensor
from torch.nn import functional

from pbrs_farm.study.tasks.study_task import Batch, Task
from pbrs_farm.study.training_plan import Plan


def augmented(batch: Batch, task: Task, plan: Plan, dice: torch.Generator) -> Batch:
    """The batch, colour (B, 3, H, W) float 0..1 in it, changed by what dice (on the CPU) draw."""
    n, device = len(batch["colour"]), batch["colour"].device

    def drawn(*shape: int) -> Tensor:
        return torch.rand((n, *shape), generator=dice).to(device)

    if plan.flip:
        flips = drawn() < 0.5
        batch = task.mirrored(batch, flips)
        colour = batch["colour"]
        batch["colour"] = torch.where(flips.view(-1, 1, 1, 1), colour.flip(3), colour)
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


def _relit(colour: Tensor, plan: Plan, drawn: object) -> Tensor:
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

    Colour is interpolated, labels are the nearest pixel's; directions stay, as if seen by a longer
    lens.
    """
    n, _, height, width = batch["colour"].shape
    theta = torch.zeros((n, 2, 3), device=shares.device)
    theta[:, 0, 0] = theta[:, 1, 1] = shares
    theta[:, :, 2] = shifts * (1 - shares)[:, None]
    grid = functional.affine_grid(theta, [n, 1, height, width], align_corners=False)
    colour = functional.grid_sample(
        batch["colour"], grid, mode="bilinear", padding_mode="border", align_corners=False
    )
    # Turn the grid into rows and columns of labels.
    columns = ((grid[..., 0] + 1) * width / 2 - 0.5).round().long().clamp(0, width - 1)
    rows = ((grid[..., 1] + 1) * height / 2 - 0.5).round().long().clamp(0, height - 1)
    views = torch.arange(n, device=shares.device).view(-1, 1, 1)
    labels = {name: x[views, rows, columns] for name, x in batch.items() if name != "colour"}
    return labels | {"colour": colour}
