"""From roots or shards to the views of a plan: which homes train and which are held out. Effects: reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of
from pbrs_farm.study.tasks.study_task import Arrays
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_views import (
    BatchOrder,
    BatchRead,
    TrainingViews,
    ViewArrays,
    arrays_of_sample,
    arrays_of_samples,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.shard_set import ShardSet
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Frame, Views

# Views that are read anew for each step, where all of them would not fit into memory. Effects:
# reads views.


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
        order = BatchOrder(len(self), plan.batch, seed, self._shards())
        rows = (order.rows(step)[own].tolist() for step in steps)
        options: dict[str, Any] = {"num_workers": plan.workers}
        if plan.workers and any(view.source.url.startswith("s3:") for view, _ in self.pictures):
            # S3's client does not survive a fork.
            options["multiprocessing_context"] = "spawn"
        loader = DataLoader(
            _Pictures(self), batch_sampler=_Rows(rows), collate_fn=_stacked, **options
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


# From roots or shards to the views of a plan.


T = TypeVar("T")
NYU_LIGHT: Final = "nyuv2"  # what a run's record calls the light of photographs


@dataclass(frozen=True, slots=True)
class TrainingSource:
    """Where views come from and how they are parted.

    places: roots or shards, or NYUv2's .mat alone. modes: each view is taken once in each of them. hold_out: homes by id,
    or by name without digest and variant, that never train; None = the split by house holds out
    val and test (a fifth of the homes). all_there: a name of hold_out that no place has is an error;
    where several sources are compared, another one may have it. objects: models without context instead of rooms. most: at
    most so many training views, spread over all; 0 = all.
    """

    places: tuple[str, ...]
    modes: tuple[str, ...] = ("mlt_il_ol",)
    hold_out: frozenset[str] | None = None
    objects: bool = False
    most: int = 0
    all_there: bool = True

    @property
    def name(self) -> str:
        """What a record calls it."""
        return " + ".join(self.places)

    @property
    def is_nyu(self) -> bool:
        """Photographs of NYUv2: the training pictures of splits.mat, its test pictures held out."""
        return any(place.endswith(".mat") for place in self.places)

    @property
    def light(self) -> str:
        """What a record calls the pictures' light."""
        return NYU_LIGHT if self.is_nyu else "+".join(self.modes)


def training_views(source: TrainingSource, plan: TrainingPlan) -> TrainingViews:
    """The views that train: in memory, or streamed where they take more than plan.memory_gb.

    Raises BadInput where there is none.
    """
    if source.is_nyu:
        return _nyu_views(source, plan, "train", source.most)
    pictures = _pictures(source, plan, held_out=False, most=source.most)
    if not pictures:
        text = "no view to train on: all its homes are held out"
        raise BadInput(source.name, "", text, hint="--hold-out HOME..., or --hold-out none")
    if len(pictures) > _n_fitting(pictures, plan):
        return StreamedViews(pictures, plan)
    return _arrays(pictures, plan)


def held_out_views(source: TrainingSource, plan: TrainingPlan, most: int = 0) -> ViewArrays | None:
    """The views of the homes that are held out, at most so many, and as fit into plan.memory_gb.

    None where there is none; of NYUv2 the test pictures.
    """
    if source.is_nyu:
        return _nyu_views(source, plan, "test", most)
    pictures = _pictures(source, plan, held_out=True, most=most)
    if not pictures:
        return None
    return _arrays(_spread(pictures, max(_n_fitting(pictures, plan), plan.final_views)), plan)


def all_views(source: TrainingSource, plan: TrainingPlan, most: int = 0) -> ViewArrays:
    """Every view of the source: one that no training has seen."""
    views = [view for place in source.places for view in _finished(open_views(place), source, plan)]
    return _arrays(_in_each_light(_spread(views, most), source, plan), plan)


def credits_of(source: TrainingSource, homes: Sequence[str]) -> tuple[str, ...]:
    """The lines that everything made of these homes must carry, each once."""
    lines: dict[str, None] = {}
    for place in () if source.is_nyu else source.places:
        views = open_views(place)
        told = getattr(views.source, "credits", None)
        own = set(views.homes)
        lines |= dict.fromkeys(told([home for home in homes if home in own]) if told else ())
    return tuple(lines)


def left_out(source: TrainingSource, plan: TrainingPlan) -> dict[str, str]:
    """id -> why, of views that lack what the plan's task needs, or that a run has begun only."""
    if source.is_nyu:
        return {}
    lacking: dict[str, str] = {}
    for place in source.places:
        views = open_views(place)
        lacking |= views.left_out
        for mode in source.modes:
            request = _request(mode, plan)
            lacking |= views.only(objects=source.objects, request=request).left_out
    return lacking


def missing_of(source: TrainingSource) -> list[str]:
    """The names of hold_out that no home of its places has."""
    homes = {
        name
        for place in source.places
        for ref in open_views(place).refs
        for name in (ref.house, home_of(ref.house))
    }
    return sorted((source.hold_out or frozenset()) - homes)


def is_held_out(view: Frame, source: TrainingSource) -> bool:
    """The view's home never trains."""
    if source.hold_out is not None:
        return bool({view.ref.house, home_of(view.ref.house)} & source.hold_out)
    return view.source.split_of(view.ref, None) != "train"


def _pictures(
    source: TrainingSource, plan: TrainingPlan, *, held_out: bool, most: int
) -> tuple[Picture, ...]:
    found: list[Frame] = []
    homes: set[str] = set()
    for place in source.places:
        views = _finished(open_views(place), source, plan)
        homes |= {name for ref in views.refs for name in (ref.house, home_of(ref.house))}
        found += [view for view in views if is_held_out(view, source) == held_out]
    unknown = sorted((source.hold_out or frozenset()) - homes)
    if unknown and source.all_there:
        raise BadInput("--hold-out", unknown[0], f"no such home in {source.name}")
    return _in_each_light(_spread(found, most), source, plan)


def _in_each_light(
    views: Sequence[Frame], source: TrainingSource, plan: TrainingPlan
) -> tuple[Picture, ...]:
    requests = [_request(mode, plan) for mode in source.modes]
    return tuple((view, request) for request in requests for view in views)


def _n_fitting(pictures: Sequence[Picture], plan: TrainingPlan) -> int:
    """How many views plan.memory_gb holds, by the first one's size."""
    view, request = pictures[0]
    arrays = arrays_of_sample(view.sample(request), task_of(plan.task), plan)
    return int(plan.memory_gb * 1e9 / sum(array.nbytes for array in arrays.values()))


def _nyu_views(source: TrainingSource, plan: TrainingPlan, split: str, most: int) -> ViewArrays:
    # Imported where needed: it wants h5py.
    from pbrs_farm.study.photographs import nyu_arrays

    if len(source.places) > 1:
        text = "NYUv2 trains alone"
        raise BadInput(source.name, "", text, hint="pre-train first, then --init RUN")
    views = nyu_arrays(Path(source.places[0]), plan, split)
    return views.some(most) if most else views


def _finished(views: Views, source: TrainingSource, plan: TrainingPlan) -> Views:
    """Those that have all that the plan's task needs, in every mode."""
    for mode in source.modes:
        views = views.only(objects=source.objects, request=_request(mode, plan))
    return views


def _spread(views: Sequence[T], most: int) -> list[T]:
    if not most or len(views) <= most:
        return list(views)
    return [views[round(k * (len(views) - 1) / max(most - 1, 1))] for k in range(most)]


def _arrays(pictures: Sequence[Picture], plan: TrainingPlan) -> ViewArrays:
    samples = (view.sample(request) for view, request in pictures)
    return arrays_of_samples(samples, task_of(plan.task), plan)


def _request(mode: str, plan: TrainingPlan) -> SampleRequest:
    size = (plan.width_px, plan.height_px)
    return SampleRequest(task_of(plan.task).layers, mode=mode, axes="opencv", size=size)
