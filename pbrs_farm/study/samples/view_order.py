"""In which order the views of shards are read: by seed and epoch, parted among readers; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput

_WINDOW: Final = 4  # shards whose views are mixed with one another


def shard_order(
    counts: Sequence[int], *, seed: int, epoch: int, part: int = 0, n_parts: int = 1
) -> NDArray[np.intp]:
    """(n, 2) shard and place in it, of one reader of n_parts in one epoch, shuffled.

    counts: the views of each shard. All readers get equally many; at most n_parts - 1 views are
    left out, others in each epoch. A reader opens its own shards and those at its ends only, and
    the views of every 4 of them are mixed. Raises BadInput for fewer views than readers.
    """
    total = sum(counts)
    if total < n_parts:
        raise BadInput(
            "shards", "", f"{total} views for {n_parts} readers", hint="use fewer workers"
        )
    # Lay the shards one after the other, in an order of the epoch's, and start anywhere.
    rng = np.random.default_rng((seed, epoch))
    shards = rng.permutation(len(counts))
    line = np.concatenate([_places(int(s), counts[s]) for s in shards])
    line = np.roll(line, -int(rng.integers(total)), axis=0)
    n_each = total // n_parts
    own = line[part * n_each : (part + 1) * n_each]
    # Mix every few shards, in an order of the reader's.
    mix = np.random.default_rng((seed, epoch, part + 1))
    starts = np.nonzero(np.diff(own[:, 0], prepend=-1))[0][::_WINDOW]
    groups = np.split(own, starts[1:])
    return np.concatenate([group[mix.permutation(len(group))] for group in groups])


def whole_order(counts: Sequence[int], *, part: int = 0, n_parts: int = 1) -> NDArray[np.intp]:
    """(n, 2) shard and place of one reader, in the shards' order: every view once, none left out."""
    line = np.concatenate([_places(shard, n) for shard, n in enumerate(counts)])
    first, last = (k * len(line) // n_parts for k in (part, part + 1))
    return line[first:last]


def view_order(
    n_views: int, *, seed: int, epoch: int, part: int = 0, n_parts: int = 1
) -> NDArray[np.intp]:
    """(n,) places of one rank of n_parts in one epoch, shuffled; all ranks get equally many."""
    if n_views < n_parts:
        raise BadInput("views", "", f"{n_views} views for {n_parts} ranks", hint="use fewer")
    order = np.random.default_rng((seed, epoch)).permutation(n_views)
    return order[: n_views // n_parts * n_parts][part::n_parts]


def _places(shard: int, n_views: int) -> NDArray[np.intp]:
    places = np.empty((n_views, 2), np.intp)
    places[:, 0] = shard
    places[:, 1] = np.arange(n_views)
    return places
