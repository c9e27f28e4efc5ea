"""A network for two cores: a U-Net on blocks of 2x2 pixels that knows where in the picture it is; pure.

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
    """(B, 3, H, W) colour -> (B, n_out, H, W); H and W even, of 32 pixels or more."""

    def __init__(self, n_out: int = 3, widths: tuple[int, ...] = (32, 64, 112, 160)) -> None:
        super().__init__()
        n_in = 3 * FOLD**2 + 2
        self.stem = _block(n_in, widths[0])
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
        # Go down, keep each stage; let the deepest know the whole picture's mean.
        x, kept = gone_down(self.down, x)
        x = x + self.context(x.mean((2, 3)))[..., None, None]
        return functional.pixel_shuffle(self.head(gone_up(self.up, x, kept)), FOLD)


def gone_down(stages: nn.ModuleList, x: Tensor) -> tuple[Tensor, list[Tensor]]:
    """(what the deepest stage says of x, what each stage was given at its larger size)."""
    kept: list[Tensor] = []
    for stage in stages:
        kept.append(x)
        x = stage(functional.avg_pool2d(x, 2, ceil_mode=True))
    return x, kept


def gone_up(stages: nn.ModuleList, x: Tensor, kept: list[Tensor]) -> Tensor:
    """The map at full size: each stage sees the one below, enlarged, beside what was kept."""
    for stage, beside in zip(stages, reversed(kept), strict=True):
        size = beside.shape[-2:]
        x = functional.interpolate(x, size, mode="bilinear", align_corners=False)
        x = stage(torch.cat([x, beside], 1))
    return x


def _block(n_in: int, n_out: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for a in (n_in, n_out):
        conv = nn.Conv2d(a, n_out, 3, padding=1, bias=False)
        layers += [conv, nn.BatchNorm2d(n_out), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def rows_and_columns(x: Tensor) -> Tensor:
    """(B, 2, H, W): -1 to 1 down the rows, and along the columns."""
    batch, _, height, width = x.shape
    rows = torch.linspace(-1, 1, height, dtype=x.dtype, device=x.device)
    columns = torch.linspace(-1, 1, width, dtype=x.dtype, device=x.device)
    both = torch.stack(torch.meshgrid(rows, columns, indexing="ij"))
    return both.expand(batch, 2, height, width)


# A network for two cores that sees the whole room: a U-Net of residual blocks, attention at its
# deepest; pure.
# Our own, about 2.3 million weights. Which way a bare wall faces is told by corners and edges far
# from it, so that at a 32nd of the picture's size every cell attends to every other (Vaswani et
# al. 2017), each knowing where it lies. Blocks are those of He et al. 2016, section 3.


class ResidualUnet(nn.Module):  # type: ignore[misc]
    """(B, 3, H, W) colour -> (B, n_out, H, W); H and W even, of 32 pixels or more."""

    def __init__(
        self, n_out: int = 3, widths: tuple[int, ...] = (32, 64, 96, 128, 160), n_attention: int = 2
    ) -> None:
        super().__init__()
        self.stem = _Residual(3 * FOLD**2 + 2, widths[0])
        pairs = list(itertools.pairwise(widths))
        self.down = nn.ModuleList(_Residual(a, b) for a, b in pairs)
        self.up = nn.ModuleList(_Residual(a + b, a) for a, b in reversed(pairs))
        start_he(self)
        self.place = nn.Linear(2, widths[-1])
        self.attention = nn.ModuleList(_Attention(widths[-1]) for _ in range(n_attention))
        self.head = nn.Conv2d(widths[0], n_out * FOLD**2, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """The map, of no particular length."""
        x = functional.pixel_unshuffle(x, FOLD)
        x = self.stem(torch.cat([x, rows_and_columns(x)], 1))
        x, kept = gone_down(self.down, x)
        # Let every cell of the deepest stage look at all others.
        cells = x.flatten(2).mT + self.place(rows_and_columns(x).flatten(2).mT)
        for attention in self.attention:
            cells = attention(cells)
        x = cells.mT.reshape(x.shape).contiguous(memory_format=torch.channels_last)
        return functional.pixel_shuffle(self.head(gone_up(self.up, x, kept)), FOLD)


class _Residual(nn.Module):  # type: ignore[misc]
    """Two convolutions beside a short cut."""

    def __init__(self, n_in: int, n_out: int) -> None:
        super().__init__()
        self.first, self.second = _convolution(n_in, n_out), _convolution(n_out, n_out)
        same = n_in == n_out
        self.short_cut = nn.Identity() if same else nn.Conv2d(n_in, n_out, 1, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        y = self.second(functional.relu(self.first(x)))
        return functional.relu(y + self.short_cut(x))


def _convolution(n_in: int, n_out: int) -> nn.Sequential:
    conv = nn.Conv2d(n_in, n_out, 3, padding=1, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(n_out))


class _Attention(nn.Module):  # type: ignore[misc]
    """A transformer's block, normalised before each half: cells (B, N, C) -> the same."""

    def __init__(self, n: int, heads: int = 5) -> None:
        super().__init__()
        self.heads = heads
        self.before, self.between = nn.LayerNorm(n), nn.LayerNorm(n)
        self.asked, self.answer = nn.Linear(n, 3 * n), nn.Linear(n, n)
        self.wide = nn.Sequential(nn.Linear(n, 2 * n), nn.GELU(), nn.Linear(2 * n, n))

    def forward(self, x: Tensor) -> Tensor:
        batch, n_cells, n = x.shape
        asked = self.asked(self.before(x)).view(batch, n_cells, 3, self.heads, n // self.heads)
        found = functional.scaled_dot_product_attention(*asked.permute(2, 0, 3, 1, 4))
        x = x + self.answer(found.transpose(1, 2).flatten(2))
        return x + self.wide(self.between(x))
