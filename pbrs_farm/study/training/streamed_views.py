"""Views decoded for each step, for sets that do not fit into memory. Effects: reads views."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset

from pbrs_farm.study.samples.view_loader import options_of_workers
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_views import (
    BatchOrder,
    BatchRead,
    TrainingViews,
    ViewArrays,
    arrays_of_sample,
    arrays_of_samples,
    evenly_spaced,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.shard_set import ShardSet
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Frame

Picture = tuple[Frame, SampleRequest]  # a view in one light


@dataclass(frozen=True, slots=True, eq=False)
class StreamedViews(TrainingViews):
    """Training views by reference, read ahead by plan.workers in the same order, few shards at a time."""

    pictures: tuple[Picture, ...]
    plan: TrainingPlan
    ids: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", tuple(view.id for view, _ in self.pictures))

    def digest(self) -> str:
        """First 16 hex digits of the sha256 over ids, lights and shards, without pixels."""
        sha = hashlib.sha256(b"streamed")
        for view, request in self.pictures:
            sha.update(f"\n{view.id} {request.mode}".encode())
        for source in {id(view.source): view.source for view, _ in self.pictures}.values():
            if isinstance(source, ShardSet):
                sha.update("".join(shard.sha256 for shard in source.dataset.shards).encode())
        return sha.hexdigest()[:16]

    def some(self, most: int) -> StreamedViews:
        return StreamedViews(tuple(evenly_spaced(self.pictures, most)), self.plan)

    def decoded(self, most: int) -> ViewArrays:
        samples = (view.sample(request) for view, request in self.some(most).pictures)
        return arrays_of_samples(samples, task_of(self.plan.task), self.plan)

    def order(self, batch: int, seed: int) -> BatchOrder:
        return BatchOrder(len(self), batch, seed, self._shards())

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        indices = (row.tolist() for row in rows)
        urls = {view.source.url for view, _ in self.pictures}
        options = options_of_workers(self.plan.workers, urls)
        loader = DataLoader(
            _Pictures(self), batch_sampler=_Once(indices), collate_fn=_stacked, **options
        )
        for ids, tensors in loader:
            yield ids, {name: tensor.numpy() for name, tensor in tensors.items()}

    def _shards(self) -> NDArray[np.intp] | None:
        """(n,) shard of each view; None unless all views are in shards."""
        numbers: dict[tuple[str, str], int] = {}
        groups = []
        for view, _ in self.pictures:
            if not isinstance(view.source, ShardSet):
                return None
            key = view.source.url, view.source.shard_of(view.ref).file
            groups.append(numbers.setdefault(key, len(numbers)))
        return np.array(groups, np.intp)


class _Pictures(Dataset):  # type: ignore[misc]
    """Colour and targets by index, for the worker processes."""

    def __init__(self, views: StreamedViews) -> None:
        self._views = views

    def __getitem__(self, index: int) -> tuple[str, Arrays]:
        view, request = self._views.pictures[index]
        plan = self._views.plan
        sample = view.sample(request)
        return sample.id, arrays_of_sample(sample, task_of(plan.task), plan)


class _Once:
    """An iterator of batches as a batch sampler."""

    def __init__(self, batches: Iterator[list[int]]) -> None:
        self._batches = batches

    def __iter__(self) -> Iterator[list[int]]:
        return self._batches


def _stacked(samples: list[tuple[str, Arrays]]) -> tuple[list[str], dict[str, Any]]:
    # Processes share tensors through memory, but send arrays through a pipe.
    names = samples[0][1]
    stacks = {n: torch.from_numpy(np.stack([arrays[n] for _, arrays in samples])) for n in names}
    return [id for id, _ in samples], stacks
