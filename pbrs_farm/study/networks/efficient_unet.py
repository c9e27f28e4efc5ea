"""A U-Net on EfficientNet-Lite0, whose encoder can start from ImageNet.

The encoder is EfficientNet (Tan and Le 2019) without squeeze and excitation and with ReLU6, as in its
Lite variants: 3.0 of 4.3 million weights. The decoder is ours: two blocks of attention at a 32nd of
the resolution, with positions of the cells, then a block per stage with a skip connection.
"""

from __future__ import annotations

from typing import Final

from torch import Tensor, nn
from torch.nn import functional

from pbrs_farm.study.networks.residual_unet import Attention, Residual, attended
from pbrs_farm.study.networks.small_unet import FOLD, decode
from pbrs_farm.study.networks.vgg import start_he

# Repeats, kernel, stride, expansion and width of each stage (table 1 of the paper; Lite keeps the
# stem's 32 channels).
_STAGES: Final = (
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
)
_STEM: Final = 32
_EPSILON: Final = 1e-3  # of batch normalisation
N_FEATURES: Final = 1280  # number of inputs of the classifier
_AFTER: Final = (0, 1, 2, 4)  # stages with skip connections, at a 2nd to a 16th of the resolution
_DEEPEST: Final = 160  # channels at the attention
_UP: Final = (128, 96, 64, 48)  # of the decoder, from coarse to fine


class EfficientUnet(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) colour -> (B, n_out, H, W); H and W even, of 34 pixels or more."""

    def __init__(self, n_out: int = 3, n_in: int = 3) -> None:
        super().__init__()
        self.encoder = LiteEncoder(n_in)
        self.narrow = nn.Conv2d(_STAGES[-1][-1], _DEEPEST, 1)
        skips = [_STAGES[k][-1] for k in reversed(_AFTER)]
        below = (_DEEPEST, *_UP[:-1])
        self.up = nn.ModuleList(
            Residual(a + skip, b) for a, skip, b in zip(below, skips, _UP, strict=True)
        )
        start_he(self)
        self.place = nn.Linear(2, _DEEPEST)
        self.attention = nn.ModuleList(Attention(_DEEPEST) for _ in range(2))
        self.head = nn.Conv2d(_UP[-1], n_out * FOLD**2, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """Output before normalisation."""
        x, skips = self.encoder(x)
        x = attended(self.narrow(x), self.place, self.attention)
        return functional.pixel_shuffle(self.head(decode(self.up, x, skips)), FOLD)


class LiteEncoder(nn.Module):  # type: ignore[misc]
    """(B, n_in, H, W) -> features (B, 320, H / 32, W / 32), and the skip connections from fine to coarse."""

    def __init__(self, n_in: int = 3) -> None:
        super().__init__()
        self.stem = _unit(n_in, _STEM, 3, stride=2)
        stages, below = [], _STEM
        for repeats, kernel, stride, expansion, width in _STAGES:
            blocks = []
            for k in range(repeats):
                blocks.append(_Inverted(below, width, kernel, 1 if k else stride, expansion))
                below = width
            stages.append(nn.Sequential(*blocks))
        self.stages = nn.ModuleList(stages)

    def forward(self, x: Tensor) -> tuple[Tensor, list[Tensor]]:
        """Bottleneck features and skip connections."""
        x = self.stem(x)
        skips: list[Tensor] = []
        for k, stage in enumerate(self.stages):
            x = stage(x)
            if k in _AFTER:
                skips.append(x)
        return x, skips


class LiteFeatures(nn.Module):  # type: ignore[misc]
    """(B, 3, H, W) -> (B, 1280) features, 0 to 6: the input of EfficientNet-Lite0's classifier."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = LiteEncoder()
        self.head = _unit(_STAGES[-1][-1], N_FEATURES, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Means over the picture."""
        return self.head(self.encoder(x)[0]).mean((2, 3))


class _Inverted(nn.Module):  # type: ignore[misc]
    """Inverted residual block (Sandler et al. 2018): expand, depthwise filter, project."""

    def __init__(self, n_in: int, n_out: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        n = n_in * expansion
        self.expand = _unit(n_in, n, 1) if expansion > 1 else nn.Identity()
        self.filter = _unit(n, n, kernel, stride=stride, groups=n)
        self.project = _unit(n, n_out, 1, is_last=True)
        self.has_short_cut = stride == 1 and n_in == n_out

    def forward(self, x: Tensor) -> Tensor:
        y = self.project(self.filter(self.expand(x)))
        return x + y if self.has_short_cut else y


def _unit(
    n_in: int, n_out: int, kernel: int, *, stride: int = 1, groups: int = 1, is_last: bool = False
) -> nn.Sequential:
    """Convolution, normalisation and, except at the end of a block, ReLU6."""
    conv = SameConv(n_in, n_out, kernel, stride=stride, groups=groups, bias=False)
    norm = nn.BatchNorm2d(n_out, eps=_EPSILON)
    return nn.Sequential(conv, norm, *([] if is_last else [nn.ReLU6(inplace=True)]))


class SameConv(nn.Conv2d):  # type: ignore[misc]
    """A convolution with the padding "same" of TensorFlow: with stride 2, more at the end."""

    def forward(self, x: Tensor) -> Tensor:
        pads: list[int] = []
        # functional.pad wants the last axis first.
        for n, kernel, stride in zip(
            reversed(x.shape[-2:]), reversed(self.kernel_size), reversed(self.stride), strict=True
        ):
            total = max((-(-n // stride) - 1) * stride + kernel - n, 0)
            pads += [total // 2, total - total // 2]
        x = functional.pad(x, pads) if any(pads) else x
        return functional.conv2d(x, self.weight, None, self.stride, 0, 1, self.groups)
