"""Batches of views, shuffled by seed and epoch, with a state to resume from. Effects: reads views."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from torch.utils.data import DataLoader

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.samples.sharded_views import ShardedViews
from pbrs_farm.study.samples.stored_views import StoredViews, Tensors
from pbrs_farm.study.samples.view_order import view_order


class ViewLoader:
    """Each iteration yields the batches of one epoch.

    Batches are full: the rest of an epoch is dropped. state_dict counts the batches so far; a loader
    with the same arguments and that state yields the rest of the epoch, the same batches as without
    the stop. workers: reading processes; 0 for none. rank, world: number of this process and of all
    processes of a training (DDP).
    """

    def __init__(
        self,
        dataset: StoredViews | ShardedViews,
        batch_size: int,
        *,
        workers: int = 0,
        seed: int = 0,
        rank: int = 0,
        world: int = 1,
    ) -> None:
        self._dataset = dataset
        self._made = {"batch_size": batch_size, "workers": workers, "seed": seed, "world": world}
        self._rank = rank
        self._epoch = 0
        self._n_batches = 0  # of this epoch so far
        if isinstance(dataset, ShardedViews):
            dataset.seed, dataset.rank, dataset.world = seed, rank, world
            self._n_views = dataset.n_views
        else:
            self._n_views = len(dataset)
        if len(self) < 1:
            text = f"{self._n_views} views are too few for a batch of {batch_size}"
            raise BadInput("batch size", "", text, hint=f"{world} ranks, {max(workers, 1)} workers")

    def __len__(self) -> int:
        """Batches of a whole epoch."""
        batch_size, workers = self._made["batch_size"], max(self._made["workers"], 1)
        if isinstance(self._dataset, ShardedViews):
            n_parts = workers * self._made["world"]
            return self._n_views // n_parts // batch_size * workers
        return int(self._n_views // self._made["world"] // batch_size)

    @property
    def epoch(self) -> int:
        """Epoch of the next batch, from 0."""
        return self._epoch

    def state_dict(self) -> dict[str, int]:
        """Position and arguments."""
        return {
            "epoch": self._epoch,
            "n_batches": self._n_batches,
            "n_views": self._n_views,
            **self._made,
        }

    def load_state_dict(self, state: dict[str, int]) -> None:
        """Resume from a state; BadInput if its loader had other arguments or other views."""
        for name, value in {**self._made, "n_views": self._n_views}.items():
            if state[name] != value:
                text = f"was {state[name]} when the run stopped, is {value}"
                raise BadInput("resume", name, text, hint="resume with the options of its start")
        self._epoch, self._n_batches = state["epoch"], state["n_batches"]

    def __iter__(self) -> Iterator[Tensors]:
        epoch = self._epoch
        for batch in self._rest_of_epoch():
            # Count the batch before it is used. Loops that know the length never ask for a batch
            # after the last one.
            self._n_batches += 1
            if self._n_batches == len(self):
                self._epoch, self._n_batches = epoch + 1, 0
            yield batch
        self._epoch, self._n_batches = epoch + 1, 0

    def _rest_of_epoch(self) -> Any:
        dataset, fields = self._dataset, self._made
        batch_size = fields["batch_size"]
        source = dataset.shards if isinstance(dataset, ShardedViews) else dataset.views.source
        options = options_of_workers(fields["workers"], [source.url])
        if isinstance(dataset, ShardedViews):
            dataset.start_at(self._epoch, self._n_batches, batch_size)
            return DataLoader(dataset, batch_size=batch_size, drop_last=True, **options)
        dataset.epoch = self._epoch
        parts = {"part": self._rank, "n_parts": fields["world"]}
        order = view_order(len(dataset), seed=fields["seed"], epoch=self._epoch, **parts).tolist()
        starts = range(self._n_batches * batch_size, len(self) * batch_size, batch_size)
        batches = [order[k : k + batch_size] for k in starts]
        return DataLoader(dataset, batch_sampler=batches, **options)


def options_of_workers(workers: int, urls: Iterable[str]) -> dict[str, Any]:
    """Options of a DataLoader for reading with some processes from these stores."""
    options: dict[str, Any] = {"num_workers": workers}
    if workers and any(url.startswith("s3:") for url in urls):
        # S3's client does not survive a fork.
        options["multiprocessing_context"] = "spawn"
    return options
