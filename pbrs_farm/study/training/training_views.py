"""What the training loop asks of its views, wherever they are, and in which order steps take them; no effects."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

BatchRead = tuple[list[str], dict[str, NDArray[Any]]]  # ids, arrays (B, ...) by name
CAMERA: Final = "camera"
"""Of a view's arrays: fx, fy, cx, cy at the plan's size, of a plan with `rays`."""
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

    def batches(
        self, steps: range, plan: TrainingPlan, seed: int, own: slice
    ) -> Iterator[BatchRead]:
        """The batch of each step; own: which rows of it."""
        ...

    def order(self, batch: int, seed: int) -> BatchOrder:
        """Which views each step takes."""
        ...

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        """Some views, by number, and the next some; none of them are empty."""
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
        return self.between(step * self._batch, (step + 1) * self._batch)

    def between(self, first: int, end: int) -> NDArray[np.intp]:
        """(end - first,) numbers of the views taken so far into the run, steps of any size."""
        at = np.arange(first, end)
        rounds = at // self._n_views
        rows = np.empty(len(at), np.intp)
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


@dataclass(frozen=True, slots=True, eq=False)
class ViewArrays:
    """Colour and targets of N views, each array (N, H, W, ...)."""

    ids: tuple[str, ...]  # <house>/<view>
    colour: NDArray[np.uint8]  # (N, H, W, 3) sRGB
    targets: Arrays

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def homes(self) -> tuple[str, ...]:
        """The houses there are views of."""
        return tuple(dict.fromkeys(at.partition("/")[0] for at in self.ids))

    def rows(self, at: NDArray[np.intp]) -> Arrays:
        """The arrays of some views, by name; colour among them."""
        return {"colour": self.colour[at]} | {k: v[at] for k, v in self.targets.items()}

    @property
    def cameras(self) -> F32 | None:
        """(N, 4) fx, fy, cx, cy of each view, where the plan is told rays."""
        return self.targets.get(CAMERA)

    def target(self, at: int) -> Arrays:
        """The targets of one view."""
        return {name: array[at] for name, array in self.targets.items()}

    def some(self, most: int) -> ViewArrays:
        """At most so many views, spread over all."""
        if len(self) <= most:
            return self
        at = np.linspace(0, len(self) - 1, most).round().astype(np.intp)
        rows = self.rows(at)
        colour = rows.pop("colour")
        return ViewArrays(tuple(self.ids[k] for k in at), colour, rows)

    def decoded(self, most: int) -> ViewArrays:
        """The same: they are in memory."""
        return self.some(most)

    def batches(
        self, steps: range, plan: TrainingPlan, seed: int, own: slice
    ) -> Iterator[BatchRead]:
        """The batch of each step; own: which rows of it."""
        order = self.order(plan.batch, seed)
        return self.read(order.rows(step)[own] for step in steps)

    def order(self, batch: int, seed: int) -> BatchOrder:
        """Which views each step takes."""
        return BatchOrder(len(self), batch, seed)

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        """Some views, by number, and the next some."""
        return (([self.ids[k] for k in some], self.rows(some)) for some in rows)

    def digest(self) -> str:
        """First 16 hex of the sha256 over the ids and the pixels: what a run goes on with."""
        sha = hashlib.sha256("\n".join(self.ids).encode())
        for array in (self.colour, *self.targets.values()):
            sha.update(np.ascontiguousarray(array).view(np.uint8).data)
        return sha.hexdigest()[:16]


def joined(parts: Sequence[ViewArrays]) -> ViewArrays:
    """The views of one or more sets of one task and size, one after the other."""
    if len(parts) == 1:
        return parts[0]
    targets = {
        name: np.concatenate([one.targets[name] for one in parts]) for name in parts[0].targets
    }
    ids = tuple(at for one in parts for at in one.ids)
    return ViewArrays(ids, np.concatenate([one.colour for one in parts]), targets)


def arrays_of_samples(samples: Iterable[Sample], task: StudyTask, plan: TrainingPlan) -> ViewArrays:
    """Decode samples of one size; BadInput names the view that cannot be trained on."""
    ids: list[str] = []
    stacked: dict[str, list[NDArray[Any]]] = {}
    for sample in samples:
        ids.append(sample.id)
        for name, array in arrays_of_sample(sample, task, plan).items():
            stacked.setdefault(name, []).append(array)
    if not ids:
        raise BadInput("views", "", "no view to train on")
    # Let go of each list as soon as it is one array.
    arrays = {name: np.stack(stacked.pop(name)) for name in list(stacked)}
    return ViewArrays(tuple(ids), arrays.pop("colour"), arrays)


def arrays_of_sample(sample: Sample, task: StudyTask, plan: TrainingPlan) -> Arrays:
    """Colour and targets of one view, by name; BadInput where it cannot be trained on."""
    if sample.colour is None or sample.size != (plan.width_px, plan.height_px):
        size = f"{plan.width_px}x{plan.height_px}"
        raise BadInput(sample.id, "colour", f"expected {size} pixels, got {sample.size}")
    camera = {CAMERA: camera_numbers(sample.K)} if plan.rays else {}
    return {"colour": sample.colour, **task.targets(sample, plan), **camera}


def camera_numbers(K: NDArray[Any]) -> F32:
    """(4,) fx, fy, cx, cy of a matrix (3, 3)."""
    return np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], np.float32)
