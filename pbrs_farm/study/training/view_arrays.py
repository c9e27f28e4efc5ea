"""Views decoded once and held in memory at a plan's size; numpy.

Effects: reads views. 1,000 views take 192 MB for normals at 160x120, 768 MB at 320x240.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.reading.view_sample import Sample
from pbrs_farm.study.tasks.study_task import Arrays, Task
from pbrs_farm.study.training.training_views import BatchOrder, BatchRead
from pbrs_farm.study.training_plan import Plan


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

    def batches(self, steps: range, plan: Plan, seed: int, own: slice) -> Iterator[BatchRead]:
        """The batch of each step; own: which rows of it."""
        order = BatchOrder(len(self), plan.batch, seed)
        for step in steps:
            rows = order.rows(step)[own]
            yield [self.ids[k] for k in rows], self.rows(rows)

    def digest(self) -> str:
        """First 16 hex of the sha256 over the ids and the pixels: what a run goes on with."""
        sha = hashlib.sha256("\n".join(self.ids).encode())
        for array in (self.colour, *self.targets.values()):
            sha.update(np.ascontiguousarray(array).view(np.uint8).data)
        return sha.hexdigest()[:16]


def arrays_of_samples(samples: Iterable[Sample], task: Task, plan: Plan) -> ViewArrays:
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


def arrays_of_sample(sample: Sample, task: Task, plan: Plan) -> Arrays:
    """Colour and targets of one view, by name; BadInput where it cannot be trained on."""
    if sample.colour is None or sample.size != (plan.width_px, plan.height_px):
        size = f"{plan.width_px}x{plan.height_px}"
        raise BadInput(sample.id, "colour", f"expected {size} pixels, got {sample.size}")
    return {"colour": sample.colour, **task.targets(sample, plan)}
