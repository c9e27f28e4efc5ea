"""What `--on` names: homes of a root, photographs with depth, or NYUv2's .mat. Effects: reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of
from pbrs_farm.study.judging.photo_views import JudgedViews, judged_of_arrays
from pbrs_farm.study.reading.open_views import open_views
from pbrs_farm.study.tasks.task_choice import task_of
from pbrs_farm.study.training.view_sources import Source, all_views, held_out_views, is_held_out
from pbrs_farm.study.training_plan import Plan


def judged_place(
    word: str, plan: Plan, *, mode: str, trained_on: frozenset[str] = frozenset(), most: int = 0,
    hold_out: frozenset[str] | None = None, known_held_out: frozenset[str] | None = None,
) -> JudgedViews:  # fmt: skip
    """The views that `[NAME=]PLACE[@MODE]` names, at a plan's size.

    Of a root all views where none of its homes is in trained_on, else those of hold_out, or those
    the split by house holds out. known_held_out: homes a run says it held out. Raises BadInput
    where a home that trained would judge.
    """
    label, equals, rest = word.partition("=")
    label, rest = (label, rest) if equals else ("", word)
    place, _, own_mode = rest.partition("@")
    path = Path(place)
    if path.suffix == ".mat":
        from pbrs_farm.study.judging.nyu_views import nyu_views

        return nyu_views(path, plan, label or "NYUv2", trained_on)
    if path.is_dir() and not _is_root(path):
        from pbrs_farm.study.judging.pair_views import pair_views

        return pair_views(path, plan, label or path.name)
    if hold_out is None and known_held_out:
        hold_out = frozenset(home_of(house) for house in known_held_out)
        hold_out &= frozenset(home_of(house) for house in open_views(place).homes)
    source = Source((place,), (own_mode or mode,), hold_out)
    return _of_homes(source, plan, label or path.name, trained_on, most)


def homes_that_train(sources: Sequence[Source]) -> frozenset[str]:
    """Every home that trains in any of them."""
    return frozenset(
        view.ref.house
        for source in sources
        for place in source.places
        for view in open_views(place)
        if not view.ref.is_object and not is_held_out(view, source)
    )


def _is_root(path: Path) -> bool:
    return any((path / name).exists() for name in ("houses", "objects", "dataset.json"))


def _of_homes(
    source: Source, plan: Plan, name: str, trained_on: frozenset[str], most: int
) -> JudgedViews:
    homes = {home_of(house) for house in open_views(source.places[0]).homes}
    seen = homes & {home_of(house) for house in trained_on}
    if not seen:
        views = all_views(replace(source, hold_out=None), plan, most)
    else:
        held = held_out_views(source, plan, most)
        if held is None:
            text = f"all its homes trained: {', '.join(sorted(seen)[:3])}"
            raise BadInput(source.name, "", text, hint="other homes, or train with --hold-out")
        views = held
    leaked = {home_of(house) for house in views.homes} & {home_of(house) for house in trained_on}
    if leaked:
        text = f"home {min(leaked)} has trained, it may not judge"
        raise BadInput(source.name, "", text, hint="the same --hold-out as in training")
    truth = f"{task_of(plan.task).truth}; {source.modes[0]} light, {len(views.homes)} homes"
    credits_of = getattr(open_views(source.places[0]).source, "credits", None)
    credits = tuple(credits_of(views.homes)) if credits_of else ()
    return judged_of_arrays(name, truth, views, credits)
