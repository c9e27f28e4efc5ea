"""A torch IterableDataset of packed shards. Effects: reads the shards."""

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

    Ranks and workers divide the shards: each view comes once per epoch, and all parts are equally
    long (at most one view per part is dropped, another one each epoch). The order depends on seed,
    epoch and the number of parts. shuffle False: every view in the order of the shards, none dropped.
    transform: as in StoredViews; its random numbers depend on seed, epoch, shard and the position.
    Raises BadInput if shards are missing, truncated or without a requested layer.
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
        self.chosen = self.shards.shards_of(split)
        self.shuffle = shuffle
        self.seed = seed
        self.transform = transform
        self.rank, self.world = rank, world
        self.epoch = 0
        self.n_skipped = 0  # batches of this epoch before the start
        self.batch_size = 1

    @property
    def n_views(self) -> int:
        """Number of views of all ranks together."""
        return sum(shard.n_views for shard in self.chosen)

    def start_at(self, epoch: int, n_batches: int = 0, batch_size: int = 1) -> None:
        """Start in an epoch after n_batches of a DataLoader with batch_size and the same workers."""
        self.epoch, self.n_skipped, self.batch_size = epoch, n_batches, batch_size

    def samples(self) -> Iterator[Sample]:
        """Transformed views of this worker, or of the whole rank outside of a DataLoader."""
        info = get_worker_info()
        number, n_workers = (info.id, info.num_workers) if info is not None else (0, 1)
        # A DataLoader takes one batch of each worker in turn and starts with its first worker.
        worker = (number + self.n_skipped) % n_workers
        counts = [shard.n_views for shard in self.chosen]
        parts = {"part": self.rank * n_workers + worker, "n_parts": self.world * n_workers}
        if self.shuffle:
            order = shard_order(counts, seed=self.seed, epoch=self.epoch, **parts)
        else:
            order = whole_order(counts, **parts)
        n_read = (self.n_skipped - worker + n_workers - 1) // n_workers * self.batch_size
        for shard, position in order[max(n_read, 0) :].tolist():
            sample = self.shards.read_at(self.chosen[shard], position, self.request)
            if self.transform is not None:
                rng = np.random.default_rng((self.seed, self.epoch, shard, position))
                sample = self.transform(sample, rng)
            yield sample

    def __iter__(self) -> Iterator[Tensors]:
        return map(tensors_of_sample, self.samples())
