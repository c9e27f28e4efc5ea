"""Order of the views of shards, by seed and epoch, divided among readers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput

_WINDOW: Final = 4  # number of consecutive shards whose views are mixed


def shard_order(
    counts: Sequence[int], *, seed: int, epoch: int, part: int = 0, n_parts: int = 1
) -> NDArray[np.intp]:
    """(n, 2) shuffled shard and position of the views of one reader of n_parts in one epoch.

    counts: number of views of each shard. All readers have equally many views; at most n_parts - 1
    views are dropped, different ones in each epoch. A reader needs consecutive shards, and the views
    of every 4 of them are mixed. Raises BadInput for fewer views than readers.
    """
    total = sum(counts)
    if total < n_parts:
        raise BadInput(
            "shards", "", f"{total} views for {n_parts} readers", hint="use fewer workers"
        )
    # Line up the shards in a random order of the epoch, from a random start.
    rng = np.random.default_rng((seed, epoch))
    shards = rng.permutation(len(counts))
    line = np.concatenate([_places(int(s), counts[s]) for s in shards])
    line = np.roll(line, -int(rng.integers(total)), axis=0)
    n_each = total // n_parts
    part_line = line[part * n_each : (part + 1) * n_each]
    # Mix the views of each window of shards.
    mix = np.random.default_rng((seed, epoch, part + 1))
    starts = np.nonzero(np.diff(part_line[:, 0], prepend=-1))[0][::_WINDOW]
    groups = np.split(part_line, starts[1:])
    return np.concatenate([group[mix.permutation(len(group))] for group in groups])


def whole_order(counts: Sequence[int], *, part: int = 0, n_parts: int = 1) -> NDArray[np.intp]:
    """(n, 2) shard and position of the views of one reader in stored order; no view is dropped."""
    line = np.concatenate([_places(shard, n) for shard, n in enumerate(counts)])
    first, last = (k * len(line) // n_parts for k in (part, part + 1))
    return line[first:last]


def view_order(
    n_views: int, *, seed: int, epoch: int, part: int = 0, n_parts: int = 1
) -> NDArray[np.intp]:
    """(n,) shuffled indices of one rank of n_parts in one epoch; all ranks have equally many."""
    if n_views < n_parts:
        raise BadInput("views", "", f"{n_views} views for {n_parts} ranks", hint="use fewer")
    order = np.random.default_rng((seed, epoch)).permutation(n_views)
    return order[: n_views // n_parts * n_parts][part::n_parts]


def _places(shard: int, n_views: int) -> NDArray[np.intp]:
    return np.stack([np.full(n_views, shard, np.intp), np.arange(n_views)], axis=1)
