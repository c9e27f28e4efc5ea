"""From roots or shards to the views of a plan: which homes train and which are held out. Effects: reads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of
from pbrs_farm.study.reading.open_views import open_views
from pbrs_farm.study.reading.view_sample import Request, Sample
from pbrs_farm.study.reading.views import View, Views
from pbrs_farm.study.tasks.task_choice import task_of
from pbrs_farm.study.training.view_arrays import ViewArrays, arrays_of_samples
from pbrs_farm.study.training_plan import Plan


@dataclass(frozen=True, slots=True)
class Source:
    """Where views come from and how they are parted.

    places: roots or shards. modes: each view is taken once in each of them. hold_out: homes by id,
    or by name without digest and variant, that never train; None = the split by house holds out
    val and test (a fifth of the homes). objects: models without context instead of rooms. most: at
    most so many training views, spread over all; 0 = all.
    """

    places: tuple[str, ...]
    modes: tuple[str, ...] = ("mlt_il_ol",)
    hold_out: frozenset[str] | None = None
    objects: bool = False
    most: int = 0

    @property
    def name(self) -> str:
        """What a record calls it."""
        return " + ".join(self.places)


def training_views(source: Source, plan: Plan) -> ViewArrays:
    """The views that train; BadInput where there is none."""
    views = _decoded(source, plan, held_out=False, most=source.most)
    if views is None:
        text = "no view to train on: all its homes are held out"
        raise BadInput(source.name, "", text, hint="--hold-out HOME..., or --hold-out none")
    return views


def held_out_views(source: Source, plan: Plan, most: int = 0) -> ViewArrays | None:
    """The views of the homes that are held out; None where there is none."""
    return _decoded(source, plan, held_out=True, most=most)


def all_views(source: Source, plan: Plan, most: int = 0) -> ViewArrays:
    """Every view of the source: one that no training has seen."""
    views = [view for place in source.places for view in _finished(open_views(place), source, plan)]
    return _arrays(_spread(views, most), source.modes, plan)


def is_held_out(view: View, source: Source) -> bool:
    """The view's home never trains."""
    if source.hold_out is not None:
        return bool({view.ref.house, home_of(view.ref.house)} & source.hold_out)
    return view.source.split_of(view.ref, None) != "train"


def _decoded(source: Source, plan: Plan, *, held_out: bool, most: int) -> ViewArrays | None:
    found: list[View] = []
    homes: set[str] = set()
    for place in source.places:
        views = _finished(open_views(place), source, plan)
        homes |= {name for ref in views.refs for name in (ref.house, home_of(ref.house))}
        found += [view for view in views if is_held_out(view, source) == held_out]
    unknown = sorted((source.hold_out or frozenset()) - homes)
    if unknown:
        raise BadInput("--hold-out", unknown[0], f"no such home in {source.name}")
    return _arrays(_spread(found, most), source.modes, plan) if found else None


def _finished(views: Views, source: Source, plan: Plan) -> Views:
    """Those that have all that the plan's task needs, in every mode."""
    for mode in source.modes:
        views = views.only(objects=source.objects, request=_request(mode, plan))
    return views


def _spread(views: Sequence[View], most: int) -> list[View]:
    if not most or len(views) <= most:
        return list(views)
    return [views[round(k * (len(views) - 1) / max(most - 1, 1))] for k in range(most)]


def _arrays(views: Sequence[View], modes: Sequence[str], plan: Plan) -> ViewArrays:
    return arrays_of_samples(_samples(views, modes, plan), task_of(plan.task), plan)


def _samples(views: Sequence[View], modes: Sequence[str], plan: Plan) -> Iterator[Sample]:
    for mode in modes:
        request = _request(mode, plan)
        for view in views:
            yield view.sample(request)


def _request(mode: str, plan: Plan) -> Request:
    size = (plan.width_px, plan.height_px)
    return Request(task_of(plan.task).layers, mode=mode, axes="opencv", size=size)
