"""What `--on` names: homes of a root, photographs with depth, or NYUv2's .mat. Effects: reads them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from torch import nn

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of
from pbrs_farm.curate.photographs import pairs_in, photo_from_pair
from pbrs_farm.regular_files import fault_of, read_regular
from pbrs_farm.study.judging.evaluation import JudgedViews, judged_of_arrays
from pbrs_farm.study.photographs import (
    DEPTH_TRUTH,
    NYU_HOME,
    NYU_TRUTHS,
    PLANE_TRUTH,
    framed,
    has_splits,
    nyu_pictures,
    photo_truth,
)
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import predicted, scored
from pbrs_farm.study.training.training_loop import Judge
from pbrs_farm.study.training.view_sources import (
    TrainingSource,
    all_views,
    credits_of,
    held_out_views,
    is_held_out,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.open_views import open_views

_CURVE_THRESHOLDS: Final = 9  # of lines, while a run trains


def judged_place(
    word: str, plan: TrainingPlan, *, mode: str, trained_on: frozenset[str] = frozenset(), most: int = 0,
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
        return nyu_views(path, plan, label or "NYUv2", trained_on)
    if path.is_dir() and not _is_root(path):
        return pair_views(path, plan, label or path.name)
    if hold_out is None and known_held_out:
        hold_out = frozenset(home_of(house) for house in known_held_out)
    source = TrainingSource((place,), (own_mode or mode,), hold_out, all_there=False)
    return _of_homes(source, plan, label or path.name, trained_on, most)


def judge_of_places(places: Sequence[JudgedViews], plan: TrainingPlan) -> Judge:
    """What a network errs on each of some places, as `on_<name>`: for the curve, and to choose steps."""
    task = task_of(plan.task, _CURVE_THRESHOLDS)

    def judge(network: nn.Module) -> dict[str, float]:
        return {
            f"on_{on.name}": task.error(
                scored(
                    predicted(network, on.colour, task, plan, on.sizes), on.truths, task, plan
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


def _is_root(path: Path) -> bool:
    return any((path / name).exists() for name in ("houses", "objects", "dataset.json"))


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


# NYUv2's .mat as views to judge on: its test pictures, truth at their own size. Effects: reads
# files.


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
    return JudgedViews(name, said, tuple(picture.id for picture in pictures), colour, truths)


# Photographs with depth as views to judge normals on; their truth are planes fitted to depth.
# Effects: reads files.
# A folder of pairs in a layout of docs/selection.md, and the camera: intrinsics.json with fx, fy,
# cx, cy in pixels (depth_scale: units a metre), or intrinsics.txt with those four numbers or the
# nine of K, beside the pictures or in a folder above.


_FILES: Final = ("intrinsics.json", "intrinsics.txt")
_MAX_BYTES: Final = 100_000


@dataclass(frozen=True, slots=True)
class PhotoCamera:
    """The pinhole camera of photographs, pixels of the stored size."""

    K: tuple[float, float, float, float]  # fx, fy, cx, cy
    depth_scale: float | None  # units a metre; None = as the file's type says

    def matrix(self) -> F64:
        """(3, 3)."""
        fx, fy, cx, cy = self.K
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)


def pair_views(folder: Path, plan: TrainingPlan, name: str) -> JudgedViews:
    """Every pair below a folder, for normals and depth; BadInput for one without intrinsics."""
    if plan.task not in ("normals", "depth"):
        text = f"photographs with depth say nothing of {plan.task}: normals and depth alone"
        raise BadInput(folder, "", text, hint="NYUv2's .mat holds classes and instances")
    ids, colours, truths = [], [], []
    for pair in pairs_in(folder):
        camera = camera_of(pair.rgb.parent, folder)
        photo = photo_from_pair(pair, depth_scale=camera.depth_scale, sun_rgbd=False)
        colour, rows, columns = framed(photo.rgb, plan)
        truth = photo_truth(photo, camera.matrix(), plan)
        ids.append(pair.id)
        colours.append(colour)
        truths.append({key: array[rows, columns] for key, array in truth.items()})
    said = PLANE_TRUTH if plan.task == "normals" else DEPTH_TRUTH
    return JudgedViews(name, said, tuple(ids), np.stack(colours), tuple(truths))


def camera_of(folder: Path, top: Path) -> PhotoCamera:
    """The nearest intrinsics file from a folder up to top and its parent; BadInput where there is none."""
    above = [folder, *folder.parents]
    last = above.index(top) if top in above else 0
    for place in above[: last + 1]:
        for name in _FILES:
            if (place / name).is_file():
                return _camera(place / name)
    text = "photographs without intrinsics: normals cannot be taken from their depth"
    hint = 'put intrinsics.json there: {"fx": 518.9, "fy": 519.5, "cx": 325.6, "cy": 253.7}'
    raise BadInput(folder, "", text, hint=hint)


def _camera(path: Path) -> PhotoCamera:
    try:
        text = read_regular(path)[:_MAX_BYTES].decode()
    except (OSError, UnicodeDecodeError) as error:
        why = fault_of(error) if isinstance(error, OSError) else "not text"
        raise BadInput(path, "", why) from None
    scale: float | None = None
    try:
        if path.suffix == ".json":
            row = json.loads(text)
            values = [float(row[key]) for key in ("fx", "fy", "cx", "cy")]
            scale = float(row["depth_scale"]) if "depth_scale" in row else None
        else:
            values = [float(word) for word in text.replace(",", " ").split()]
            values = [values[k] for k in (0, 4, 2, 5)] if len(values) == 9 else values
    except (ValueError, KeyError, TypeError):
        values = []
    if len(values) != 4 or not np.isfinite(values).all() or min(values[:2]) <= 0:
        raise BadInput(path, "", "expected fx, fy, cx and cy in pixels, or the nine numbers of K")
    fx, fy, cx, cy = values
    return PhotoCamera((fx, fy, cx, cy), scale)
