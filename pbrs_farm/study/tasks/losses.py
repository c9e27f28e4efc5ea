"""Losses of the four tasks: one number per view, averaged by the caller."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

_SCALE_SHARE: Final = 0.5  # forgiven share of a view's common error of log depth


def normal_loss(output: Tensor, normal: Tensor, valid: Tensor, *, kind: str, over: str) -> Tensor:
    """(B,) losses of output and unit normals (B, 3, H, W) and valid (B, H, W).

    kind: "cosine", 1 - cos of the angle (paper section 4.1), or "chord", the distance of the unit
    vectors, with less weight on outliers. The gradient of invalid pixels is exactly 0.
    over: divide by the "valid" pixels, or by "all", as in the released code.
    """
    unit = functional.normalize(output.float(), dim=1, eps=1e-6)
    miss = 1 - (unit * normal).sum(1)
    if kind == "chord":
        miss = torch.sqrt((2 * miss).clamp(min=0) + 1e-6)
    miss = torch.where(valid, miss, torch.zeros_like(miss))
    return miss.sum((1, 2)) / _n_mean(valid, over)


def class_loss(output: Tensor, labels: Tensor, *, over: str) -> Tensor:
    """(B,) cross entropy of scores (B, C, H, W) and labels (B, H, W): ids 1..C, 0 is ignored."""
    target = labels.long() - 1
    entropy = functional.cross_entropy(output.float(), target, reduction="none", ignore_index=-1)
    return entropy.sum((1, 2)) / _n_mean(labels > 0, over)


def edge_loss(scores: Tensor, edges: Tensor, *, as_sum: bool) -> Tensor:
    """(B,) class-balanced cross entropy of scores (B, S, H, W), summed over S; edges (B, H, W) bool.

    In each view an edge pixel is weighted by the share of the other pixels, and vice versa (Xie and
    Tu 2015, equation 2). as_sum: sum over the pixels, as in the released code, else their mean.
    """
    target = edges.float()
    share = target.mean((1, 2), keepdim=True)
    weights = torch.where(edges, 1 - share, share)[:, None]
    target = target[:, None].expand_as(scores)
    loss = weights * functional.binary_cross_entropy_with_logits(
        scores.float(), target, reduction="none"
    )
    pixels = edges.shape[1] * edges.shape[2]
    return loss.sum((1, 2, 3)) / (1 if as_sum else pixels)


def depth_loss(output: Tensor, depth: Tensor) -> Tensor:
    """(B,) losses of log depths (B, 1, H, W) and metres (B, H, W), 0 = unknown.

    Eigen et al. 2014, equation 4: the mean square of d = output - ln depth, less half the square of
    its mean, so that a wrong scale of the whole view costs half.
    """
    valid = depth > 0
    n = valid.sum((1, 2)).clamp(min=1)
    d = output.float()[:, 0] - torch.log(torch.where(valid, depth, torch.ones_like(depth)))
    d = torch.where(valid, d, torch.zeros_like(d))
    return (d**2).sum((1, 2)) / n - _SCALE_SHARE * (d.sum((1, 2)) / n) ** 2


def _n_mean(counted: Tensor, over: str) -> Tensor | float:
    """The divisor of each view's sum, such that the mean over views is a mean over pixels."""
    if over == "all":
        return float(counted.shape[1] * counted.shape[2])
    return counted.sum().clamp(min=1) / counted.shape[0]
