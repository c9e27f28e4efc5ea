"""Batches of views, shuffled by seed and epoch, that go on where a state says. Effects: reads views."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset, IterableDataset, get_worker_info

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.store import Store, store_from_url
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.shard_set import ShardSet
from pbrs_farm.views.view_sample import Sample, SampleRequest
from pbrs_farm.views.views import Views

# A Sample's arrays as torch tensors.


Tensors = dict[str, Any]  # name -> tensor or text


def tensors_of_sample(sample: Sample) -> Tensors:
    """Tensors by the names of Sample's arrays, and id, house, room, mode, axes as text.

    colour (3, H, W) uint8; normal (3, H, W), depth (H, W) and K (3, 3) float32; valid and boundary
    (H, W) bool; class40 (H, W) uint8; instance (H, W) int32, since torch hardly knows uint16.
    """
    names = ("id", "house", "room", "mode", "axes")
    tensors: Tensors = {name: getattr(sample, name) for name in names}
    tensors["K"] = _tensor(sample.K)
    for name, array in sample.arrays().items():
        # Channels come first, as torch's convolutions want them.
        planes = array.transpose(2, 0, 1) if array.ndim == 3 else array
        tensors[name] = _tensor(planes.astype(np.int32) if name == "instance" else planes)
    return tensors


def _tensor(array: NDArray[Any]) -> Any:
    # Copy where the array is a view of something, or may not be written to.
    is_own = array.flags.c_contiguous and array.flags.writeable
    return torch.from_numpy(array if is_own else array.copy(order="C"))


# A torch Dataset of the views of an output root or of shards, by number. Effects: reads them.


# Changes a sample by chance: (sample, its random numbers) -> sample.
Transform = Callable[[Sample, np.random.Generator], Sample]


class StoredViews(Dataset):  # type: ignore[misc]
    """Views by number as dictionaries of tensors (view_loader.py).

    place: what pbrs_farm.open takes, or Views. request: layers, mode, axes, size. Views without a
    file that request needs are left out: `views.left_out` names them. transform: of the numpy
    Sample, with random numbers that follow from seed, epoch and the view's number alone.
    Raises BadInput where no view is left.
    """

    def __init__(
        self,
        place: str | Path | Views,
        request: SampleRequest | None = None,
        *,
        split: str | None = None,
        shares: SplitShares | None = None,
        transform: Transform | None = None,
        seed: int = 0,
    ) -> None:
        self.request = request or SampleRequest()
        views = place if isinstance(place, Views) else open_views(place)
        self.views = views.only(split=split, shares=shares, request=self.request)
        self.transform = transform
        self.seed = seed
        self.epoch = 0  # set by ViewLoader

    def __len__(self) -> int:
        return len(self.views)

    def sample(self, at: int) -> Sample:
        """The view of that number as arrays, transformed."""
        sample = self.views[at].sample(self.request)
        if self.transform is None:
            return sample
        return self.transform(sample, np.random.default_rng((self.seed, self.epoch, at)))

    def __getitem__(self, at: int) -> Tensors:
        return tensors_of_sample(self.sample(at))


# In which order the views of shards are read: by seed and epoch, parted among readers.


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


# A torch IterableDataset of packed shards, with torch and numpy alone. Effects: reads the shards.


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


# Batches of views, shuffled by seed and epoch, that go on where a state says.


class ViewLoader:
    """Iterate over it once for the batches of an epoch; again for those of the next one.

    Batches are full: what is left at an epoch's end is dropped. state_dict says how many batches
    were handed over; a loader that is made alike and given that state hands over the rest of the
    epoch, the same batches as if it had never stopped. workers: processes that read; 0 for none.
    rank, world: this process' number and the number of processes of a training (DDP).
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
        self._n_batches = 0  # of this epoch, handed over
        if isinstance(dataset, ShardedViews):
            dataset.seed, dataset.rank, dataset.world = seed, rank, world
            self._n_views = dataset.n_views
        else:
            self._n_views = len(dataset)
        if len(self) < 1:
            text = f"{self._n_views} views make no batch of {batch_size}"
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
        """The epoch that the next batch is of, from 0."""
        return self._epoch

    def state_dict(self) -> dict[str, int]:
        """How far it is, and how it was made."""
        return {
            "epoch": self._epoch,
            "n_batches": self._n_batches,
            "n_views": self._n_views,
            **self._made,
        }

    def load_state_dict(self, state: dict[str, int]) -> None:
        """Go on where state says; BadInput where its loader was made otherwise or had other views."""
        for name, value in {**self._made, "n_views": self._n_views}.items():
            if state[name] != value:
                text = f"was {state[name]} when the run stopped, is {value}"
                raise BadInput("resume", name, text, hint="go on with what it began with")
        self._epoch, self._n_batches = state["epoch"], state["n_batches"]

    def __iter__(self) -> Iterator[Tensors]:
        epoch = self._epoch
        for batch in self._rest_of_epoch():
            # Count it before it is used: who has it has read it. Loops that know the length ask for
            # no batch after the last one.
            self._n_batches += 1
            if self._n_batches == len(self):
                self._epoch, self._n_batches = epoch + 1, 0
            yield batch
        self._epoch, self._n_batches = epoch + 1, 0

    def _rest_of_epoch(self) -> Any:
        dataset, made = self._dataset, self._made
        batch_size = made["batch_size"]
        options: dict[str, Any] = {"num_workers": made["workers"]}
        if made["workers"] and _is_remote(dataset):
            # S3's client does not survive a fork.
            options["multiprocessing_context"] = "spawn"
        if isinstance(dataset, ShardedViews):
            dataset.start_at(self._epoch, self._n_batches, batch_size)
            return DataLoader(dataset, batch_size=batch_size, drop_last=True, **options)
        dataset.epoch = self._epoch
        parts = {"part": self._rank, "n_parts": made["world"]}
        order = view_order(len(dataset), seed=made["seed"], epoch=self._epoch, **parts).tolist()
        starts = range(self._n_batches * batch_size, len(self) * batch_size, batch_size)
        batches = [order[k : k + batch_size] for k in starts]
        return DataLoader(dataset, batch_sampler=batches, **options)


def _is_remote(dataset: StoredViews | ShardedViews) -> bool:
    source = dataset.shards if isinstance(dataset, ShardedViews) else dataset.views.source
    return source.url.startswith("s3:")
