"""The losses of normals, classes and edges, a number for each view whose mean is the loss; no effects."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional


def normal_loss(output: Tensor, normal: Tensor, valid: Tensor, *, kind: str, over: str) -> Tensor:
    """(B,) of output and unit normals (B, 3, H, W) and valid (B, H, W); its mean is the loss.

    kind: "cosine", 1 - cos of the angle (paper section 4.1), or "chord", the distance of the unit
    vectors, which far outliers pull less. The gradient of a pixel that is not valid is exactly 0.
    over: the mean is over "valid" pixels, or over "all", as released: what is not valid dilutes it.
    """
    unit = functional.normalize(output.float(), dim=1, eps=1e-6)
    cosine = (unit * normal).sum(1)
    miss = 1 - cosine
    if kind == "chord":
        miss = torch.sqrt((2 * miss).clamp(min=0) + 1e-6)
    miss = torch.where(valid, miss, torch.zeros_like(miss))
    return miss.sum((1, 2)) / _n_mean(valid, over)


def class_loss(output: Tensor, labels: Tensor, *, over: str) -> Tensor:
    """(B,) cross entropy of scores (B, C, H, W) and labels (B, H, W): ids 1..C, 0 is left out."""
    target = labels.long() - 1
    entropy = functional.cross_entropy(output.float(), target, reduction="none", ignore_index=-1)
    return entropy.sum((1, 2)) / _n_mean(labels > 0, over)


def edge_loss(scores: Tensor, edges: Tensor, *, as_sum: bool) -> Tensor:
    """(B,) class-balanced cross entropy of scores (B, S, H, W), summed over S; edges (B, H, W) bool.

    Of each view an edge weighs the share of pixels that are none, and the other way round (Xie and
    Tu 2015, equation 2). as_sum: over the pixels, as released, else their mean.
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


def _n_mean(counted: Tensor, over: str) -> Tensor | float:
    """What each view's sum is divided by, so that the mean over views is one over pixels."""
    if over == "all":
        return float(counted.shape[1] * counted.shape[2])
    return counted.sum().clamp(min=1) / counted.shape[0]
