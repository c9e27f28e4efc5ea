"""A network for two cores: a U-Net on blocks of 2x2 pixels that knows where in the picture it is; no effects.

Our own, about 1.2 million weights. Full resolution costs most on a processor, so pixels are folded
into channels first and unfolded last; half of what is known of a room's normals is where they lie
in the picture, so rows and columns are two channels more.
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
        """The map, of no particular length."""
        x = functional.pixel_unshuffle(x, FOLD)
        x = self.stem(torch.cat([x, rows_and_columns(x)], 1))
        # Encode; give the bottleneck the mean over the whole picture; decode.
        x, skips = encode(self.down, x)
        x = x + self.context(x.mean((2, 3)))[..., None, None]
        return functional.pixel_shuffle(self.head(decode(self.up, x, skips)), FOLD)


def encode(stages: nn.ModuleList, x: Tensor) -> tuple[Tensor, list[Tensor]]:
    """Bottleneck features of x, and the skip connections from fine to coarse.

    x: (B, C, H, W). Each stage sees its input averaged over 2x2 pixels (rounded up at an odd edge);
    what it was given is kept at its own size for `decode`.
    """
    skips: list[Tensor] = []
    for stage in stages:
        skips.append(x)
        x = stage(functional.avg_pool2d(x, 2, ceil_mode=True))
    return x, skips


def decode(stages: nn.ModuleList, x: Tensor, skips: list[Tensor]) -> Tensor:
    """Features at full size, of bottleneck features and the skip connections of `encode`.

    Each stage takes the features below it, upsampled bilinearly to the size of its skip connection,
    and that connection beside them.
    """
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
    """(B, 2, H, W): -1 to 1 down the rows, and along the columns.

    Of the type and device of x, which is (B, C, H, W). Corners are -1 and 1 exactly, whatever the
    size.
    """
    batch, _, height, width = x.shape
    rows = torch.linspace(-1, 1, height, dtype=x.dtype, device=x.device)
    columns = torch.linspace(-1, 1, width, dtype=x.dtype, device=x.device)
    both = torch.stack(torch.meshgrid(rows, columns, indexing="ij"))
    return both.expand(batch, 2, height, width)
