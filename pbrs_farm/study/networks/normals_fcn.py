"""The paper's network for normals: VGG-16 as encoder, its mirror image as decoder, shared switches.

Section 4.1 and the released definition: units of convolution, batch normalisation and ReLU; the
switches of four poolings place the values in the decoder, beside the encoder's features. The last
hidden layer has three channels, as released. 26,421,021 weights.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from pbrs_farm.study.networks.vgg import STAGES, stage, start_he, unit, vgg_stages

# Number of convolutions of each decoder stage, coarsest first; the last stage is the head.
_UP: Final = (3, 3, 3, 2)


class NormalsFcn(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) colour -> (B, n_out, H, W); H and W of 16 pixels or more."""

    def __init__(self, n_out: int = 3, divide: int = 1, n_in: int = 3) -> None:
        """divide: divisor of every width; 1 for the paper's network."""
        super().__init__()
        table = [(width // divide, n) for width, n in STAGES]
        widths = [width for width, _ in table]
        self.down = vgg_stages(table, batch_norm=True, n_in=n_in)
        self.pool = nn.MaxPool2d(2, return_indices=True, ceil_mode=True)
        self.unpool = nn.MaxUnpool2d(2)
        # Each decoder stage ends with the width of the pooling above it.
        ups, n_in = [], widths[4]
        for n_convs, width in zip(_UP, widths[3::-1], strict=True):
            ups.append(stage(n_in, width, n_convs, batch_norm=True))
            n_in = 2 * width
        self.up = nn.ModuleList(ups)
        head = unit(n_in, n_out, batch_norm=True)
        self.head = nn.Sequential(*head, nn.Conv2d(n_out, n_out, 3, padding=1))
        start_he(self)

    def forward(self, x: Tensor) -> Tensor:
        """Output before normalisation."""
        # Encode, and keep the input and the switches of each pooling.
        poolings: list[tuple[Tensor, Tensor]] = []
        for k, down in enumerate(self.down):
            if k:
                features = x
                x, switches = self.pool(features)
                poolings.append((features, switches))
            x = down(x)
        # Decode: unpool by the switches, beside the features of the encoder.
        for up in self.up:
            x = up(x)
            features, switches = poolings.pop()
            x = self.unpool(x, switches, output_size=features.shape[-2:])
            x = torch.cat([x, features], 1)
        return self.head(x)
