"""What the training loop asks of its views, wherever they are, and in which order steps take them; no effects."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.study.training_plan import Plan

if TYPE_CHECKING:
    from pbrs_farm.study.training.view_arrays import ViewArrays

BatchRead = tuple[list[str], dict[str, NDArray[Any]]]  # ids, arrays (B, ...) by name
_WINDOW: Final = 4  # shards whose views are mixed with one another


class TrainingViews(Protocol):
    """Views that train, in memory (ViewArrays) or read as they are needed (StreamedViews)."""

    @property
    def ids(self) -> tuple[str, ...]:
        """<house>/<view> of each."""
        ...

    @property
    def homes(self) -> tuple[str, ...]:
        """The houses there are views of."""
        ...

    def __len__(self) -> int: ...

    def digest(self) -> str:
        """What a run that goes on must share."""
        ...

    def some(self, most: int) -> TrainingViews:
        """At most so many, spread over all."""
        ...

    def decoded(self, most: int) -> ViewArrays:
        """At most so many, spread over all, in memory."""
        ...

    def batches(self, steps: range, plan: Plan, seed: int, own: slice) -> Iterator[BatchRead]:
        """The batch of each step; own: which rows of it."""
        ...


class BatchOrder:
    """Which views a step takes: each once in an order drawn anew each time round.

    The rows are a function of the step and of what the order was made with alone: a run that was
    killed goes on with the same views. groups (n_views,): the shard of each view; then the views of
    every four shards are mixed, so that a reader needs few of them at a time.
    """

    def __init__(
        self, n_views: int, batch: int, seed: int, groups: NDArray[np.intp] | None = None
    ) -> None:
        self._n_views, self._batch, self._seed, self._groups = n_views, batch, seed, groups
        self._round, self._order = -1, np.empty(0, np.intp)

    def rows(self, step: int) -> NDArray[np.intp]:
        """(batch,) numbers of views."""
        at = np.arange(step * self._batch, (step + 1) * self._batch)
        rounds = at // self._n_views
        rows = np.empty(self._batch, np.intp)
        for k in np.unique(rounds):
            mine = rounds == k
            rows[mine] = self._order_of(int(k))[at[mine] % self._n_views]
        return rows

    def _order_of(self, number: int) -> NDArray[np.intp]:
        if number != self._round:
            self._round, self._order = number, self._drawn(number)
        return self._order

    def _drawn(self, number: int) -> NDArray[np.intp]:
        dice = np.random.default_rng([self._seed, 1, number])
        if self._groups is None:
            return dice.permutation(self._n_views)
        # Put the shards in a row, and mix every few neighbours.
        n_groups = int(self._groups.max()) + 1
        window = np.empty(n_groups, np.intp)
        window[dice.permutation(n_groups)] = np.arange(n_groups) // _WINDOW
        return np.lexsort((dice.random(self._n_views), window[self._groups]))
