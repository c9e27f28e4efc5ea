"""From roots or shards to the views of a plan: which homes train and which are held out. Effects: reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of, split_of_house
from pbrs_farm.curate.photographs import has_depth
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.mixed_views import MixedViews
from pbrs_farm.study.training.photograph_views import Mix, Photographs, id_of, photographs_of
from pbrs_farm.study.training.streamed_views import Picture, StreamedViews
from pbrs_farm.study.training.training_views import (
    TrainingViews,
    ViewArrays,
    arrays_of_sample,
    arrays_of_samples,
    joined,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.hypersim_folder import is_hypersim
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Frame, Views

T = TypeVar("T")
NYU_LIGHT: Final = "nyuv2"  # what a run's record calls the light of NYUv2's photographs
PHOTO_LIGHT: Final = "photographs"  # and that of others


@dataclass(frozen=True, slots=True)
class TrainingSource:
    """Where views come from and how they are parted.

    places: roots or shards, or NYUv2's .mat alone. modes: each view is taken once in each of them. hold_out: homes by id,
    or by name without digest and variant, that never train; None = the split by house holds out
    val and test (a fifth of the homes). all_there: a name of hold_out that no place has is an error;
    where several sources are compared, another one may have it. beside: layers that are read
    beside the task's. objects: models without context instead of rooms. most: at
    most so many training views, spread over all; 0 = all. mix: photographs with depth that have a
    share of each batch.
    """

    places: tuple[str, ...]
    modes: tuple[str, ...] = ("mlt_il_ol",)
    hold_out: frozenset[str] | None = None
    objects: bool = False
    most: int = 0
    all_there: bool = True
    beside: tuple[str, ...] = ()
    mix: tuple[Mix, ...] = ()

    @property
    def name(self) -> str:
        """What a record calls it."""
        return " + ".join(self.places)

    @property
    def is_nyu(self) -> bool:
        """Photographs of NYUv2: the training pictures of splits.mat, its test pictures held out."""
        return any(place.endswith(".mat") for place in self.places)

    @property
    def is_photographs(self) -> bool:
        """Folders of photographs with depth instead of views."""
        folders = (Path(place) for place in self.places)
        return any(path.is_dir() and not is_root(path) and has_depth(path) for path in folders)

    @property
    def light(self) -> str:
        """What a record calls the pictures' light."""
        if self.is_nyu:
            return NYU_LIGHT
        return PHOTO_LIGHT if self.is_photographs else "+".join(self.modes)


def training_views(source: TrainingSource, plan: TrainingPlan) -> TrainingViews:
    """The views that train: in memory, or streamed where they take more than plan.memory_gb.

    With source.mix, photographs have their share of each batch. Raises BadInput where there is none.
    """
    views = _rendered_or_real(source, plan)
    if not source.mix:
        return views
    if sum(mix.share for mix in source.mix) >= 1:
        text = "the shares leave nothing to the views: together below 1"
        raise BadInput("--mix", ", ".join(mix.place for mix in source.mix), text)
    parts = [photographs_of(Path(mix.place), plan, mix.most) for mix in source.mix]
    photographs = tuple(
        (part.views(plan), mix.share) for part, mix in zip(parts, source.mix, strict=True)
    )
    return MixedViews(views, photographs)


def photographs_that_train(source: TrainingSource, plan: TrainingPlan) -> list[dict[str, Any]]:
    """What a run's record says of the photographs with depth it trains on: their folders and digests."""
    found = _real(source, plan, held_out=False) if source.is_photographs else []
    mixed = [photographs_of(Path(mix.place), plan, mix.most) for mix in source.mix]
    rows = [one.record() for one in found]
    return rows + [
        one.record() | {"share": mix.share} for one, mix in zip(mixed, source.mix, strict=True)
    ]


def _rendered_or_real(source: TrainingSource, plan: TrainingPlan) -> TrainingViews:
    if source.is_nyu:
        return _nyu_views(source, plan, "train", source.most)
    if source.is_photographs:
        return _real_views(source, plan, held_out=False)
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
    if source.is_photographs:
        held = _real(source, plan, held_out=True)
        return _real_views(source, plan, held_out=True).some(most or 10**9) if held else None
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
    for place in () if source.is_nyu or source.is_photographs else source.places:
        views = open_views(place)
        credits_of_homes = getattr(views.source, "credits", None)
        own = set(views.homes)
        lines |= dict.fromkeys(
            credits_of_homes([home for home in homes if home in own]) if credits_of_homes else ()
        )
    return tuple(lines)


def left_out(source: TrainingSource, plan: TrainingPlan) -> dict[str, str]:
    """id -> why, of views that lack what the plan's task needs, or that a run has begun only."""
    if source.is_nyu or source.is_photographs:
        return {}
    lacking: dict[str, str] = {}
    for place in source.places:
        views = open_views(place)
        lacking |= views.left_out
        for mode in source.modes:
            request = _request(mode, source, plan)
            lacking |= views.only(objects=source.objects, request=request).left_out
    return lacking


def with_layer(source: TrainingSource, plan: TrainingPlan, layer: str) -> TrainingSource:
    """The source that also reads a layer, where every view it would take has that; else as it is."""
    more = replace(source, beside=(*source.beside, layer))
    try:
        lacks = left_out(more, plan).keys() - left_out(source, plan).keys()
    except BadInput:  # no view has it
        return source
    return source if lacks else more


def is_root(path: Path) -> bool:
    """A folder of views, an output root, shards or Hypersim's scenes: no photographs."""
    has = any((path / name).exists() for name in ("houses", "objects", "dataset.json"))
    return has or is_hypersim(path)


def _real(source: TrainingSource, plan: TrainingPlan, *, held_out: bool) -> list[Photographs]:
    """Photographs of the source's folders whose scenes train, or are held out; a folder without is left out."""
    found = []
    for place in source.places:
        whole = photographs_of(Path(place), plan)
        pairs = tuple(
            pair for pair in whole.pairs
            if _is_held_out(id_of(pair, whole.folder).partition("/")[0], source) == held_out
        )  # fmt: skip
        found += [replace(whole, pairs=pairs)] if pairs else []
    if held_out or not source.most:
        return found
    each = -(-source.most // max(len(found), 1))
    return [replace(one, pairs=tuple(_spread(one.pairs, each))) for one in found]


def _is_held_out(scene: str, source: TrainingSource) -> bool:
    if source.hold_out is not None:
        return scene in source.hold_out
    return split_of_house(scene) != "train"


def _real_views(source: TrainingSource, plan: TrainingPlan, *, held_out: bool) -> ViewArrays:
    found = _real(source, plan, held_out=held_out)
    if not found:
        text = "no photograph to train on: all its scenes are held out"
        raise BadInput(source.name, "", text, hint="--hold-out SCENE..., or --hold-out none")
    return joined([one.views(plan) for one in found])


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
    requests = [_request(mode, source, plan) for mode in source.modes]
    return tuple((view, request) for request in requests for view in views)


def _n_fitting(pictures: Sequence[Picture], plan: TrainingPlan) -> int:
    """How many views plan.memory_gb holds, by the first one's size."""
    view, request = pictures[0]
    arrays = arrays_of_sample(view.sample(request), task_of(plan.task), plan)
    return int(plan.memory_gb * 1e9 / sum(array.nbytes for array in arrays.values()))


def _nyu_views(source: TrainingSource, plan: TrainingPlan, split: str, most: int) -> ViewArrays:
    # Imported where needed: it wants h5py.
    from pbrs_farm.study.nyu_pictures import nyu_arrays

    if len(source.places) > 1:
        text = "NYUv2 trains alone"
        raise BadInput(source.name, "", text, hint="pre-train first, then --init RUN")
    views = nyu_arrays(Path(source.places[0]), plan, split)
    return views.some(most) if most else views


def _finished(views: Views, source: TrainingSource, plan: TrainingPlan) -> Views:
    """Those that have all that the plan's task needs, in every mode."""
    for mode in source.modes:
        views = views.only(objects=source.objects, request=_request(mode, source, plan))
    return views


def _spread(views: Sequence[T], most: int) -> list[T]:
    if not most or len(views) <= most:
        return list(views)
    return [views[round(k * (len(views) - 1) / max(most - 1, 1))] for k in range(most)]


def _arrays(pictures: Sequence[Picture], plan: TrainingPlan) -> ViewArrays:
    samples = (view.sample(request) for view, request in pictures)
    return arrays_of_samples(samples, task_of(plan.task), plan)


def _request(mode: str, source: TrainingSource, plan: TrainingPlan) -> SampleRequest:
    size, layers = (plan.width_px, plan.height_px), (*task_of(plan.task).layers, *source.beside)
    return SampleRequest(layers, mode=mode, axes="opencv", size=size)
