"""A network for two cores: a U-Net on blocks of 2x2 pixels with their positions.

Our own, about 1.2 million weights. Full resolution is the most expensive on a processor, so pixels
are folded into channels first and unfolded last; normals in a room depend strongly on the position
in the picture, so rows and columns are two more channels.
"""

from __future__ import annotations

import itertools

import torch
from torch import Tensor, nn
from torch.nn import functional

from pbrs_farm.study.networks.vgg import start_he

FOLD = 2


class SmallUnet(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) colour -> (B, n_out, H, W); H and W even, of 32 pixels or more."""

    def __init__(
        self, n_out: int = 3, widths: tuple[int, ...] = (32, 64, 112, 160), n_in: int = 3
    ) -> None:
        super().__init__()
        self.stem = _block(n_in * FOLD**2 + 2, widths[0])
        pairs = list(itertools.pairwise(widths))
        self.down = nn.ModuleList(_block(a, b) for a, b in pairs)
        self.context = nn.Linear(widths[-1], widths[-1])
        self.up = nn.ModuleList(_block(a + b, a) for a, b in reversed(pairs))
        start_he(self)
        self.head = nn.Conv2d(widths[0], n_out * FOLD**2, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """Output before normalisation."""
        x = functional.pixel_unshuffle(x, FOLD)
        x = self.stem(torch.cat([x, rows_and_columns(x)], 1))
        # The bottleneck also gets the mean over the whole picture.
        x, skips = encode(self.down, x)
        x = x + self.context(x.mean((2, 3)))[..., None, None]
        return functional.pixel_shuffle(self.head(decode(self.up, x, skips)), FOLD)


def encode(stages: nn.ModuleList, x: Tensor) -> tuple[Tensor, list[Tensor]]:
    """Bottleneck features of x (B, C, H, W), halved at each stage, and the stages' inputs as skip connections."""
    skips: list[Tensor] = []
    for stage in stages:
        skips.append(x)
        x = stage(functional.avg_pool2d(x, 2, ceil_mode=True))
    return x, skips


def decode(stages: nn.ModuleList, x: Tensor, skips: list[Tensor]) -> Tensor:
    """Features at full size: each stage gets the coarser ones, upsampled, beside its skip connection."""
    for stage, skip in zip(stages, reversed(skips), strict=True):
        size = skip.shape[-2:]
        x = functional.interpolate(x, size, mode="bilinear", align_corners=False)
        x = stage(torch.cat([x, skip], 1))
    return x


def _block(n_in: int, n_out: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for a in (n_in, n_out):
        conv = nn.Conv2d(a, n_out, 3, padding=1, bias=False)
        layers += [conv, nn.BatchNorm2d(n_out), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def rows_and_columns(x: Tensor) -> Tensor:
    """(B, 2, H, W) positions, -1 to 1 along rows and columns, for x (B, C, H, W)."""
    batch, _, height, width = x.shape
    rows = torch.linspace(-1, 1, height, dtype=x.dtype, device=x.device)
    columns = torch.linspace(-1, 1, width, dtype=x.dtype, device=x.device)
    positions = torch.stack(torch.meshgrid(rows, columns, indexing="ij"))
    return positions.expand(batch, 2, height, width)
