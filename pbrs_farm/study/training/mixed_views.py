"""Views with a share of each batch from photographs, by step and seed only, so that a run can resume."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import floor

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.study.training.training_views import BatchOrder, BatchRead, TrainingViews, ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan


@dataclass(frozen=True, slots=True, eq=False)
class MixedViews(TrainingViews):
    """Views with sets of photographs, each with its share of a batch; the rest is as of the views alone."""

    views: TrainingViews
    photographs: tuple[tuple[ViewArrays, float], ...]
    ids: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", self.views.ids)

    def digest(self) -> str:
        """First 16 hex digits of the sha256 over the digests of the sets and their shares."""
        parts = [self.views.digest()]
        parts += [f"{photographs.digest()} {share}" for photographs, share in self.photographs]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]

    def some(self, most: int) -> TrainingViews:
        return self.views.some(most)

    def decoded(self, most: int) -> ViewArrays:
        return self.views.decoded(most)

    def order(self, batch: int, seed: int) -> BatchOrder:
        return self.views.order(batch, seed)

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        return self.views.read(rows)

    def batches(
        self, steps: range, plan: TrainingPlan, seed: int, rows: slice
    ) -> Iterator[BatchRead]:
        """The batch of each step, photographs first; rows: those of this process."""
        sets = [*(photographs for photographs, _ in self.photographs), self.views]
        orders = [views.order(plan.batch, seed + 1 + k) for k, views in enumerate(sets[:-1])]
        orders.append(self.views.order(plan.batch, seed))
        reads = [
            views.read(self._rows_of_set(k, steps, order, plan, rows))
            for k, (views, order) in enumerate(zip(sets, orders, strict=True))
        ]
        for step in steps:
            counts = [len(part) for part in self._parts(step, plan, rows)]
            yield _joined([next(read) for read, n in zip(reads, counts, strict=True) if n])

    def _rows_of_set(
        self, k: int, steps: range, order: BatchOrder, plan: TrainingPlan, rows: slice
    ) -> Iterator[NDArray[np.intp]]:
        """Indices into the k-th set, for the steps that have any."""
        for step in steps:
            part = self._parts(step, plan, rows)[k]
            if len(part):
                first, end = (self._taken(s, plan.batch)[k] for s in (step, step + 1))
                yield order.between(first, end)[part]

    def _parts(self, step: int, plan: TrainingPlan, rows: slice) -> list[NDArray[np.intp]]:
        """The rows of this process within each set's share of the batch."""
        before, after = self._taken(step, plan.batch), self._taken(step + 1, plan.batch)
        counts = [b - a for a, b in zip(before, after, strict=True)]
        of_set = np.repeat(np.arange(len(counts)), counts)[rows]
        positions = np.concatenate([np.arange(n) for n in counts])[rows]
        return [positions[of_set == k] for k in range(len(counts))]

    def _taken(self, step: int, batch: int) -> list[int]:
        """Number of items of each set in the steps before this one; shares hold in the long run."""
        # The small term keeps .2 of five rows at one, whatever the rounding.
        of_photographs = [floor(step * batch * share + 1e-9) for _, share in self.photographs]
        return [*of_photographs, step * batch - sum(of_photographs)]


def _joined(reads: Sequence[BatchRead]) -> BatchRead:
    """The rows of several reads as one batch."""
    ids = [id for part, _ in reads for id in part]
    names = reads[-1][1]
    return ids, {name: np.concatenate([arrays[name] for _, arrays in reads]) for name in names}
