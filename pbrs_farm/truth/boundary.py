"""Boundaries between pixels: the published instance boundary and typed ones; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.arrays import Mask


def instance_boundary(instance: NDArray[Any]) -> NDArray[np.uint8]:
    """(H, W) uint8, 255 on boundaries: the published definition (suncg section 5).

    Pixel (r, c) is boundary when any adjacent pair inside its 2 x 2 block (r..r+1, c..c+1) has
    different ids; in the last row when it differs from its right, in the last column from its
    lower neighbour; the bottom right corner never is.
    """
    right = instance[:, :-1] != instance[:, 1:]
    down = instance[:-1, :] != instance[1:, :]
    return np.where(block_edges(right, down), 255, 0).astype(np.uint8)


def block_edges(right: Mask, down: Mask) -> Mask:
    """(H, W) bool from edges to the right (H, W - 1) and down (H - 1, W): any inside the block."""
    height, width = right.shape[0], down.shape[1]
    edge = np.zeros((height, width), bool)
    edge[:, :-1] |= right
    edge[:-1, :] |= down
    edge[:-1, :-1] |= right[1:, :] | down[:, 1:]
    return edge
