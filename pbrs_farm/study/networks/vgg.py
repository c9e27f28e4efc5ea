"""The 13 convolutions of VGG-16 (Simonyan and Zisserman 2015), which three networks begin with; pure."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

# Width and number of the convolutions of each stage; a pooling by 2 stands between stages.
STAGES: Final = ((64, 2), (128, 2), (256, 3), (512, 3), (512, 3))
# The same shape at an eighth of the width and fewer convolutions: minutes on two cores.
TINY_STAGES: Final = ((16, 1), (32, 2), (64, 2), (96, 2), (96, 2))


def unit(n_in: int, n_out: int, *, batch_norm: bool, dilation: int = 1) -> list[nn.Module]:
    """Convolution 3x3, batch normalisation if asked for, ReLU."""
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
) -> nn.ModuleList:
    """The five stages, poolings left out."""
    inputs = [3] + [width for width, _ in table[:-1]]
    return nn.ModuleList(
        stage(n_in, width, n_convs, batch_norm=batch_norm, dilation=dilation)
        for n_in, (width, n_convs), dilation in zip(inputs, table, dilations, strict=True)
    )


def convolutions(module: nn.Module) -> list[nn.Conv2d]:
    """All convolutions inside a module, in the order they are applied."""
    return [m for m in module.modules() if isinstance(m, nn.Conv2d)]


def start_he(module: nn.Module) -> None:
    """Draw weights for ReLU layers (He et al. 2015); biases 0."""
    for conv in convolutions(module):
        nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")
        if conv.bias is not None:
            nn.init.zeros_(conv.bias)


def cropped_to(x: Tensor, like: Tensor) -> Tensor:
    """x without what it has more at the right and the bottom: transposed layers round up."""
    return x[..., : like.shape[-2], : like.shape[-1]]


# Segmentation as the paper has it: VGG-16 with dilated convolutions (Yu and Koltun 2016); pure.
# The last two poolings are left out and what follows is dilated instead; the picture is padded by
# reflection, so that the 7x7 layer dilated by 4 sees no zeros. Scores stand at an eighth of the
# size.


STRIDE: Final = 8  # pixels of the picture a score stands for
_DILATIONS: Final = (1, 1, 1, 1, 2)  # of the five stages
_CONTEXT: Final = (1, 1, 2, 4, 8, 16, 1)  # dilations of the context module; a 1x1 layer ends it


class DilatedVgg(nn.Module):  # type: ignore[misc]
    """(B, 3, H, W) colour -> (B, n_classes, H, W) scores, upsampled bilinearly.

    head: "full" 7x7 dilated by 4 with 4096 channels, the paper's (134 million weights), or "small"
    3x3 dilated by 12 with 256. tiny: an eighth of the width. context: the module of 8 layers that
    starts as the identity.
    """

    def __init__(
        self, n_classes: int, *, head: str = "full", tiny: bool = False, context: bool = False
    ) -> None:
        super().__init__()
        table: Sequence[tuple[int, int]] = TINY_STAGES if tiny else STAGES
        self.stages = vgg_stages(table, batch_norm=tiny, dilations=_DILATIONS)
        width = table[-1][0]
        kernel, dilation, n_hidden = (7, 4, 4096) if head == "full" else (3, 12, 256)
        n_hidden = n_hidden // 2 if tiny else n_hidden
        self.reach = dilation * (kernel - 1) // 2  # cells of padding the first layer needs
        self.head = nn.Sequential(
            nn.Conv2d(width, n_hidden, kernel, dilation=dilation), nn.ReLU(inplace=True),
            nn.Dropout(0.5), nn.Conv2d(n_hidden, n_hidden, 1), nn.ReLU(inplace=True),
            nn.Dropout(0.5), nn.Conv2d(n_hidden, n_classes, 1),
        )  # fmt: skip
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
    """x with a border of its own reflection, in as many steps as small maps need."""
    while by > 0:
        step = min(by, min(x.shape[-2:]) - 1)
        x = functional.pad(x, (step,) * 4, mode="reflect")
        by -= step
    return x


def _context(n: int) -> nn.Sequential:
    """Eight layers that pass scores on unchanged until they have learnt otherwise."""
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


# Boundaries as the paper has them: holistically-nested edge detection (Xie and Tu 2015); pure.
# VGG-16 with a score of edges after each stage, upsampled to the picture, and a fused one.


N_SIDES: Final = 5
# The paper's result is the mean of the side outputs 2 to 4 (section 4.3).
PAPER_SIDES: Final = slice(1, 4)
# Learning rates against the rest's, as released: conv5, side scores, the fusing layer.
RATE_OF_STAGE_5, RATE_OF_SIDES, RATE_OF_FUSE = 100.0, 0.01, 0.001


class EdgeHed(nn.Module):  # type: ignore[misc]
    """(B, 3, H, W) colour -> (B, 6, H, W) scores: five sides, then the fused one; sigmoid = edges."""

    def __init__(self, *, tiny: bool = False) -> None:
        super().__init__()
        table = TINY_STAGES if tiny else STAGES
        self.stages = vgg_stages(table, batch_norm=tiny)
        self.sides = nn.ModuleList(nn.Conv2d(width, 1, 1) for width, _ in table)
        self.fuse = nn.Conv2d(N_SIDES, 1, 1)
        start_he(self.stages)
        # Sides start at nothing and are fused by equal shares, as released.
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
    """(B, H, W) edges 0..1 of (B, 6, H, W) scores: the mean of sides 2 to 4, as the paper takes it."""
    return torch.sigmoid(scores[:, PAPER_SIDES]).mean(1)


# The paper's network for normals: VGG-16 down, its mirror image up, pooling switches reused;
# pure.
# Section 4.1 and the released definition: units of convolution, batch normalisation and ReLU,
# four poolings whose switches place the values again on the way up, features of the way down
# joined. The last hidden layer has three channels, as released. 26,421,021 weights.


# Convolutions of each stage on the way up, from the coarsest; the last stage is the head.
_UP: Final = (3, 3, 3, 2)


class NormalsFcn(nn.Module):  # type: ignore[misc]
    """(B, 3, H, W) colour -> (B, n_out, H, W); H and W of 16 pixels or more."""

    def __init__(self, n_out: int = 3, divide: int = 1) -> None:
        """divide: of every width; 1 is the paper's network."""
        super().__init__()
        table = [(width // divide, n) for width, n in STAGES]
        widths = [width for width, _ in table]
        self.down = vgg_stages(table, batch_norm=True)
        self.pool = nn.MaxPool2d(2, return_indices=True, ceil_mode=True)
        self.unpool = nn.MaxUnpool2d(2)
        # Each stage up ends with the width that the pooling above it had.
        ups, n_in = [], widths[4]
        for n_convs, width in zip(_UP, widths[3::-1], strict=True):
            ups.append(stage(n_in, width, n_convs, batch_norm=True))
            n_in = 2 * width
        self.up = nn.ModuleList(ups)
        head = unit(n_in, n_out, batch_norm=True)
        self.head = nn.Sequential(*head, nn.Conv2d(n_out, n_out, 3, padding=1))
        start_he(self)

    def forward(self, x: Tensor) -> Tensor:
        """The map before it is made of unit length."""
        # Go down and remember what each pooling saw and chose.
        seen: list[tuple[Tensor, Tensor]] = []
        for k, down in enumerate(self.down):
            if k:
                features = x
                x, switches = self.pool(features)
                seen.append((features, switches))
            x = down(x)
        # Go up: put values back where they were chosen, beside the features of the way down.
        for up in self.up:
            x = up(x)
            features, switches = seen.pop()
            x = self.unpool(x, switches, output_size=features.shape[-2:])
            x = torch.cat([x, features], 1)
        return self.head(x)
