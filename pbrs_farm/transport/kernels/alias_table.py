"""Alias tables: sampling a discrete distribution in constant time (Vose 1991); no effects."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32


def sample_alias_table(alias: Any, first: Any, count: Any, u: Any, active: Any) -> tuple[Any, Any]:
    """(index, u made uniform again) of an alias table's part [first, first + count)."""
    # Choose an entry, then stay or take its alias.
    x = u * mi.Float(count)
    i = dr.minimum(mi.UInt32(x), count - 1)
    f = x - mi.Float(i)
    row = dr.gather(mi.Vector2f, alias, first + i, active)
    other = dr.reinterpret_array(mi.UInt32, row[1])
    stay = f < row[0]
    # Stretch what is left of u to [0, 1).
    again = dr.select(stay, f / row[0], (f - row[0]) / (1 - row[0]))
    return dr.select(stay, i, other), dr.clip(again, 0, 1 - 1e-7)


def alias_rows(weights: NDArray[np.floating]) -> F32:
    """(N, 2) rows (chance to stay, bits of the other index) of Vose's alias method."""
    w = np.asarray(weights, np.float64)
    n = len(w)
    total = w.sum()
    chance = w * (n / total) if total > 0 else np.ones(n)
    stay, other = np.ones(n), np.arange(n, dtype=np.uint32)
    # Pair each entry below the mean with one above it, which fills it up.
    small = [int(i) for i in np.flatnonzero(chance < 1)]
    large = [int(i) for i in np.flatnonzero(chance >= 1)]
    left = chance.tolist()
    while small and large:
        i, j = small.pop(), large[-1]
        stay[i], other[i] = left[i], j
        left[j] -= 1 - left[i]
        if left[j] < 1:
            small.append(large.pop())
    rows = np.empty((n, 2), np.float32)
    rows[:, 0] = np.clip(stay, 0, 1)
    rows[:, 1] = other.view(np.float32)
    return rows
