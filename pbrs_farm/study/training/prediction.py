"""Predictions of a network and their figures, and its export to ONNX. Effects: write_onnx writes."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.installation import install_command
from pbrs_farm.study.networks.network_choice import encode_colour
from pbrs_farm.study.pixel_rays import focal_lengths, mirrored_rays, ray_channels, rays_of_cameras
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan

_BATCH = 16  # pictures per forward pass
_FOCAL_PX = 128.0  # focal length for which depth is predicted
_MIRROR_S = 1.0  # maximum wall seconds of a second pass by default


@dataclass(frozen=True, slots=True)
class Judged:
    """Figures over all views, and the error of each view in order (NaN without truth)."""

    figures: dict[str, float]
    errors: tuple[float, ...]


def device_of(plan: TrainingPlan) -> torch.device:
    """Device of the plan; MachineFailed if the plan needs a GPU and torch finds none."""
    has_gpu = torch.cuda.is_available()
    if plan.device == "cuda" and not has_gpu:
        text = f"plan {plan.name} asks for a GPU, and torch {torch.__version__} finds none"
        raise MachineFailed(text, hint="--set device=cpu, or --plan tiny")
    return torch.device("cuda" if has_gpu and plan.device != "cpu" else "cpu")


def move_to_device(network: nn.Module, plan: TrainingPlan) -> nn.Module:
    """Move the network itself to the plan's device and memory format; the network."""
    network = network.to(device_of(plan))
    return network.to(memory_format=torch.channels_last) if plan.channels_last else network


def predict(
    network: nn.Module,
    colour: NDArray[np.uint8],
    task: StudyTask,
    plan: TrainingPlan,
    sizes: Sequence[tuple[int, int]] = (),
    cameras: F32 | None = None,
    *,
    mirror: bool = False,
) -> Iterator[NDArray[Any]]:
    """Predictions of the pictures in colour (N, H, W, 3), in order. The network's mode is restored.

    sizes: (height, width) of each prediction, by default that of colour.
    cameras: (N, 4) fx, fy, cx, cy at colour's size, required by plans with `rays`.
    mirror: average with the prediction of the mirrored picture.
    """
    if plan.rays and cameras is None:
        text = "the network needs each pixel's ray, but these pictures have no camera"
        raise BadInput("predict", plan.task, text)
    was_training = network.training
    network.eval()
    device = next(network.parameters()).device
    try:
        for first in range(0, len(colour), _BATCH):
            batch = slice(first, first + _BATCH)
            pictures = torch.from_numpy(colour[batch]).to(device)
            rays = None
            if plan.rays and cameras is not None:
                batch_cameras = torch.from_numpy(cameras[batch]).to(device)
                rays = rays_of_cameras(batch_cameras, *colour.shape[1:3])
            with torch.no_grad(), torch.autocast(device.type, torch.bfloat16, enabled=plan.bf16):
                output = network_output(network, as_colour(pictures), plan, rays).float()
                if mirror:
                    all_flips = torch.ones(len(pictures), dtype=torch.bool, device=device)
                    flipped_rays = None if rays is None else mirrored_rays(rays, all_flips)
                    flipped = as_colour(pictures.flip(2))
                    second = network_output(network, flipped, plan, flipped_rays).float()
                    output = task.mirror_mean(output, second.flip(3))
            if all(size == tuple(output.shape[-2:]) for size in sizes[batch]):
                yield from task.predictions(output)
                continue
            # Photographs differ in size: enlarge each map alone.
            for single, size in zip(output, sizes[batch], strict=True):
                yield from task.predictions(_enlarged(single[None], size))
    finally:
        network.train(was_training)


def _enlarged(x: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    return functional.interpolate(x, size, mode="bilinear", align_corners=False)


def network_output(
    network: nn.Module, colour: torch.Tensor, plan: TrainingPlan, rays: torch.Tensor | None = None
) -> torch.Tensor:
    """Output for colour (B, 3, H, W) 0..1 and, in plans with `rays`, rays (B, H, W, 2); plan.enlarge applies.

    Depth with rays is predicted for a lens of _FOCAL_PX and scaled by the picture's own focal length,
    since an object of one size in the picture is farther away behind a longer lens (Yin et al. 2023).
    """
    height, width = colour.shape[-2:]
    colour = encode_colour(colour, plan.encoding)
    if rays is not None:
        colour = torch.cat([colour, ray_channels(rays)], 1)
    if plan.enlarge == 1:
        output = network(colour)
    else:
        large = _enlarged(colour, (plan.enlarge * height, plan.enlarge * width))
        output = functional.adaptive_avg_pool2d(network(large), (height, width))
    if plan.task == "depth" and rays is not None:
        output = output + torch.log(focal_lengths(rays) / _FOCAL_PX).view(-1, 1, 1, 1)
    return output


class _Whole(nn.Module):  # type: ignore[misc]
    """network_output as a module: colour (1, 3, H, W) 0..1, rays (1, H, W, 2) -> (1, C, H, W)."""

    def __init__(self, network: nn.Module, plan: TrainingPlan) -> None:
        super().__init__()
        self.network, self.plan = network, plan

    def forward(self, colour: torch.Tensor, rays: torch.Tensor | None = None) -> torch.Tensor:
        """Output at the size of the picture."""
        return network_output(self.network, colour, self.plan, rays)


def check_onnx(export: str | None = "onnx") -> None:
    """Raise MachineFailed for an export to ONNX without its packages."""
    missing = [name for name in ("onnx", "onnxscript") if find_spec(name) is None]
    if missing and export == "onnx":
        raise MachineFailed(f"ONNX needs {missing[0]}", hint=install_command("study"))


def write_onnx(network: nn.Module, plan: TrainingPlan, path: Path) -> None:
    """Write the network as ONNX: input colour (1, 3, H, W) float 0..1 at the plan's size, output map.

    The encoding of colour is included. The map is (1, C, H, W): a normal (x right, y down, z forward,
    of any length), a score per class (channel 0 is class 1), edges, or the logarithm of metres. Plans
    with `rays` have a second input of that name, (1, H, W, 2): x and y of each pixel's direction
    (x, y, 1), x right, y down. Raises MachineFailed without onnx and onnxscript.
    """
    check_onnx()
    whole = _Whole(network, plan).cpu().float().eval()
    inputs = [torch.zeros(1, 3, plan.height_px, plan.width_px)]
    inputs += [torch.zeros(1, plan.height_px, plan.width_px, 2)] if plan.rays else []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # deprecations within the exporter
        program = torch.onnx.export(
            whole,
            tuple(inputs),
            dynamo=True,
            input_names=["colour", "rays"][: len(inputs)],
            output_names=["map"],
            verbose=False,
        )
    program.save(path, external_data=False)


def is_mirror_cheap(network: nn.Module, task: StudyTask, plan: TrainingPlan) -> bool:
    """True if a second pass costs less than a second for a picture of the plan's size on this device."""
    picture = np.zeros((1, plan.height_px, plan.width_px, 3), np.uint8)
    camera = np.full((1, 4), plan.width_px, np.float32)
    seconds = []
    for _ in range(2):  # the first pass loads kernels
        began = time.perf_counter()
        list(predict(network, picture, task, plan, cameras=camera))
        seconds.append(time.perf_counter() - began)
    return min(seconds) < _MIRROR_S


def as_colour(pictures: torch.Tensor) -> torch.Tensor:
    """(B, 3, H, W) float 0..1, channels last in memory, of (B, H, W, 3) bytes."""
    return pictures.permute(0, 3, 1, 2).float() / 255


def judge_views(
    network: nn.Module, views: ViewArrays, task: StudyTask, plan: TrainingPlan
) -> Judged:
    """Figures of the network on views."""
    predictions = predict(network, views.colour, task, plan, cameras=views.cameras)
    return score_predictions(predictions, views.all_targets(), task, plan)


def score_predictions(
    predictions: Iterable[NDArray[Any]],
    truths: Iterable[Arrays],
    task: StudyTask,
    plan: TrainingPlan,
) -> Judged:
    """Figures of predictions, each at the size of its truth."""
    scorer = task.scorer(plan)
    errors = tuple(scorer.add(p, truth) for p, truth in zip(predictions, truths, strict=True))
    return Judged(scorer.figures(), errors)
