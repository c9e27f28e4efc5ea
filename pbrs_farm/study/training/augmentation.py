"""Augmentation of a batch with its labels: mirror, rotate, zoom, hue, light, noise."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sqrt, tan

import torch
from torch import Tensor
from torch.nn import functional

from pbrs_farm.study.pixel_rays import mirrored_rays, places_of_rays, rays_at, rays_of_cameras
from pbrs_farm.study.tasks.study_task import Batch, StudyTask
from pbrs_farm.study.training_plan import TrainingPlan


def augment(batch: Batch, task: StudyTask, plan: TrainingPlan, dice: torch.Generator) -> Batch:
    """Augment a batch, colour (B, 3, H, W) 0..1 and rays (B, H, W, 2) if any, by random numbers of dice."""
    n, device = len(batch["colour"]), batch["colour"].device

    def drawn(*shape: int) -> Tensor:
        return torch.rand((n, *shape), generator=dice).to(device)

    if plan.flip:
        flips = drawn() < 0.5
        batch = task.mirrored(batch, flips)
        colour = batch["colour"]
        batch["colour"] = torch.where(flips.view(-1, 1, 1, 1), colour.flip(3), colour)
        if "rays" in batch:
            batch["rays"] = mirrored_rays(batch["rays"], flips)
    if plan.turn_deg > 0:
        angles = torch.randn((n, 2), generator=dice).to(device).clamp(-2, 2)
        batch = rotate_cameras(batch, task, angles * (plan.turn_deg * pi / 180), plan.hfov_deg)
    if plan.zoom > 1:
        batch = _enlarge(batch, 1 / (1 + drawn() * (plan.zoom - 1)), 2 * drawn(2) - 1)
    if plan.hue > 0:
        batch["colour"] = rotate_hue(batch["colour"], plan.hue * pi * (2 * drawn() - 1))
    batch["colour"] = _relit(batch["colour"], plan, drawn)
    if plan.noise > 0:
        noise = torch.randn(batch["colour"].shape, generator=dice).to(device)
        # Of varying strength: at a fixed one, pictures without noise become foreign to the network.
        batch["colour"] = batch["colour"] + plan.noise * drawn(1, 1, 1) * noise
    return batch


def rotate_hue(colour: Tensor, angles: Tensor) -> Tensor:
    """Colours (B, 3, H, W) rotated about the grey axis by angles (B,), radians."""
    cos, sin = torch.cos(angles), torch.sin(angles)
    # Rodrigues' formula about (1, 1, 1) / sqrt(3): a circulant matrix of three numbers.
    same = cos + (1 - cos) / 3
    next_, last = (1 - cos) / 3 - sin / sqrt(3), (1 - cos) / 3 + sin / sqrt(3)
    rows = torch.stack([same, next_, last], 1)
    turn = torch.stack([rows, rows.roll(1, 1), rows.roll(2, 1)], 1)
    return torch.einsum("bij,bjhw->bihw", turn, colour).clamp(0, 1)


def _relit(colour: Tensor, plan: TrainingPlan, drawn: Callable[..., Tensor]) -> Tensor:
    """Colours with another exposure, tone and white balance."""
    if plan.gain == plan.gamma == plan.tint == 0:
        return colour
    gain = 1 + plan.gain * (2 * drawn(1, 1, 1) - 1)
    tint = 1 + plan.tint * (2 * drawn(3, 1, 1) - 1)
    gamma = 1 + plan.gamma * (2 * drawn(1, 1, 1) - 1)
    return (colour.clamp(min=1e-4) ** gamma * gain * tint).clamp(0, 1)


def _enlarge(batch: Batch, shares: Tensor, shifts: Tensor) -> Batch:
    """A crop of each view at full size, as by a longer lens: shares (B,) of its width, shifts (B, 2) -1..1."""
    n, _, height, width = batch["colour"].shape
    theta = torch.zeros((n, 2, 3), device=shares.device)
    theta[:, 0, 0] = theta[:, 1, 1] = shares
    theta[:, :, 2] = shifts * (1 - shares)[:, None]
    return _sample_at(
        batch, functional.affine_grid(theta, [n, 1, height, width], align_corners=False)
    )


def rotate_cameras(batch: Batch, task: StudyTask, angles: Tensor, hfov_deg: float) -> Batch:
    """The views of cameras pitched up and rolled clockwise by angles (B, 2), radians.

    The picture of a rotated camera is a homography of the old one for any depth; normals rotate with
    the camera. hfov_deg: field of view of views without rays. Pixels outside the old picture have the
    colour of its border and no label.
    """
    n, _, height, width = batch["colour"].shape
    rotation = _rotations(angles)
    if "rays" in batch:
        rays = batch["rays"]
    else:
        f = width / 2 / tan(hfov_deg * pi / 360)
        camera = angles.new_tensor([f, f, width / 2, height / 2])
        rays = rays_of_cameras(camera.expand(n, 4), height, width)
    directions = torch.cat([rays, torch.ones_like(rays[..., :1])], -1)
    old = torch.einsum("bji,bhwj->bhwi", rotation, directions)  # by the inverse rotation
    grid = places_of_rays(rays, old[..., :2] / old[..., 2:].clamp(min=1e-3))
    turned = task.turned(_sample_at(batch, grid), rotation)
    return turned | ({"rays": rays} if "rays" in batch else {})


def _rotations(angles: Tensor) -> Tensor:
    """(B, 3, 3) from the axes of the old camera (x right, y down) to those of the rotated one."""
    cos, sin = torch.cos(angles), torch.sin(angles)
    ones, zero = torch.ones_like(cos[:, 0]), torch.zeros_like(cos[:, 0])
    # Pitch up moves z to y.
    pitch = [ones, zero, zero, zero, cos[:, 0], sin[:, 0], zero, -sin[:, 0], cos[:, 0]]
    # A clockwise roll rotates the picture anticlockwise.
    roll = [cos[:, 1], sin[:, 1], zero, -sin[:, 1], cos[:, 1], zero, zero, zero, ones]
    pitched, rolled = (torch.stack(rows, 1).view(-1, 3, 3) for rows in (pitch, roll))
    return rolled @ pitched


def _sample_at(batch: Batch, grid: Tensor) -> Batch:
    """Resample at grid (B, H, W, 2), -1..1 between edges: colour interpolated, labels nearest, or 0 outside."""
    n, _, height, width = batch["colour"].shape
    colour = functional.grid_sample(
        batch["colour"], grid, mode="bilinear", padding_mode="border", align_corners=False
    )
    columns = ((grid[..., 0] + 1) * width / 2 - 0.5).round().long().clamp(0, width - 1)
    rows = ((grid[..., 1] + 1) * height / 2 - 0.5).round().long().clamp(0, height - 1)
    views = torch.arange(n, device=grid.device).view(-1, 1, 1)
    rays = {"rays": rays_at(batch["rays"], grid)} if "rays" in batch else {}
    pictures = {"colour": colour, **rays}
    labels = {name: x[views, rows, columns] for name, x in batch.items() if name not in pictures}
    outside = (grid.abs() > 1).any(-1)
    if outside.any():
        for label in labels.values():
            label[outside] = 0
    return labels | pictures
