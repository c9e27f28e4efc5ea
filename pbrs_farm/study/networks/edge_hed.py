"""The paper's network for boundaries: holistically-nested edge detection on VGG-16 (Xie and Tu 2015)."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from pbrs_farm.study.networks.vgg import STAGES, TINY_STAGES, start_he, vgg_stages

N_SIDES: Final = 5

# The paper's result is the mean of the side outputs 2 to 4 (section 4.3).
PAPER_SIDES: Final = slice(1, 4)

# Learning rates as multiples of the plan's, as released: conv5, side scores, fusing layer.
RATE_OF_STAGE_5, RATE_OF_SIDES, RATE_OF_FUSE = 100.0, 0.01, 0.001


class EdgeHed(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) colour -> (B, 6, H, W) scores: five sides, then the fused one; sigmoid = edges."""

    def __init__(self, *, tiny: bool = False, n_in: int = 3) -> None:
        super().__init__()
        table = TINY_STAGES if tiny else STAGES
        self.stages = vgg_stages(table, batch_norm=tiny, n_in=n_in)
        self.sides = nn.ModuleList(nn.Conv2d(width, 1, 1) for width, _ in table)
        self.fuse = nn.Conv2d(N_SIDES, 1, 1)
        start_he(self.stages)
        # As released: sides start at zero, with equal weights in the fusion.
        for side in self.sides:
            nn.init.zeros_(side.weight)
            nn.init.zeros_(side.bias)
        nn.init.constant_(self.fuse.weight, 1 / N_SIDES)
        nn.init.zeros_(self.fuse.bias)

    def forward(self, x: Tensor) -> Tensor:
        """Scores before the sigmoid."""
        size = x.shape[-2:]
        scores = []
        for k, stage in enumerate(self.stages):
            x = functional.max_pool2d(x, 2, ceil_mode=True) if k else x
            x = stage(x)
            score = self.sides[k](x)
            if k:
                score = functional.interpolate(score, size, mode="bilinear", align_corners=False)
            scores.append(score)
        sides = torch.cat(scores, 1)
        return torch.cat([sides, self.fuse(sides)], 1)


def edges_of_sides(scores: Tensor) -> Tensor:
    """(B, H, W) edges 0..1: the mean of sides 2 to 4 of scores (B, 6, H, W) before the sigmoid."""
    return torch.sigmoid(scores[:, PAPER_SIDES]).mean(1)
