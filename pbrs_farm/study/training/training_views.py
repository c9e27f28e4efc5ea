"""The views of a training, in memory or streamed, and their order over the steps."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.view_sample import Sample

T = TypeVar("T")
BatchRead = tuple[list[str], dict[str, NDArray[Any]]]  # ids, arrays (B, ...) by name
CAMERA: Final = "camera"
"""Name of the array fx, fy, cx, cy at the plan's size, in plans with `rays`."""
_WINDOW: Final = 4  # number of consecutive shards whose views are mixed


def evenly_spaced(items: Sequence[T], most: int) -> list[T]:
    """At most so many items at equal distances, the first and the last among them; most 0 = all."""
    if not most or len(items) <= most:
        return list(items)
    return [items[k] for k in np.linspace(0, len(items) - 1, most).round().astype(int)]


class BatchOrder:
    """The views of each step: all views in a random order, drawn anew for each round.

    The rows depend on the step and the arguments only, so that a killed run resumes with the same
    views. groups (n_views,): the shard of each view; then the views of four shards at a time are
    mixed, so that a reader needs few of them.
    """

    def __init__(
        self, n_views: int, batch: int, seed: int, groups: NDArray[np.intp] | None = None
    ) -> None:
        self._n_views, self._batch, self._seed, self._groups = n_views, batch, seed, groups
        self._round, self._order = -1, np.empty(0, np.intp)

    def rows(self, step: int) -> NDArray[np.intp]:
        """(batch,) indices of views."""
        return self.between(step * self._batch, (step + 1) * self._batch)

    def between(self, first: int, end: int) -> NDArray[np.intp]:
        """(end - first,) indices of the first-th to the end-th view since the start of the run."""
        positions = np.arange(first, end)
        rounds = positions // self._n_views
        rows = np.empty(len(positions), np.intp)
        for k in np.unique(rounds):
            in_round = rounds == k
            rows[in_round] = self._order_of(int(k))[positions[in_round] % self._n_views]
        return rows

    def _order_of(self, number: int) -> NDArray[np.intp]:
        if number != self._round:
            self._round, self._order = number, self._drawn(number)
        return self._order

    def _drawn(self, number: int) -> NDArray[np.intp]:
        dice = np.random.default_rng([self._seed, 1, number])
        if self._groups is None:
            return dice.permutation(self._n_views)
        # Shuffle the shards, then the views of each window of shards.
        n_groups = int(self._groups.max()) + 1
        window = np.empty(n_groups, np.intp)
        window[dice.permutation(n_groups)] = np.arange(n_groups) // _WINDOW
        return np.lexsort((dice.random(self._n_views), window[self._groups]))


class TrainingViews(ABC):
    """Views for training: in memory (ViewArrays), streamed (StreamedViews) or mixed with photographs."""

    ids: tuple[str, ...]
    """<house>/<view> of each view."""

    @property
    def homes(self) -> tuple[str, ...]:
        """The houses of the views, each once."""
        return tuple(dict.fromkeys(id.partition("/")[0] for id in self.ids))

    def __len__(self) -> int:
        return len(self.ids)

    @abstractmethod
    def digest(self) -> str:
        """First 16 hex digits of a sha256; a run resumes only with views of the same digest."""

    @abstractmethod
    def some(self, most: int) -> TrainingViews:
        """At most so many views, evenly spaced."""

    @abstractmethod
    def decoded(self, most: int) -> ViewArrays:
        """At most so many views, evenly spaced, in memory."""

    def order(self, batch: int, seed: int) -> BatchOrder:
        """The views of each step."""
        return BatchOrder(len(self), batch, seed)

    @abstractmethod
    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        """One batch for each array of indices, none of which is empty."""

    def batches(
        self, steps: range, plan: TrainingPlan, seed: int, rows: slice
    ) -> Iterator[BatchRead]:
        """The batch of each step; rows: those of this process."""
        order = self.order(plan.batch, seed)
        return self.read(order.rows(step)[rows] for step in steps)


@dataclass(frozen=True, slots=True, eq=False)
class ViewArrays(TrainingViews):
    """Colour and targets of N views, each array (N, H, W, ...)."""

    ids: tuple[str, ...]
    colour: NDArray[np.uint8]  # (N, H, W, 3) sRGB
    targets: Arrays

    def rows(self, indices: NDArray[np.intp]) -> Arrays:
        """The arrays of some views by name, with colour."""
        return {"colour": self.colour[indices]} | {k: v[indices] for k, v in self.targets.items()}

    @property
    def cameras(self) -> F32 | None:
        """(N, 4) fx, fy, cx, cy of each view, in plans with `rays`."""
        return self.targets.get(CAMERA)

    def all_targets(self) -> list[Arrays]:
        """The targets of each view, as views of the arrays."""
        return [
            {name: array[k] for name, array in self.targets.items()} for k in range(len(self.ids))
        ]

    def some(self, most: int) -> ViewArrays:
        if len(self) <= most:
            return self
        indices = np.array(evenly_spaced(range(len(self)), most), np.intp)
        rows = self.rows(indices)
        return ViewArrays(tuple(self.ids[k] for k in indices), rows.pop("colour"), rows)

    def decoded(self, most: int) -> ViewArrays:
        return self.some(most)

    def read(self, rows: Iterable[NDArray[np.intp]]) -> Iterator[BatchRead]:
        return (([self.ids[k] for k in indices], self.rows(indices)) for indices in rows)

    def digest(self) -> str:
        """First 16 hex digits of the sha256 over ids and pixels."""
        sha = hashlib.sha256("\n".join(self.ids).encode())
        for array in (self.colour, *self.targets.values()):
            sha.update(np.ascontiguousarray(array).view(np.uint8).data)
        return sha.hexdigest()[:16]


def joined(parts: Sequence[ViewArrays]) -> ViewArrays:
    """The views of one or more sets of one task and size."""
    if len(parts) == 1:
        return parts[0]
    targets = {
        name: np.concatenate([part.targets[name] for part in parts]) for name in parts[0].targets
    }
    ids = tuple(id for part in parts for id in part.ids)
    return ViewArrays(ids, np.concatenate([part.colour for part in parts]), targets)


def arrays_of_samples(samples: Iterable[Sample], task: StudyTask, plan: TrainingPlan) -> ViewArrays:
    """Decode samples of one size; BadInput names a view without targets."""
    ids: list[str] = []
    stacks: dict[str, list[NDArray[Any]]] = {}
    for sample in samples:
        ids.append(sample.id)
        for name, array in arrays_of_sample(sample, task, plan).items():
            stacks.setdefault(name, []).append(array)
    if not ids:
        raise BadInput("views", "", "no view to train on")
    # Free each list as soon as it is one array.
    arrays = {name: np.stack(stacks.pop(name)) for name in list(stacks)}
    return ViewArrays(tuple(ids), arrays.pop("colour"), arrays)


def arrays_of_sample(sample: Sample, task: StudyTask, plan: TrainingPlan) -> Arrays:
    """Colour and targets of one view by name; BadInput for a view without targets."""
    if sample.colour is None or sample.size != (plan.width_px, plan.height_px):
        size = f"{plan.width_px}x{plan.height_px}"
        raise BadInput(sample.id, "colour", f"expected {size} pixels, got {sample.size}")
    camera = {CAMERA: camera_numbers(sample.K)} if plan.rays else {}
    return {"colour": sample.colour, **task.targets(sample, plan), **camera}


def camera_numbers(K: NDArray[Any]) -> F32:
    """(4,) fx, fy, cx, cy of a matrix (3, 3)."""
    return np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], np.float32)
