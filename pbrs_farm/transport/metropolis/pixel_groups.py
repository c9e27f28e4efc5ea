"""Which pixels a path's suffix is shown to: groups spread over the picture; no effects."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

NO_PIXEL: Final = 0xFFFFFFFF


class PixelGroups(NamedTuple):
    """The pixels in groups of n; a group's slots are neighbours."""

    slots: NDArray[np.uint32]  # (pixels,) slot of each
    pixels: NDArray[np.uint32]  # (slots,) pixel of each, NO_PIXEL = none
    n: int


def stratified_groups(height: int, width: int, n: int, seed: int) -> PixelGroups:
    """Groups of at most n pixels (of one, where n is 0), each spread over the whole picture.

    The picture is cut into as many square cells as a group may have pixels; every cell gives its
    pixels to different groups, at random, so that neighbours do not share their noise.
    """
    # Find the smallest cells of which there are no more than n.
    side = 1
    while -(-height // side) * -(-width // side) > max(n, 1):
        side += 1
    rows, columns = -(-height // side), -(-width // side)
    n_cells = rows * columns
    # Number the pixels of each cell at random: the number is the group, the cell the place in it.
    rng = np.random.default_rng(seed)
    order = rng.permuted(np.tile(np.arange(side * side), (n_cells, 1)), axis=1)
    y, x = np.mgrid[0:height, 0:width]
    cell = y // side * columns + x // side
    slots = order[cell, y % side * side + x % side] * n_cells + cell
    pixels = np.full(side * side * n_cells, NO_PIXEL, np.uint32)
    pixels[slots.ravel()] = np.arange(width * height, dtype=np.uint32)
    return PixelGroups(slots.ravel().astype(np.uint32), pixels, n_cells)
