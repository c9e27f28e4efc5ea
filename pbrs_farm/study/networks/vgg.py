"""The 13 convolutions of VGG-16 (Simonyan and Zisserman 2015), the encoder of three networks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final

from torch import nn

# Width and number of the convolutions of each stage; a pooling by 2 separates stages.
STAGES: Final = ((64, 2), (128, 2), (256, 3), (512, 3), (512, 3))

# About an eighth of the width, and fewer convolutions: trains in minutes on two cores.
TINY_STAGES: Final = ((16, 1), (32, 2), (64, 2), (96, 2), (96, 2))


def unit(n_in: int, n_out: int, *, batch_norm: bool, dilation: int = 1) -> list[nn.Module]:
    """Convolution 3x3, optional batch normalisation, ReLU."""
    conv = nn.Conv2d(n_in, n_out, 3, padding=dilation, dilation=dilation)
    norm = [nn.BatchNorm2d(n_out)] if batch_norm else []
    return [conv, *norm, nn.ReLU(inplace=True)]


def stage(
    n_in: int, width: int, n_convs: int, *, batch_norm: bool, dilation: int = 1
) -> nn.Sequential:
    """n_convs units of one width."""
    widths = [n_in] + [width] * n_convs
    layers = [
        layer
        for a, b in itertools.pairwise(widths)
        for layer in unit(a, b, batch_norm=batch_norm, dilation=dilation)
    ]
    return nn.Sequential(*layers)


def vgg_stages(
    table: Sequence[tuple[int, int]],
    *,
    batch_norm: bool,
    dilations: Sequence[int] = (1, 1, 1, 1, 1),
    n_in: int = 3,
) -> nn.ModuleList:
    """The five stages without poolings."""
    inputs = [n_in] + [width for width, _ in table[:-1]]
    return nn.ModuleList(
        stage(n_in, width, n_convs, batch_norm=batch_norm, dilation=dilation)
        for n_in, (width, n_convs), dilation in zip(inputs, table, dilations, strict=True)
    )


def convolutions(module: nn.Module) -> list[nn.Conv2d]:
    """All convolutions of a module in order."""
    return [m for m in module.modules() if isinstance(m, nn.Conv2d)]


def start_he(module: nn.Module) -> None:
    """Initialise weights for ReLU layers (He et al. 2015) and biases with 0."""
    for conv in convolutions(module):
        nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")
        if conv.bias is not None:
            nn.init.zeros_(conv.bias)
