"""Training and held-out views of a plan from roots, shards or photographs. Effects: reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import home_of, split_of_house
from pbrs_farm.curate.photographs import has_depth
from pbrs_farm.study.photographs import arrays_of_frames
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.mixed_views import MixedViews
from pbrs_farm.study.training.photograph_views import Mix, Photographs, id_of, photographs_of
from pbrs_farm.study.training.streamed_views import Picture, StreamedViews
from pbrs_farm.study.training.training_views import (
    TrainingViews,
    ViewArrays,
    arrays_of_sample,
    arrays_of_samples,
    evenly_spaced,
    joined,
)
from pbrs_farm.study.training_plan import TrainingPlan
from pbrs_farm.views.hypersim_folder import is_hypersim
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Frame, Views

NYU_LIGHT: Final = "nyuv2"  # light of NYUv2's photographs in the record of a run
PHOTO_LIGHT: Final = "photographs"  # light of other photographs


@dataclass(frozen=True, slots=True)
class TrainingSource:
    """Places of views, and their division into training and held-out homes.

    places: roots or shards, or NYUv2's .mat alone. modes: each view is used once in each light.
    hold_out: homes by id, or by name without digest and variant, that never train; None = val and
    test of the split by house (a fifth of the homes). all_there: a name in hold_out without a home
    is an error; False if another of several compared sources may have it. beside: layers to read
    beside those of the task. objects: models without context instead of rooms. most: maximum number
    of training views, evenly spaced; 0 = all. mix: photographs with depth that have a share of each
    batch.
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
        """The places, joined."""
        return " + ".join(self.places)

    @property
    def is_nyu(self) -> bool:
        """True for NYUv2: splits.mat divides its photographs."""
        return any(place.endswith(".mat") for place in self.places)

    @property
    def is_photographs(self) -> bool:
        """True for folders of photographs with depth instead of views."""
        folders = (Path(place) for place in self.places)
        return any(path.is_dir() and not is_root(path) and has_depth(path) for path in folders)

    @property
    def light(self) -> str:
        """Light of the pictures in the record of a run."""
        if self.is_nyu:
            return NYU_LIGHT
        return PHOTO_LIGHT if self.is_photographs else "+".join(self.modes)


def training_views(source: TrainingSource, plan: TrainingPlan) -> TrainingViews:
    """Training views in memory, or streamed beyond plan.memory_gb, mixed with source.mix; BadInput."""
    views = _rendered_or_real(source, plan)
    if not source.mix:
        return views
    if sum(mix.share for mix in source.mix) >= 1:
        text = "the shares must sum to less than 1"
        raise BadInput("--mix", ", ".join(mix.place for mix in source.mix), text)
    parts = [(photographs_of(Path(mix.place), plan, mix.most), mix.share) for mix in source.mix]
    return MixedViews(views, tuple((part.views(plan), share) for part, share in parts))


def photographs_that_train(source: TrainingSource, plan: TrainingPlan) -> list[dict[str, Any]]:
    """Folders and digests of the training photographs, for the record of a run."""
    folders = _real(source, plan, held_out=False) if source.is_photographs else []
    return [photographs.record() for photographs in folders] + [
        photographs_of(Path(mix.place), plan, mix.most).record() | {"share": mix.share}
        for mix in source.mix
    ]


def _rendered_or_real(source: TrainingSource, plan: TrainingPlan) -> TrainingViews:
    if source.is_nyu:
        return _nyu_views(source, plan, "train", source.most)
    if source.is_photographs:
        folders = _real(source, plan, held_out=False)
        if not folders:
            text = "no photograph to train on: all its scenes are held out"
            raise BadInput(source.name, "", text, hint="--hold-out SCENE..., or --hold-out none")
        return _real_views(folders, plan)
    pictures = _pictures(source, plan, held_out=False, most=source.most)
    if not pictures:
        text = "no view to train on: all its homes are held out"
        raise BadInput(source.name, "", text, hint="--hold-out HOME..., or --hold-out none")
    if len(pictures) > _n_fitting(pictures, plan):
        return StreamedViews(pictures, plan)
    return _arrays(pictures, plan)


def held_out_views(source: TrainingSource, plan: TrainingPlan, most: int = 0) -> ViewArrays | None:
    """At most so many held-out views (of NYUv2 the test pictures) within plan.memory_gb; or None."""
    if source.is_nyu:
        return _nyu_views(source, plan, "test", most)
    if source.is_photographs:
        folders = _real(source, plan, held_out=True)
        return _real_views(folders, plan).some(most or 10**9) if folders else None
    pictures = _pictures(source, plan, held_out=True, most=most)
    if not pictures:
        return None
    return _arrays(evenly_spaced(pictures, max(_n_fitting(pictures, plan), plan.final_views)), plan)


def all_views(source: TrainingSource, plan: TrainingPlan, most: int = 0) -> ViewArrays:
    """At most so many views of all homes of the source."""
    views = [view for place in source.places for view in _finished(open_views(place), source, plan)]
    return _arrays(_in_each_light(evenly_spaced(views, most), source, plan), plan)


def credits_of(source: TrainingSource, homes: Sequence[str]) -> tuple[str, ...]:
    """Required credit lines of these homes, each once."""
    lines: dict[str, None] = {}
    for place in () if source.is_nyu or source.is_photographs else source.places:
        views = open_views(place)
        present = set(views.homes)
        credits = source_credits(views.source, [home for home in homes if home in present])
        lines |= dict.fromkeys(credits)
    return tuple(lines)


def source_credits(source: Any, homes: Sequence[str]) -> tuple[str, ...]:
    """Required credit lines of some homes of a source of views."""
    credits = getattr(source, "credits", None)
    return tuple(credits(list(homes))) if credits else ()


def left_out(source: TrainingSource, plan: TrainingPlan) -> dict[str, str]:
    """Reasons by id for views without the layers of the plan's task, or still being rendered."""
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
    """The source with another layer, if all its views have that; else unchanged."""
    more = replace(source, beside=(*source.beside, layer))
    try:
        lacks = left_out(more, plan).keys() - left_out(source, plan).keys()
    except BadInput:  # no view has it
        return source
    return source if lacks else more


def is_root(path: Path) -> bool:
    """True for an output root, shards or Hypersim's scenes; False for photographs."""
    has = any((path / name).exists() for name in ("houses", "objects", "dataset.json"))
    return has or is_hypersim(path)


def _real(source: TrainingSource, plan: TrainingPlan, *, held_out: bool) -> list[Photographs]:
    """Photographs of the training scenes, or of the held-out ones; folders without any are omitted."""
    folders = []
    for place in source.places:
        photographs = photographs_of(Path(place), plan)
        folder = photographs.folder
        pairs = tuple(
            pair
            for pair in photographs.pairs
            if _is_scene_held_out(id_of(pair, folder).partition("/")[0], source) == held_out
        )
        folders += [Photographs(folder, pairs)] if pairs else []
    if held_out or not source.most:
        return folders
    share = -(-source.most // max(len(folders), 1))
    return [Photographs(p.folder, tuple(evenly_spaced(p.pairs, share))) for p in folders]


def _is_scene_held_out(scene: str, source: TrainingSource) -> bool:
    if source.hold_out is not None:
        return scene in source.hold_out
    return split_of_house(scene) != "train"


def _real_views(folders: Sequence[Photographs], plan: TrainingPlan) -> ViewArrays:
    return joined([photographs.views(plan) for photographs in folders])


def missing_of(source: TrainingSource) -> list[str]:
    """The names in hold_out without a home."""
    return _unknown_homes(source, [open_views(place) for place in source.places])


def _unknown_homes(source: TrainingSource, sets: Sequence[Views]) -> list[str]:
    houses = {ref.house for views in sets for ref in views.refs}
    return sorted((source.hold_out or frozenset()) - houses - {home_of(house) for house in houses})


def is_held_out(view: Frame, source: TrainingSource) -> bool:
    """True if the view's home never trains."""
    if source.hold_out is not None:
        return bool({view.ref.house, home_of(view.ref.house)} & source.hold_out)
    return view.source.split_of(view.ref, None) != "train"


def _pictures(
    source: TrainingSource, plan: TrainingPlan, *, held_out: bool, most: int
) -> tuple[Picture, ...]:
    sets = [_finished(open_views(place), source, plan) for place in source.places]
    unknown = _unknown_homes(source, sets)
    if unknown and source.all_there:
        raise BadInput("--hold-out", unknown[0], f"no such home in {source.name}")
    frames = [view for views in sets for view in views if is_held_out(view, source) == held_out]
    return _in_each_light(evenly_spaced(frames, most), source, plan)


def _in_each_light(
    views: Sequence[Frame], source: TrainingSource, plan: TrainingPlan
) -> tuple[Picture, ...]:
    requests = [_request(mode, source, plan) for mode in source.modes]
    return tuple((view, request) for request in requests for view in views)


def _n_fitting(pictures: Sequence[Picture], plan: TrainingPlan) -> int:
    """Number of views within plan.memory_gb, by the size of the first."""
    view, request = pictures[0]
    arrays = arrays_of_sample(view.sample(request), task_of(plan.task), plan)
    return int(plan.memory_gb * 1e9 / sum(array.nbytes for array in arrays.values()))


def _nyu_views(source: TrainingSource, plan: TrainingPlan, split: str, most: int) -> ViewArrays:
    # Imported here because only NYUv2 needs h5py.
    from pbrs_farm.study.nyu_pictures import NYU_HOME, nyu_pictures

    if len(source.places) > 1:
        text = "NYUv2 cannot be combined with views"
        raise BadInput(source.name, "", text, hint="pre-train first, then --init RUN")
    frames = nyu_pictures(Path(source.places[0]), plan, split)
    named = (replace(frame, id=f"{NYU_HOME}/{frame.id}") for frame in frames)
    views = arrays_of_frames(named, plan)
    return views.some(most) if most else views


def _finished(views: Views, source: TrainingSource, plan: TrainingPlan) -> Views:
    """The views with all layers of the plan's task in every light."""
    for mode in source.modes:
        views = views.only(objects=source.objects, request=_request(mode, source, plan))
    return views


def _arrays(pictures: Sequence[Picture], plan: TrainingPlan) -> ViewArrays:
    samples = (view.sample(request) for view, request in pictures)
    return arrays_of_samples(samples, task_of(plan.task), plan)


def _request(mode: str, source: TrainingSource, plan: TrainingPlan) -> SampleRequest:
    size, layers = (plan.width_px, plan.height_px), (*task_of(plan.task).layers, *source.beside)
    return SampleRequest(layers, mode=mode, axes="opencv", size=size)
