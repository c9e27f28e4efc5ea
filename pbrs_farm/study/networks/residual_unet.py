"""A U-Net of residual blocks with attention at its deepest stage, for two cores.

Our own, about 2.3 million weights. The orientation of a bare wall follows from distant corners and
edges, so at a 32nd of the resolution every cell attends to every other (Vaswani et al. 2017), with
its position. Blocks are those of He et al. 2016, section 3.
"""

from __future__ import annotations

import itertools

import torch
from torch import Tensor, nn
from torch.nn import functional

from pbrs_farm.study.networks.small_unet import FOLD, decode, encode, rows_and_columns
from pbrs_farm.study.networks.vgg import start_he


class ResidualUnet(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) colour -> (B, n_out, H, W); H and W even, of 32 pixels or more."""

    def __init__(
        self,
        n_out: int = 3,
        widths: tuple[int, ...] = (32, 64, 96, 128, 160),
        n_attention: int = 2,
        n_in: int = 3,
    ) -> None:
        super().__init__()
        self.stem = Residual(n_in * FOLD**2 + 2, widths[0])
        pairs = list(itertools.pairwise(widths))
        self.down = nn.ModuleList(Residual(a, b) for a, b in pairs)
        self.up = nn.ModuleList(Residual(a + b, a) for a, b in reversed(pairs))
        start_he(self)
        self.place = nn.Linear(2, widths[-1])
        self.attention = nn.ModuleList(Attention(widths[-1]) for _ in range(n_attention))
        self.head = nn.Conv2d(widths[0], n_out * FOLD**2, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """Output before normalisation."""
        x = functional.pixel_unshuffle(x, FOLD)
        x = self.stem(torch.cat([x, rows_and_columns(x)], 1))
        x, skips = encode(self.down, x)
        x = attended(x, self.place, self.attention)
        return functional.pixel_shuffle(self.head(decode(self.up, x, skips)), FOLD)


def attended(x: Tensor, place: nn.Linear, blocks: nn.ModuleList) -> Tensor:
    """Features (B, C, H, W) after attention between all cells; place: layer from rows and columns to C channels."""
    cells = x.flatten(2).mT + place(rows_and_columns(x).flatten(2).mT)
    for block in blocks:
        cells = block(cells)
    return cells.mT.reshape(x.shape).contiguous(memory_format=torch.channels_last)


class Residual(nn.Module):  # type: ignore[misc]
    """Two convolutions with a short cut."""

    def __init__(self, n_in: int, n_out: int) -> None:
        super().__init__()
        self.first, self.second = _convolution(n_in, n_out), _convolution(n_out, n_out)
        self.short_cut = nn.Identity() if n_in == n_out else nn.Conv2d(n_in, n_out, 1, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        y = self.second(functional.relu(self.first(x)))
        return functional.relu(y + self.short_cut(x))


def _convolution(n_in: int, n_out: int) -> nn.Sequential:
    conv = nn.Conv2d(n_in, n_out, 3, padding=1, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(n_out))


class Attention(nn.Module):  # type: ignore[misc]
    """A pre-norm transformer block, attention then MLP: cells (B, N, C) -> the same."""

    def __init__(self, n: int, heads: int = 5) -> None:
        super().__init__()
        self.heads = heads
        self.norm1, self.norm2 = nn.LayerNorm(n), nn.LayerNorm(n)
        self.qkv, self.proj = nn.Linear(n, 3 * n), nn.Linear(n, n)
        self.mlp = nn.Sequential(nn.Linear(n, 2 * n), nn.GELU(), nn.Linear(2 * n, n))

    def forward(self, x: Tensor) -> Tensor:
        batch, n_cells, n = x.shape
        # Queries, keys and values of each head: (3, B, heads, N, C / heads).
        qkv = self.qkv(self.norm1(x)).view(batch, n_cells, 3, self.heads, n // self.heads)
        mixed = functional.scaled_dot_product_attention(*qkv.permute(2, 0, 3, 1, 4))
        x = x + self.proj(mixed.transpose(1, 2).flatten(2))
        return x + self.mlp(self.norm2(x))
