"""Views read anew for each step, where all would not fit into memory. Effects: reads views."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset

from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_views import (
    BatchOrder,
    BatchRead,
    ViewArrays,
    arrays_of_sample,
    arrays_of_samples,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.shard_set import ShardSet
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Frame

Picture = tuple[Frame, SampleRequest]  # a view in one light


@dataclass(frozen=True, slots=True, eq=False)
class StreamedViews:
    """Training views by name alone; plan.workers processes read them ahead of the steps.

    Views of shards come in an order that needs few shards at a time, so that these may lie in S3;
    it is the same for every number of workers and processes.
    """

    pictures: tuple[Picture, ...]
    plan: TrainingPlan

    @property
    def ids(self) -> tuple[str, ...]:
        """<house>/<view> of each."""
        return tuple(view.id for view, _ in self.pictures)

    @property
    def homes(self) -> tuple[str, ...]:
        """The houses there are views of."""
        return tuple(dict.fromkeys(view.ref.house for view, _ in self.pictures))

    def __len__(self) -> int:
        return len(self.pictures)

    def digest(self) -> str:
        """First 16 hex of the sha256 over names, lights and shards: pixels are not looked at."""
        sha = hashlib.sha256(b"streamed")
        for view, request in self.pictures:
            sha.update(f"\n{view.id} {request.mode}".encode())
        for source in {id(view.source): view.source for view, _ in self.pictures}.values():
            if isinstance(source, ShardSet):
                sha.update("".join(shard.sha256 for shard in source.dataset.shards).encode())
        return sha.hexdigest()[:16]

    def some(self, most: int) -> StreamedViews:
        """At most so many, spread over all."""
        if len(self) <= most:
            return self
        at = np.linspace(0, len(self) - 1, most).round().astype(np.intp)
        return StreamedViews(tuple(self.pictures[k] for k in at), self.plan)

    def decoded(self, most: int) -> ViewArrays:
        """At most so many, spread over all, in memory."""
        samples = (view.sample(request) for view, request in self.some(most).pictures)
        return arrays_of_samples(samples, task_of(self.plan.task), self.plan)

    def batches(
        self, steps: range, plan: TrainingPlan, seed: int, own: slice
    ) -> Iterator[BatchRead]:
        """The batch of each step; own: which rows of it."""
        order = self.order(plan.batch, seed)
        return self.read(order.rows(step)[own] for step in steps)

    def order(self, batch: int, seed: int) -> BatchOrder:
        """Which views each step takes; of shards few at a time."""
        return BatchOrder(len(self), batch, seed, self._shards())

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        """Some views, by number, and the next some, read ahead by the plan's workers."""
        numbers = (some.tolist() for some in rows)
        options: dict[str, Any] = {"num_workers": self.plan.workers}
        if self.plan.workers and any(
            view.source.url.startswith("s3:") for view, _ in self.pictures
        ):
            # S3's client does not survive a fork.
            options["multiprocessing_context"] = "spawn"
        loader = DataLoader(
            _Pictures(self), batch_sampler=_Rows(numbers), collate_fn=_stacked, **options
        )
        for ids, tensors in loader:
            yield ids, {name: tensor.numpy() for name, tensor in tensors.items()}

    def _shards(self) -> NDArray[np.intp] | None:
        """(n,) the shard of each view; None where not all lie in shards."""
        numbers: dict[tuple[str, str], int] = {}
        groups = []
        for view, _ in self.pictures:
            if not isinstance(view.source, ShardSet):
                return None
            key = view.source.url, view.source.shard_of(view.ref).file
            groups.append(numbers.setdefault(key, len(numbers)))
        return np.array(groups, np.intp)


class _Pictures(Dataset):  # type: ignore[misc]
    """Colour and targets by number, for the processes that read."""

    def __init__(self, views: StreamedViews) -> None:
        self._views = views

    def __getitem__(self, at: int) -> tuple[str, Arrays]:
        view, request = self._views.pictures[at]
        plan = self._views.plan
        sample = view.sample(request)
        return sample.id, arrays_of_sample(sample, task_of(plan.task), plan)


class _Rows:
    """Rows of steps, taken once."""

    def __init__(self, rows: Iterator[list[int]]) -> None:
        self._rows = rows

    def __iter__(self) -> Iterator[list[int]]:
        return self._rows


def _stacked(samples: list[tuple[str, Arrays]]) -> tuple[list[str], dict[str, torch.Tensor]]:
    # Tensors go from a process to another through shared memory, arrays through a pipe.
    names = samples[0][1]
    stacked = {n: torch.from_numpy(np.stack([arrays[n] for _, arrays in samples])) for n in names}
    return [at for at, _ in samples], stacked
