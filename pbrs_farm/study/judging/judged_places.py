"""Test views of `--on`: homes of a root, photographs with depth, or NYUv2's .mat. Effects: reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from torch import nn

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of
from pbrs_farm.study.judging.evaluation import JudgedViews, judged_of_arrays
from pbrs_farm.study.nyu_pictures import NYU_HOME, has_splits, nyu_pictures, truth_of_nyu
from pbrs_farm.study.photographs import PHOTO_TRUTHS, RealFrame, truth_text, with_large_planes
from pbrs_farm.study.real_frames import depths_of_pairs, read_frame, real_pairs
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import predict, score_predictions
from pbrs_farm.study.training.training_job import CURVE_THRESHOLDS
from pbrs_farm.study.training.training_loop import Judge
from pbrs_farm.study.training.training_views import camera_numbers
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


def open_judged_places(
    words: Sequence[str],
    plan: TrainingPlan,
    *,
    mode: str,
    trained_on: frozenset[str] = frozenset(),
    most: int = 0,
    hold_out: frozenset[str] | None = None,
    known_held_out: frozenset[str] | None = None,
) -> list[JudgedViews]:
    """The views of each word, as in open_judged_place; BadInput for two places of one name."""
    places: dict[str, JudgedViews] = {}
    for word in words:
        views = open_judged_place(
            word,
            plan,
            mode=mode,
            trained_on=trained_on,
            most=most,
            hold_out=hold_out,
            known_held_out=known_held_out,
        )
        if views.name in places:
            hint = f"--on other={word.partition('=')[2] or word}"
            raise BadInput("--on", word, f"two places are named {views.name}", hint=hint)
        places[views.name] = views
    return list(places.values())


def open_judged_place(
    word: str,
    plan: TrainingPlan,
    *,
    mode: str,
    trained_on: frozenset[str] = frozenset(),
    most: int = 0,
    hold_out: frozenset[str] | None = None,
    known_held_out: frozenset[str] | None = None,
) -> JudgedViews:
    """The views of `[NAME=]PLACE[@MODE]` at a plan's size.

    Of a root: all views if none of its homes is in trained_on, else those of hold_out or of the
    split by house. known_held_out: homes that a run held out. Raises BadInput for a word without a
    place, and for training homes.
    """
    label, equals, rest = word.partition("=")
    label, rest = (label, rest) if equals else ("", word)
    place, _, place_mode = rest.partition("@")
    if not place:
        raise BadInput("--on", word, "has no place", hint="--on nyu=PLACE")
    path = Path(place)
    is_nyu, is_folder = path.suffix == ".mat", path.is_dir() and not is_root(path)
    if place_mode and (is_nyu or is_folder):
        raise BadInput("--on", word, f"photographs have no lighting mode, such as {place_mode}")
    if is_nyu:
        return _nyu_views(path, plan, label or "NYUv2", trained_on)
    if is_folder:
        return _photographs(path, plan, label or path.name, trained_on)
    if hold_out is None and known_held_out:
        hold_out = frozenset(home_of(house) for house in known_held_out)
    source = TrainingSource((place,), (place_mode or mode,), hold_out, all_there=False)
    if plan.task == "normals":
        source = with_layer(source, plan, "depth")
    return _of_homes(source, plan, label or path.name, trained_on, most)


def judge_of_places(places: Sequence[JudgedViews], plan: TrainingPlan) -> Judge:
    """Function from a network to its errors `on_<name>`, for curves and early stopping."""
    task = task_of(plan.task, CURVE_THRESHOLDS)

    def error_on(network: nn.Module, on: JudgedViews) -> float:
        predictions = predict(network, on.colour, task, plan, on.sizes, on.cameras)
        return task.error(score_predictions(predictions, on.truths, task, plan).figures)

    return lambda network: {f"on_{on.name}": error_on(network, on) for on in places}


def homes_that_train(sources: Sequence[TrainingSource]) -> frozenset[str]:
    """The training homes of all sources."""
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
    trained_homes = {home_of(house) for house in trained_on}
    shared = trained_homes & {home_of(house) for house in open_views(source.places[0]).homes}
    if not shared:
        views = all_views(replace(source, hold_out=None), plan, most)
    else:
        held_out = held_out_views(source, plan, most)
        if held_out is None:
            text = f"all its homes were used for training: {', '.join(sorted(shared)[:3])}"
            raise BadInput(source.name, "", text, hint="other homes, or train with --hold-out")
        views = held_out
    leaked = trained_homes & {home_of(house) for house in views.homes}
    if leaked:
        text = f"home {min(leaked)} was used for training"
        raise BadInput(source.name, "", text, hint="the same --hold-out as in training")
    truth = f"{task_of(plan.task).truth}; {source.modes[0]} light, {len(views.homes)} homes"
    return judged_of_arrays(name, truth, views, credits_of(source, views.homes))


def _photographs(
    folder: Path, plan: TrainingPlan, name: str, trained_on: frozenset[str]
) -> JudgedViews:
    """All pairs below a folder; BadInput for one that trained, by its digest."""
    pairs = real_pairs(folder, plan)
    frames = [read_frame(pair, folder, plan) for pair in pairs]
    for frame in frames:
        if frame.digest in trained_on:
            text = "this photograph was used for training"
            raise BadInput(folder, frame.id, text, hint="photographs of other rooms")
    truth = truth_text(PHOTO_TRUTHS[plan.task], depths_of_pairs(pairs))
    return _judged_frames(name, truth, frames)


def _nyu_views(
    path: Path, plan: TrainingPlan, name: str, trained_on: frozenset[str]
) -> JudgedViews:
    """The test pictures of the .mat, or all without splits.mat; BadInput for a training picture among them."""
    split = "test" if has_splits(path) else "all"
    if split == "all" and NYU_HOME in trained_on:
        text = "the run was tuned on NYUv2, and without splits.mat what trained would judge"
        raise BadInput(path, "", text, hint="put splits.mat beside it")
    frames = list(nyu_pictures(path, plan, split))
    which = f"{len(frames)} test pictures" if split == "test" else "all pictures, no splits.mat"
    return _judged_frames(name, f"{truth_of_nyu(path, plan.task)}; Eigen's crop; {which}", frames)


def _judged_frames(name: str, truth: str, frames: Sequence[RealFrame]) -> JudgedViews:
    colour = np.stack([frame.colour for frame in frames])
    cameras = np.stack([camera_numbers(frame.K) for frame in frames])
    ids, rooms = tuple(frame.id for frame in frames), tuple(frame.room for frame in frames)
    truths = tuple(with_large_planes(frame) for frame in frames)
    return JudgedViews(name, truth, ids, colour, truths, cameras=cameras, rooms=rooms)
