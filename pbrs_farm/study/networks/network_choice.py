"""The network of a plan, and the encoding of its input."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import torch
from torch import Tensor, nn

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.networks.dilated_vgg import DilatedVgg
from pbrs_farm.study.networks.edge_hed import EdgeHed
from pbrs_farm.study.networks.efficient_unet import EfficientUnet
from pbrs_farm.study.networks.normals_fcn import NormalsFcn
from pbrs_farm.study.networks.residual_unet import ResidualUnet
from pbrs_farm.study.networks.small_unet import SmallUnet

# Name -> network for numbers of output and input channels; HED always has its sides.
_NETWORKS: Final[dict[str, Callable[[int, int], nn.Module]]] = {
    "small": lambda n_out, n_in: SmallUnet(n_out, n_in=n_in),
    "residual": lambda n_out, n_in: ResidualUnet(n_out, n_in=n_in),
    "efficient": lambda n_out, n_in: EfficientUnet(n_out, n_in=n_in),
    "paper": lambda n_out, n_in: NormalsFcn(n_out, n_in=n_in),
    "paper_tiny": lambda n_out, n_in: NormalsFcn(n_out, divide=8, n_in=n_in),
    "dilated": lambda n_out, n_in: DilatedVgg(n_out, n_in=n_in),
    "dilated_context": lambda n_out, n_in: DilatedVgg(n_out, context=True, n_in=n_in),
    "dilated_small": lambda n_out, n_in: DilatedVgg(n_out, head="small", n_in=n_in),
    "dilated_tiny": lambda n_out, n_in: DilatedVgg(n_out, head="small", tiny=True, n_in=n_in),
    "hed": lambda _, n_in: EdgeHed(n_in=n_in),
    "hed_tiny": lambda _, n_in: EdgeHed(tiny=True, n_in=n_in),
}

# Means of BGR 0..255 of Caffe's VGG; means and deviations of RGB 0..1 of ImageNet.
_CAFFE_BGR: Final = (104.00699, 116.66877, 122.67892)
_IMAGENET: Final = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
_LITE: Final = (127 / 255, 128 / 255)  # mean and scale of EfficientNet-Lite, about -1 to 1


def network_of(name: str, n_out: int, *, rays: bool = False) -> nn.Module:
    """The network by name with random weights (seed torch first); rays: three more inputs. BadInput."""
    if name not in _NETWORKS:
        raise BadInput("network", name, "no such network", hint=f"of {', '.join(_NETWORKS)}")
    return _NETWORKS[name](n_out, 6 if rays else 3)


def n_weights(network: nn.Module) -> int:
    """Number of trained weights."""
    return sum(p.numel() for p in network.parameters() if p.requires_grad)


def encode_colour(colour: Tensor, encoding: str) -> Tensor:
    """RGB 0..1 (B, 3, H, W) in the encoding of the first weights (TrainingPlan.encoding)."""
    if encoding == "centred":
        return colour - 128 / 255
    if encoding == "caffe":
        mean = torch.tensor(_CAFFE_BGR, dtype=colour.dtype, device=colour.device)
        return colour.flip(1) * 255 - mean.view(3, 1, 1)
    if encoding == "lite":
        return (colour - _LITE[0]) / _LITE[1]
    mean, deviation = torch.tensor(_IMAGENET, dtype=colour.dtype, device=colour.device)
    return (colour - mean.view(3, 1, 1)) / deviation.view(3, 1, 1)
