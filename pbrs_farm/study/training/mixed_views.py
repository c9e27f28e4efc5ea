"""Views that train with a share of each batch from photographs; no effects of its own.

Which views and which photographs a step takes is a function of the step and the seed alone, as
without a mixture: a killed run goes on to the same weights.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.study.training.training_views import BatchOrder, BatchRead, TrainingViews, ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan


@dataclass(frozen=True, slots=True, eq=False)
class MixedViews:
    """Views, and sets of photographs with the share of each batch that they have."""

    views: TrainingViews
    photographs: tuple[tuple[ViewArrays, float], ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """Of the views."""
        return self.views.ids

    @property
    def homes(self) -> tuple[str, ...]:
        """Of the views."""
        return self.views.homes

    def __len__(self) -> int:
        return len(self.views)

    def digest(self) -> str:
        """First 16 hex of the sha256 over the sets' own and their shares."""
        parts = [self.views.digest()]
        parts += [f"{photographs.digest()} {share}" for photographs, share in self.photographs]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]

    def some(self, most: int) -> TrainingViews:
        """At most so many views, without photographs."""
        return self.views.some(most)

    def decoded(self, most: int) -> ViewArrays:
        """At most so many views in memory, without photographs."""
        return self.views.decoded(most)

    def order(self, batch: int, seed: int) -> BatchOrder:
        """That of the views alone."""
        return self.views.order(batch, seed)

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        """Views alone."""
        return self.views.read(rows)

    def batches(
        self, steps: range, plan: TrainingPlan, seed: int, own: slice
    ) -> Iterator[BatchRead]:
        """The batch of each step, photographs first; own: which rows of it."""
        sets = [*(photographs for photographs, _ in self.photographs), self.views]
        orders = [one.order(plan.batch, seed + 1 + k) for k, one in enumerate(sets[:-1])]
        orders.append(self.views.order(plan.batch, seed))
        # A set is asked for the steps that take something of it, in their order.
        reads = [
            one.read(self._own_rows(steps, order, plan, own, k))
            for k, (one, order) in enumerate(zip(sets, orders, strict=True))
        ]
        for step in steps:
            n_own = [len(part) for part in self._parts(step, plan, own)]
            yield _joined([next(read) for read, n in zip(reads, n_own, strict=True) if n])

    def _own_rows(
        self, steps: range, order: BatchOrder, plan: TrainingPlan, own: slice, k: int
    ) -> Iterator[NDArray[np.intp]]:
        for step in steps:
            part = self._parts(step, plan, own)[k]
            if len(part):
                first = self._taken(step, plan.batch)[k]
                rows = order.between(first, self._taken(step + 1, plan.batch)[k])
                yield rows[part]

    def _parts(self, step: int, plan: TrainingPlan, own: slice) -> list[NDArray[np.intp]]:
        """Which of each set's rows of a step this process has, by their place among the set's."""
        before, after = self._taken(step, plan.batch), self._taken(step + 1, plan.batch)
        counts = [b - a for a, b in zip(before, after, strict=True)]
        of_set = np.repeat(np.arange(len(counts)), counts)[own]
        at = np.concatenate([np.arange(n) for n in counts])[own]
        return [at[of_set == k] for k in range(len(counts))]

    def _taken(self, step: int, batch: int) -> list[int]:
        """How many of each set the steps before this one have taken: shares hold over many steps."""
        # A little is added, so that .2 of five rows is one, whatever its last bit says.
        of_photographs = [floor(step * batch * share + 1e-9) for _, share in self.photographs]
        return [*of_photographs, step * batch - sum(of_photographs)]


def _joined(reads: Sequence[BatchRead]) -> BatchRead:
    """The rows of several reads as one batch."""
    ids = [at for own, _ in reads for at in own]
    return ids, {
        name: np.concatenate([arrays[name] for _, arrays in reads]) for name in reads[-1][1]
    }
