"""Choice among kept views so that rare classes are not drowned by walls; no effects."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32, Bools
from pbrs_farm.core.classes import NYU40_NAMES

N_CLASSES: Final = len(NYU40_NAMES)
_FLOOR: Final = 0.01  # of a picture: bounds the gain of the first view of a class


def class_shares(texts: Sequence[str]) -> F32:
    """(n, 41) share of each NYU40 class (0 unknown), from "1:0.53 2:0.21" texts of our tables."""
    shares = np.zeros((len(texts), N_CLASSES), np.float32)
    for row, text in enumerate(texts):
        for pair in text.split():
            nyu40, _, share = pair.partition(":")
            shares[row, int(nyu40)] = float(share)
    return shares


def balance_classes(shares: F32, n_views: int) -> Bools:
    """(n,) bool: n_views rows of shares (n, classes) that cover all classes well.

    Greedily maximises the sum over classes of the logarithm of the share gathered. A gain in a class
    counts less the more of it is covered, so views with rare classes go first. The objective is
    submodular, so greedy comes within 1 - 1/e of the best, and an earlier gain is an upper bound of
    the present one (Minoux 1978). Ties go to the earlier row.
    """
    # Start from the gain of each view alone, the largest on top of the heap.
    taken = np.zeros(len(shares), bool)
    total = np.full(shares.shape[1], _FLOOR, np.float64)  # share gathered of each class
    gains = np.log1p(shares / _FLOOR).sum(axis=1, dtype=np.float64)
    # (-gain, row): an upper bound, since gains only fall as classes fill up.
    heap = [(-float(gain), row) for row, gain in enumerate(gains)]
    heapq.heapify(heap)
    # For each view, only the classes in it and their shares.
    sparse = [(np.nonzero(s)[0], s[s != 0].astype(np.float64)) for s in shares]
    for _ in range(min(n_views, len(shares))):
        # Recompute the top view's gain; take it if no other bound is above.
        while True:
            _bound, row = heapq.heappop(heap)
            classes, share = sparse[row]
            gain = float(np.log1p(share / total[classes]).sum())
            if not heap or (-gain, row) <= heap[0]:
                break
            heapq.heappush(heap, (-gain, row))
        taken[row] = True
        total[classes] += share
    return taken
