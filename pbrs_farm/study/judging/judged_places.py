"""What `--on` names: homes of a root, photographs with depth, or NYUv2's .mat. Effects: reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from torch import nn

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of
from pbrs_farm.study.judging.evaluation import JudgedViews, judged_of_arrays
from pbrs_farm.study.judging.judged_photographs import pair_views
from pbrs_farm.study.nyu_pictures import NYU_HOME, NYU_TRUTHS, has_splits, nyu_pictures
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import predict, score_predictions
from pbrs_farm.study.training.training_loop import Judge
from pbrs_farm.study.training.view_sources import (
    TrainingSource,
    all_views,
    credits_of,
    held_out_views,
    is_held_out,
    is_root,
    with_layer,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.open_views import open_views

_CURVE_THRESHOLDS: Final = 9  # of lines, while a run trains


def open_judged_places(
    words: Sequence[str], plan: TrainingPlan, *, mode: str, trained_on: frozenset[str] = frozenset(),
    most: int = 0, hold_out: frozenset[str] | None = None, known_held_out: frozenset[str] | None = None,
) -> list[JudgedViews]:  # fmt: skip
    """The views of each word, as open_judged_place opens them; BadInput where two have one name."""
    places: list[JudgedViews] = []
    for word in words:
        one = open_judged_place(
            word, plan, mode=mode, trained_on=trained_on, most=most, hold_out=hold_out,
            known_held_out=known_held_out,
        )  # fmt: skip
        if one.name in {other.name for other in places}:
            hint = f"--on other={word.partition('=')[2] or word}"
            raise BadInput("--on", word, f"a second place named {one.name}", hint=hint)
        places.append(one)
    return places


def open_judged_place(
    word: str, plan: TrainingPlan, *, mode: str, trained_on: frozenset[str] = frozenset(), most: int = 0,
    hold_out: frozenset[str] | None = None, known_held_out: frozenset[str] | None = None,
) -> JudgedViews:  # fmt: skip
    """The views that `[NAME=]PLACE[@MODE]` names, at a plan's size.

    Of a root all views where none of its homes is in trained_on, else those of hold_out, or those
    the split by house holds out. known_held_out: homes a run says it held out. Raises BadInput
    for a word without a place, and where a home that trained would judge.
    """
    label, equals, rest = word.partition("=")
    label, rest = (label, rest) if equals else ("", word)
    place, _, own_mode = rest.partition("@")
    if not place:
        raise BadInput("--on", word, "names no place", hint="--on nyu=PLACE")
    path = Path(place)
    is_nyu, is_folder = path.suffix == ".mat", path.is_dir() and not is_root(path)
    if own_mode and (is_nyu or is_folder):
        raise BadInput("--on", word, f"photographs have no light of ours, such as {own_mode}")
    if is_nyu:
        return nyu_views(path, plan, label or "NYUv2", trained_on)
    if is_folder:
        return pair_views(path, plan, label or path.name, trained_on)
    if hold_out is None and known_held_out:
        hold_out = frozenset(home_of(house) for house in known_held_out)
    source = TrainingSource((place,), (own_mode or mode,), hold_out, all_there=False)
    if plan.task == "normals":
        source = with_layer(source, plan, "depth")
    return _of_homes(source, plan, label or path.name, trained_on, most)


def judge_of_places(places: Sequence[JudgedViews], plan: TrainingPlan) -> Judge:
    """What a network errs on each of some places, as `on_<name>`: for the curve, and to choose steps."""
    task = task_of(plan.task, _CURVE_THRESHOLDS)

    def judge(network: nn.Module) -> dict[str, float]:
        return {
            f"on_{on.name}": task.error(
                score_predictions(
                    predict(network, on.colour, task, plan, on.sizes, on.cameras),
                    on.truths,
                    task,
                    plan,
                ).figures
            )
            for on in places
        }

    return judge


def homes_that_train(sources: Sequence[TrainingSource]) -> frozenset[str]:
    """Every home that trains in any of them."""
    return frozenset(
        view.ref.house
        for source in sources
        for place in source.places
        for view in open_views(place)
        if not view.ref.is_object and not is_held_out(view, source)
    )


def _of_homes(
    source: TrainingSource, plan: TrainingPlan, name: str, trained_on: frozenset[str], most: int
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
    return judged_of_arrays(name, truth, views, credits_of(source, views.homes))


def nyu_views(path: Path, plan: TrainingPlan, name: str, trained_on: frozenset[str]) -> JudgedViews:
    """The test pictures of the .mat, all of them where no splits.mat lies beside it.

    Raises BadInput for a file that is none, lacks what a task needs, or would judge what trained.
    """
    split = "test" if has_splits(path) else "all"
    if split == "all" and NYU_HOME in trained_on:
        text = "the run was tuned on NYUv2, and without splits.mat what trained would judge"
        raise BadInput(path, "", text, hint="put splits.mat beside it")
    pictures = list(nyu_pictures(path, plan, split))
    which = f"{len(pictures)} test pictures" if split == "test" else "all pictures, no splits.mat"
    said = f"{NYU_TRUTHS[plan.task]}; Eigen's crop; {which}"
    colour = np.stack([picture.colour for picture in pictures])
    truths = tuple(picture.truth for picture in pictures)
    ids = tuple(picture.id for picture in pictures)
    cameras = np.stack([picture.camera for picture in pictures])
    return JudgedViews(name, said, ids, colour, truths, cameras=cameras)
