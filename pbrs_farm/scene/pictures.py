"""Render homes from Python: frames in memory, or many homes into a folder with several processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final, overload

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.checked_calls import (
    Count,
    Positive,
    Size,
    as_words,
    check_argument,
    checked_call,
    warn_caller,
)
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import ALL_MODES, Mode
from pbrs_farm.core.options import options_of, record_of
from pbrs_farm.core.recipe import Recipe, with_settings
from pbrs_farm.core.shot import MOST_FRAMES
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.formats.rig_toml import rig_from_table, rig_from_toml
from pbrs_farm.progress import progress_reporter
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.processes.render_task import Event
from pbrs_farm.run.request import Wanted, wanted_of
from pbrs_farm.sample.stored_cameras import OUTSIDE
from pbrs_farm.scene.home import Home, recipe_of
from pbrs_farm.scene.viewpoints import Viewpoint, film_viewpoints, rig_viewpoints
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.views import Frame, Views

AnyCamera = Camera | Viewpoint
Words = str | Iterable[str]
"""One or several names of modes or layers."""

# _ALWAYS: labels in every frame, by the names that callers use.
_ALL: Final = tuple(mode.value for mode in ALL_MODES)
_ALWAYS: Final = ("depth", "normal", "valid", "semantic", "class40", "instance", "boundary")


@overload
def render(
    home: Home,
    cameras: AnyCamera,
    *,
    modes: Words = ...,
    layers: Words = ...,
    size: Size | None = ...,
    observe: Callable[[str], None] | None = ...,
    progress: bool = ...,
) -> Frame: ...
@overload
def render(
    home: Home,
    cameras: Sequence[AnyCamera],
    *,
    modes: Words = ...,
    layers: Words = ...,
    size: Size | None = ...,
    observe: Callable[[str], None] | None = ...,
    progress: bool = ...,
) -> Views: ...
@checked_call
def render(
    home: Home,
    cameras: AnyCamera | Sequence[AnyCamera],
    *,
    modes: Words = (Mode.MLT_IL_OL,),
    layers: Words = (),
    size: Size | None = None,
    observe: Callable[[str], None] | None = None,
    progress: bool = False,
) -> Frame | Views:
    """Render pictures and labels of a home in memory: no folder, no second process.

    cameras: one or several of home.cameras(), or user-made Cameras. modes: of opengl_dl,
    opengl_il, mlt_ol, mlt_il_ol; an empty list renders labels alone. layers: optional ones besides
    depth, normal, class and instance, which each frame has (`pbrs-farm layers` lists them). size:
    (width, height); default: the camera's if it was made with one, else the recipe's. observe: called
    with the id of each finished frame. progress: show bars on a terminal, lines in a notebook.

    The bytes equal those of `pbrs-farm run` for the same home, recipe and view. A camera in no room is
    a warning. Raises BadInput for an unknown mode or layer or an invalid size, RenderFailed.

        >>> frame = pf.render(home, camera, modes=["opengl_dl"], layers=["albedo"])
        >>> frame.colour.shape, frame.layer("albedo").shape
        ((48, 64, 3), (48, 64, 3))
    """
    requested = [cameras] if isinstance(cameras, Camera | Viewpoint) else list(cameras)
    viewpoints = [home.viewpoint(camera) for camera in requested]
    if not viewpoints:
        raise BadInput(home.id, "cameras", "give at least one")
    for viewpoint in viewpoints:
        if viewpoint.room == OUTSIDE:
            x, y, z = viewpoint.camera.eye
            warn_caller(f"{home.id}: the camera at ({x:.2f}, {y:.2f}, {z:.2f}) is in no room")
    recipe = _recipe_of_view(home, viewpoints, size)
    want = _wanted(modes, layers)
    with _progress_of(home, viewpoints, observe, progress) as tell:
        frames = home.renderer.frames(home.source, recipe, viewpoints, want, tell)
    return frames[0] if isinstance(cameras, Camera | Viewpoint) else frames


@checked_call
def film(
    home: Home,
    cameras: AnyCamera | Sequence[AnyCamera],
    fps: Positive = 24.0,
    seconds: Positive = 2.0,
    *,
    from_s: float = 0.0,
    rig: str | Path | Mapping[str, Any] | None = None,
    modes: Words = (Mode.MLT_IL_OL,),
    layers: Words = (),
    tracks: bool = False,
    size: Size | None = None,
    observe: Callable[[str], None] | None = None,
    progress: bool = False,
) -> Views:
    """Render a film of a home in memory, with its motions (`home.open(at=)`, `home.drop`).

    cameras: one static camera, or one per frame. fps: frames a second. seconds: duration, from the time
    from_s on; the frames are `frame_00000` and so on. Other arguments as of `render`; layers that need
    the next or previous frame (flow_forward, scene_flow) are included except at the film's ends. rig:
    a rig.toml file or its table: several cameras take each frame, and `cameras` gives the pose of the
    rig; the views of its first camera are the frames, those of others are `frame_00000_<camera>`.
    tracks: follow surface points through all frames, for `.export(out, to="tapvid")` and tracks.npz of
    `.save(out)`. Raises BadInput if the numbers of cameras and frames differ, and for an invalid rig.

        >>> moving = home.open("door*", at={0: 0, 1: 1})
        >>> frames = pf.film(moving, camera, fps=2, seconds=1, modes=[], layers=["scene_flow"])
        >>> [frame.ref.view for frame in frames]
        ['frame_00000', 'frame_00001']
    """
    if fps * seconds > MOST_FRAMES:
        text = f"{fps:g} frames a second for {seconds:g} s are too many, at most {MOST_FRAMES:,}"
        raise BadInput("film", "seconds", text)
    n = max(1, round(fps * seconds))
    per_frame = [cameras] * n if isinstance(cameras, Camera | Viewpoint) else list(cameras)
    if len(per_frame) != n:
        text = f"{fps:g} frames a second for {seconds:g} s are {n} frames, not {len(per_frame)}"
        raise BadInput(home.id, "cameras", text)
    if rig is not None:
        home = home.set(rig=_rig_of(rig))
    frames = film_viewpoints([home.viewpoint(camera) for camera in per_frame], fps, from_s)
    recipe = _recipe_of_view(home, frames, size)
    frames = rig_viewpoints(frames, recipe.rig_in_use)
    with _progress_of(home, frames, observe, progress) as tell:
        want = _wanted(modes, layers).model_copy(update={"tracks": tracks})
        return home.renderer.frames(home.source, recipe, frames, want, tell)


def _rig_of(rig: str | Path | Mapping[str, Any]) -> dict[str, Any]:
    table = rig_from_table(rig, "rig") if isinstance(rig, Mapping) else rig_from_toml(Path(rig))
    return table.model_dump(exclude_unset=True)


@contextmanager
def _progress_of(
    home: Home,
    viewpoints: Sequence[Viewpoint],
    observe: Callable[[str], None] | None,
    progress: bool,
) -> Iterator[Callable[[str], None]]:
    """The callback for each finished view: calls observe, and updates the bars if enabled."""
    if not progress:
        yield observe or (lambda _view: None)
        return
    ids = [viewpoint.id for viewpoint in viewpoints]
    began_s = time.monotonic()
    with progress_reporter(1, as_json=False) as report:

        def hear(view_id: str) -> None:
            nonlocal began_s
            now_s = time.monotonic()
            report(Event("done", home.id, view_id, "", seconds=now_s - began_s))
            report(Event("end", home.id, view_id, ""))
            began_s = now_s
            if observe is not None:
                observe(view_id)

        report(Event("planned", home.id, None, "cameras", facts={"views": ids}))
        report(Event("begin", home.id, ids[0], "house"))
        yield hear
        report(Event("end", home.id, None, ""))


def _words(given: Words, name: str) -> tuple[str, ...]:
    """One or several names as a tuple."""
    names: tuple[str, ...] = as_words(given)
    for word in names:
        check_argument("render", name, word, str)
    return names


def _wanted(modes: Words, layers: Words) -> Wanted:
    # An empty list means labels alone; on the command line it means all modes.
    label_layers = tuple(name for name in _words(layers, "layers") if name not in _ALWAYS)
    return wanted_of(Wanted(modes=_words(modes, "modes"), layers=label_layers))


def _recipe_of_view(
    home: Home, viewpoints: Sequence[Viewpoint], size: tuple[int, int] | None
) -> Recipe:
    """The home's recipe with the size of the pictures and the source of their cameras."""
    fields = {id(viewpoint.chosen_by): viewpoint.chosen_by for viewpoint in viewpoints}
    if len({f.model_dump_json() if f else "" for f in fields.values()}) > 1:
        raise BadInput(home.id, "cameras", "come from different sources", hint="render separately")
    chosen_by = viewpoints[0].chosen_by
    sizes = {
        (viewpoint.camera.intrinsics.width_px, viewpoint.camera.intrinsics.height_px)
        for viewpoint in viewpoints
    }
    settings: dict[str, object] = {}
    if chosen_by is None:
        if len(sizes) > 1 and size is None:
            raise BadInput(home.id, "cameras", "are of different sizes", hint="render separately")
        size = size or next(iter(sizes))
        settings["cameras"] = home.recipe.cameras.model_copy(update={"source": "given"})
    else:
        settings["cameras"] = chosen_by
    if size is not None:
        settings |= {"image.width_px": int(size[0]), "image.height_px": int(size[1])}
    return with_settings(home.recipe, settings)


@checked_call
def render_homes(
    homes: Home | Iterable[Home],
    out: str | Path,
    *,
    recipe: str | Path | Recipe | None = None,
    views: Count | None = None,
    modes: Words = _ALL,
    layers: Words = (),
    jobs: Count = 1,
    observe: Callable[[Event], None] | None = None,
    progress: bool = False,
    **options: Any,
) -> Views:
    """Render homes into one place with this machine's processes: `pbrs-farm run` from Python.

    homes: also edited ones. out: a folder or s3://bucket/prefix; existing results are kept, so a killed
    script resumes. recipe: for all of them; None: the homes' own, which must agree. views: of each
    home, None = all its sampled viewpoints. observe: called with each finished step. progress: show
    bars on a terminal, lines elsewhere, as `pbrs-farm run` does. options: other outputs of `pbrs-farm
    run`, by option name: pairs=True.

    Returns the frames of out. A home that fails is a warning and does not stop the others; raises
    BadRecipe if recipes disagree or out holds another, BadInput if nothing was made.

        >>> small = home.set(**{"image.width_px": 64, "image.height_px": 48})
        >>> len(pf.render_homes([small], out="homes", views=1, modes=["opengl_dl"]))
        1
    """
    all_homes = [homes] if isinstance(homes, Home) else list(homes)
    for home in all_homes:
        check_argument("render_homes", "homes", home, Home)
    if not all_homes:
        raise BadInput("render_homes", "homes", "give at least one")
    made_with = [_recipe_of_home(home, recipe) for home in all_homes]
    for home, home_recipe in zip(all_homes, made_with, strict=True):
        if home_recipe.digest() != made_with[0].digest():
            text = "differs from the first home's recipe: an output has one recipe"
            raise BadInput(home.id, "recipe", text)
    run = Run(
        homes=(),
        store_url=str(out),
        recipe=made_with[0],
        sources=[home.source for home in all_homes],
        want=_wanted_of_words(modes, layers, views, options),
        n_jobs=jobs,
    )
    heard: list[Callable[[Event], None]] = [observe] if observe is not None else []

    def tell(event: Event) -> None:
        for hear in heard:
            hear(event)

    with ExitStack() as stack:
        if progress:
            heard.append(stack.enter_context(progress_reporter(len(all_homes), as_json=False)))
        summary = run_local(run, tell)
    _warn_of(summary)
    return open_views(out)


def _wanted_of_words(
    modes: Words, layers: Words, views: int | None, options: Mapping[str, Any]
) -> Wanted:
    names = options_of(Wanted)
    for name in options.keys() - names.keys():
        near = hint_of_choice(
            name, ["homes", "out", "recipe", "jobs", "observe", "progress", *names]
        )
        raise TypeError(f"render_homes() got an unexpected keyword argument {name!r}; {near}")
    update = {
        "modes": _words(modes, "modes") or ALL_MODES,
        "layers": _words(layers, "layers"),
        "n_views": views or 0,
    }
    return wanted_of(record_of(options, Wanted).model_copy(update=update))


def _recipe_of_home(home: Home, recipe: str | Path | Recipe | None) -> Recipe:
    if recipe is None:
        return home.recipe
    return with_settings(recipe_of(recipe), dict(home.settings))


def _warn_of(summary: Summary) -> None:
    for subject, message, command in summary.failures:
        again = f"; to repeat: {command}" if command else ""
        warn_caller(f"{subject}: {message}{again}")
    for step, why in summary.lacking.items():
        warn_caller(f"{step} skipped: {why}")
    for house, why in summary.without_views:
        warn_caller(f"{house}: no view: {why}")
