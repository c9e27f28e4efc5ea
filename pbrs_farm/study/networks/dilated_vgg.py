"""The paper's network for segmentation: VGG-16 with dilated convolutions (Yu and Koltun 2016).

Dilation replaces the last two poolings; the map is padded by reflection, so that the 7x7 layer
dilated by 4 sees no zeros. Scores have an eighth of the resolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from pbrs_farm.study.networks.vgg import STAGES, TINY_STAGES, vgg_stages

STRIDE: Final = 8  # pixels of the picture per score
_DILATIONS: Final = (1, 1, 1, 1, 2)  # of the five stages
_CONTEXT: Final = (1, 1, 2, 4, 8, 16, 1)  # dilations of the context module; a 1x1 layer ends it


class DilatedVgg(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) colour -> (B, n_classes, H, W) scores, upsampled bilinearly.

    head: "full" 7x7 dilated by 4 with 4096 channels, the paper's (134 million weights), or "small"
    3x3 dilated by 12 with 256. tiny: an eighth of the width. context: a module of 8 layers,
    initially the identity.
    """

    def __init__(
        self,
        n_classes: int,
        *,
        head: str = "full",
        tiny: bool = False,
        context: bool = False,
        n_in: int = 3,
    ) -> None:
        super().__init__()
        table: Sequence[tuple[int, int]] = TINY_STAGES if tiny else STAGES
        self.stages = vgg_stages(table, batch_norm=tiny, dilations=_DILATIONS, n_in=n_in)
        width = table[-1][0]
        kernel, dilation, n_hidden = (7, 4, 4096) if head == "full" else (3, 12, 256)
        n_hidden = n_hidden // 2 if tiny else n_hidden
        self.reach = dilation * (kernel - 1) // 2  # padding of the first layer, cells
        self.head = nn.Sequential(
            nn.Conv2d(width, n_hidden, kernel, dilation=dilation),
            nn.ReLU(inplace=True),
            nn.Dropout(0.5),
            nn.Conv2d(n_hidden, n_hidden, 1),
            nn.ReLU(inplace=True),
            nn.Dropout(0.5),
            nn.Conv2d(n_hidden, n_classes, 1),
        )
        nn.init.normal_(self.head[-1].weight, std=0.001)
        nn.init.zeros_(self.head[-1].bias)
        self.context = _context(n_classes) if context else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        """Scores of each class, before softmax."""
        height, width = x.shape[-2:]
        for k, stage in enumerate(self.stages):
            x = functional.max_pool2d(x, 2, ceil_mode=True) if 0 < k < 4 else x
            x = stage(x)
        x = self.context(self.head(_reflected(x, self.reach)))
        size = (x.shape[-2] * STRIDE, x.shape[-1] * STRIDE)
        x = functional.interpolate(x, size, mode="bilinear", align_corners=False)
        return x[..., :height, :width]


def _reflected(x: Tensor, by: int) -> Tensor:
    """x padded by reflection, in several steps for small maps."""
    while by > 0:
        step = min(by, min(x.shape[-2:]) - 1)
        x = functional.pad(x, (step,) * 4, mode="reflect")
        by -= step
    return x


def _context(n: int) -> nn.Sequential:
    """Eight layers, initially the identity."""
    layers: list[nn.Module] = []
    for dilation in _CONTEXT:
        conv = nn.Conv2d(n, n, 3, padding=dilation, dilation=dilation)
        layers += [_as_identity(conv), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers, _as_identity(nn.Conv2d(n, n, 1)))


def _as_identity(conv: nn.Conv2d) -> nn.Conv2d:
    with torch.no_grad():
        conv.weight.zero_()
        middle = conv.weight.shape[-1] // 2
        for k in range(conv.weight.shape[0]):
            conv.weight[k, k, middle, middle] = 1.0
    nn.init.zeros_(conv.bias)
    return conv
