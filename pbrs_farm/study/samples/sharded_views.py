"""A torch IterableDataset of packed shards, with torch and numpy alone. Effects: reads the shards."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from torch.utils.data import IterableDataset, get_worker_info

from pbrs_farm.store import Store, store_from_url
from pbrs_farm.study.samples.stored_views import Tensors, Transform, tensors_of_sample
from pbrs_farm.study.samples.view_order import shard_order, whole_order
from pbrs_farm.views.shard_set import ShardSet
from pbrs_farm.views.view_sample import Sample, SampleRequest


class ShardedViews(IterableDataset):  # type: ignore[misc]
    """The views of a split's shards, as dictionaries of tensors (view_loader.py).

    Ranks and workers part the shards: in an epoch each view comes once, and all parts have equally
    many (at most one view a part is left out, others each epoch). The order follows from seed,
    epoch and the number of parts. shuffle False: in the shards' order, every view, none left out.
    transform: as StoredViews has it, by seed, epoch, shard and the view's place in it.
    Raises BadInput where shards are missing, truncated, or do not hold what request asks for.
    """

    def __init__(
        self,
        place: str | Path | Store,
        request: SampleRequest | None = None,
        *,
        split: str | None = None,
        shuffle: bool = True,
        seed: int = 0,
        transform: Transform | None = None,
        rank: int = 0,
        world: int = 1,
    ) -> None:
        self.request = request or SampleRequest()
        store = place if not isinstance(place, str | Path) else store_from_url(str(place))
        self.shards = ShardSet(store)
        self.shards.check(self.request)
        self.own = self.shards.shards_of(split)
        self.shuffle = shuffle
        self.seed = seed
        self.transform = transform
        self.rank, self.world = rank, world
        self.epoch = 0
        self.n_skipped = 0  # batches of this epoch that were read before
        self.batch_size = 1

    @property
    def n_views(self) -> int:
        """The views of all ranks together."""
        return sum(shard.n_views for shard in self.own)

    def start_at(self, epoch: int, n_batches: int = 0, batch_size: int = 1) -> None:
        """Begin with that epoch, behind the batches of it that were read before.

        n_batches: those that a DataLoader of batch_size and as many workers as now handed over.
        """
        self.epoch, self.n_skipped, self.batch_size = epoch, n_batches, batch_size

    def samples(self) -> Iterator[Sample]:
        """This worker's views as arrays, transformed; of the whole rank outside of a DataLoader."""
        info = get_worker_info()
        number, n_workers = (info.id, info.num_workers) if info is not None else (0, 1)
        # A DataLoader takes a batch of each worker in turn: its first goes on where the turn was.
        worker = (number + self.n_skipped) % n_workers
        counts = [shard.n_views for shard in self.own]
        parts = {"part": self.rank * n_workers + worker, "n_parts": self.world * n_workers}
        if self.shuffle:
            order = shard_order(counts, seed=self.seed, epoch=self.epoch, **parts)
        else:
            order = whole_order(counts, **parts)
        n_read = (self.n_skipped - worker + n_workers - 1) // n_workers * self.batch_size
        for shard, at in order[max(n_read, 0) :].tolist():
            sample = self.shards.read_at(self.own[shard], at, self.request)
            if self.transform is not None:
                rng = np.random.default_rng((self.seed, self.epoch, shard, at))
                sample = self.transform(sample, rng)
            yield sample

    def __iter__(self) -> Iterator[Tensors]:
        return map(tensors_of_sample, self.samples())
