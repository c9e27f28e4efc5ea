"""Verbs that make: demo, run, objects, step. Effects: those of the run."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import (
    Verb,
    counted,
    dress_seeds,
    echo,
    echo_notes,
    home_arguments,
    recipe_of,
    store_of,
    warn,
)
from pbrs_farm.commands.options import add_options, request_from
from pbrs_farm.commands.using import write_sheets
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.made_home import is_made
from pbrs_farm.core.recipe import recipe_from_json
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.installation import llvm_command, need

if TYPE_CHECKING:
    from pbrs_farm.prepare.source_ref import SourceRef
    from pbrs_farm.read.objects.model_folders import ObjectModel
    from pbrs_farm.run.local_run import Observer, Run, Summary
    from pbrs_farm.run.processes.render_task import Event


def add_verbs(verb: Verb) -> None:
    """Add demo, run, objects and step."""
    from pbrs_farm.run.request import CameraOptions, ModelsOption, ObjectsRequest, RunRequest

    p = verb("demo", _demo)
    add_options(p, RunRequest, recipe="preview")
    # A first-time user's command ends in seconds.
    p.set_defaults(views=6)
    p.epilog = "Renders six views unless --views gives another number."
    p = verb("run", _run)
    p.usage = "%(prog)s HOME [HOME ...] [options]"
    for model in (CameraOptions, ModelsOption, RunRequest):
        add_options(p, model)
    add_options(verb("objects", _objects), ObjectsRequest)
    add_options(verb("step", _step), ModelsOption)


def _run(args: argparse.Namespace) -> int:
    homes = home_arguments([*args.homes, *args.home], args.houses)
    if not homes:
        hint = "a file, an example home's name, or builtin"
        raise BadInput("run", "", "no home given", hint=hint)
    if args.out is not None:
        return run_homes(args, homes)
    args.out = default_output(homes[0])
    code = run_homes(args, homes)
    if code == 0 and not args.json:
        echo(f"output in {args.out}; next: pbrs-farm sheet {args.out}")
    return code


def default_output(home: str) -> str:
    """Default output folder of a run: out/ and the home's name in lower case."""
    name = Path(home.partition(":")[0] if is_made(home) else home).stem
    plain = "".join(c if c.isalnum() or c in "-_" else "-" for c in name.lower()).strip("-")
    return f"out/{plain or 'home'}"


def run_homes(
    args: argparse.Namespace,
    homes: list[str],
    sources: Sequence[SourceRef] = (),
    refused: Sequence[tuple[str, str]] = (),
    observe: Observer | None = None,
) -> int:
    """Run the plan on homes and on resolved sources; returns the exit code.

    refused: (input, reason) of inputs that cannot be read. observe: also receives the run's events. A
    wall lost in repair is an error.
    """
    run = replace(_described(args, homes, sources), refused=refused)
    n_homes = (len(homes) + len(sources)) * max(1, len(run.dress_seeds))
    summary = run_and_report(run, n_homes, as_json=args.json, observe=observe)
    return 1 if summary.failures or summary.walls_lost or summary.n_views == 0 else 0


def run_and_report(
    run: Run, n_homes: int, *, as_json: bool, observe: Observer | None = None
) -> Summary:
    """Run it, print progress and results for standard output's kind; observe: receives each event."""
    from pbrs_farm.progress import progress_reporter
    from pbrs_farm.run.local import run_local

    # Report a missing extra before the run, not in every step.
    need("mitsuba", "drjit", "pyoidn", "moderngl")
    _warn_of_slowness()
    started = time.monotonic()
    with progress_reporter(n_homes, as_json=as_json) as report:

        def hear(event: Event) -> None:
            report(event)
            if observe is not None:
                observe(event)

        summary = run_local(run, hear)
    print_summary(summary, time.monotonic() - started, run.store_url, as_json=as_json)
    return summary


def _described(args: argparse.Namespace, homes: list[str], sources: Sequence[SourceRef]) -> Run:
    """The run that the options describe; BadInput before anything is stored."""
    from pbrs_farm.run.local_run import Run
    from pbrs_farm.run.request import RunRequest, wanted_of
    from pbrs_farm.settings import settings_from_environment

    request = request_from(args, RunRequest)
    recipe = recipe_of(args)
    want = wanted_of(request)
    if want.layers or want.tracks:
        from pbrs_farm.run.plan import check_layers

        check_layers(want, recipe)
    if recipe.cameras.file:
        from pbrs_farm.run.chosen_cameras import file_content

        file_content(recipe.cameras)
    return Run(
        homes=homes,
        models=getattr(args, "models", "") if homes else "",
        store_url=args.out,
        recipe=recipe,
        want=want,
        n_jobs=request.jobs,
        update=request.update,
        step_timeout_s=request.step_timeout,
        silence_s=request.silence,
        memory_mb=request.memory,
        debug=args.debug,
        store=settings_from_environment().store,
        sources=sources,
        dress_seeds=dress_seeds(request.dress),
    )


def _warn_of_slowness() -> None:
    """Warn if Mitsuba has only its scalar variant, and before kernels are compiled."""
    from pbrs_farm.operating_system import has_nvidia_driver, kernel_cache
    from pbrs_farm.raycast.variant import MIN_LLVM, find_llvm

    is_first = not any(kernel_cache().glob("*"))
    if is_first and sys.stderr.isatty():
        warn("the first run on this machine compiles what renders: ten seconds more, once")
    if find_llvm() is None and not has_nvidia_driver():
        warn(
            f"no LLVM of version {MIN_LLVM} or later: going on with Mitsuba's scalar_rgb, several"
            f" times slower ({llvm_command()})"
        )


def print_summary(summary: Summary, seconds: float, out: str, *, as_json: bool) -> None:
    if as_json:
        echo(_summary_line(summary, seconds))
        return
    lost = f"{counted(len(summary.walls_lost), 'wall')} LOST, " if summary.walls_lost else ""
    # If the run made nothing, print the reason alone.
    if summary.houses or summary.n_done or summary.n_kept or not summary.failures:
        echo(
            f"{counted(len(summary.houses), 'house')}, {counted(summary.n_views, 'view')}: {lost}"
            f"{counted(summary.n_done, 'step')} done, "
            f"{summary.n_kept} already there, {len(summary.failures)} failed; "
            f"{seconds:.1f} s, peak {summary.peak_mb:.0f} MB a process"
        )
    for reason in dict.fromkeys(summary.lacking.values()):
        steps = [step for step, why in summary.lacking.items() if why == reason]
        warn(f"{' and '.join(steps)} left out: {reason}")
    for house, reason in summary.leaks:
        warn(f"{house}: LIGHT LEAKS IN: {reason}; see repair.json, or `pbrs-farm repair`")
    for house, reason in summary.walls_lost:
        warn(f"{house}: WALL LOST: {reason}; see repair.json, or `pbrs-farm repair`")
    for house, reason in summary.left_out:
        warn(f"{house}: {reason}")
    for view, reason in summary.dark:
        warn(f"{view}: dark: {reason}")
    for house, reason in summary.without_views:
        warn(f"{house}: no view: {reason}")
    for subject, message, command in summary.failures:
        text = message if message.startswith(subject) else f"{subject}: {message}"
        # A failed step has already printed its message.
        warn(f"{subject} failed; reproduce: {command}" if command else text)
    if summary.taken_out:
        kinds = " and ".join(counted(n, kind) for kind, n in sorted(summary.taken_out.items()))
        echo(f"{kinds} removed: see repair.json (repair.remove_persons, remove_plants)")
    echo_notes(summary.notes, out)


def _summary_line(summary: Summary, seconds: float) -> str:
    """The run's outcome as one line of JSON."""
    failures = [dict(zip(("what", "message", "command"), f, strict=True)) for f in summary.failures]
    row = {
        "event": "summary",
        "houses": summary.houses,
        "views": summary.n_views,
        "steps_done": summary.n_done,
        "steps_kept": summary.n_kept,
        "seconds": round(seconds, 1),
        "peak_mb": round(summary.peak_mb),
        "without_views": [list(pair) for pair in summary.without_views],
        "left_out": [list(pair) for pair in summary.left_out],
        "dark": [list(pair) for pair in summary.dark],
        "failures": failures,
        "leaks": [list(pair) for pair in summary.leaks],
        "walls_lost": [list(pair) for pair in summary.walls_lost],
        "notes": dict(summary.notes),
        "lacking": summary.lacking,
    }
    return json.dumps(row)


def _demo(args: argparse.Namespace) -> int:
    home = args.home
    if home != "builtin" and not Path(home).exists():
        from pbrs_farm.assets import homes_package

        if homes_package.cached() is None:
            warn("fetching the example homes, 17 MB, once")
        # Without a network the demo uses the built-in home.
        try:
            homes_package.fetch()
        except (MachineFailed, BadInput) as error:
            warn(f"the example homes cannot be fetched: {error}")
            warn("going on with the built-in home")
            home = "builtin"
    args.dress = _demo_dressing(args)
    # Show a new user the home by day, whatever its seed draws.
    args.set = ["sky.time=day", *args.set]
    from pbrs_farm.gallery.sheet_parts import SheetParts

    failed: set[str | None] = set()
    whole: set[str | None] = set()
    with closing(SheetParts(Path(args.out))) as parts:

        def observe(event: Event) -> None:
            if event.kind == "failed":
                failed.add(event.view_id)
            if event.kind == "end" and event.view_id is not None:
                whole.add(event.view_id)
                parts.make(event.house_id, event.view_id)

        code = run_homes(args, [home], observe=observe)
        # If the demo made nothing, write no sheets: any files in its folder are from an earlier
        # run.
        if not whole - failed:
            return code or 1
        write_sheets(Path(args.out), 24, parts)
    if not args.json:
        echo(_NEXT.format(out=args.out))
    return code


_NEXT = """
Open {out}/index.html in a browser. Next:
  pbrs-farm board {out}                  show every layer, relight views, the home in 3D
  pbrs-farm verify {out}                 check all labels
  pbrs-farm run MY-HOME.sh3d --dress 1   render your home; `pbrs-farm homes` lists nine"""


def _demo_dressing(args: argparse.Namespace) -> str | None:
    """The seeds for dressing the demo's home; None without furniture to dress it with."""
    from pbrs_farm.assets import furniture_package
    from pbrs_farm.prepare.dress_catalogue import GENERATED, fetch_catalogue

    if args.bare:
        return None
    fields = recipe_of(args).dress
    if GENERATED not in fields.catalogue.split(":") and furniture_package.cached() is None:
        warn("fetching the furniture, 120 MB, once")
    try:
        fetch_catalogue(fields)
    except MachineFailed as error:
        warn(f"the furniture cannot be fetched: {error}")
        warn("going on with the home as it was drawn")
        return None
    return args.dress or "1"


def _step(args: argparse.Namespace) -> None:
    from pbrs_farm.prepare.source import resolve, variants
    from pbrs_farm.run.house_cache import HouseCache
    from pbrs_farm.run.plan import STEPS, needed_of_house
    from pbrs_farm.run.step_cache import Work
    from pbrs_farm.run.steps import run_step

    # Use the stored recipe, to repeat the step of the run.
    if args.step not in STEPS:
        raise BadInput("step", args.step, "no such step", hint=hint_of_choice(args.step, STEPS))
    store = store_of(args.out)
    recipe = recipe_from_json(store.get("recipe.json"), f"{store.url}: recipe.json")
    (source,) = variants(resolve(args.home, models=args.models), [args.dress or recipe.dress.seed])
    # One process and one house: the cache keeps the house for all steps.
    work = Work(
        store=store,
        recipe=recipe,
        house_id=source.house_id,
        house_cache=HouseCache(),
        source=source,
        view_id=args.view,
        layers=tuple(args.layers),
    )
    # First make the missing inputs of the step.
    for name in needed_of_house(args.step, source.house_id):
        run_step(name, replace(work, view_id=None))
    outcome = run_step(args.step, work)
    verdict = "already done" if outcome.was_done else f"done in {outcome.marker.seconds} s"
    echo(f"{args.step}: {verdict}")
    for file in outcome.marker.files:
        echo(f"  {file.key}  {file.n_bytes} bytes")


def _objects(args: argparse.Namespace) -> int:
    from pbrs_farm.prepare.home_kinds import object_source
    from pbrs_farm.read.common.source_files import SourceFiles
    from pbrs_farm.read.objects.model_folders import pick_models

    if args.count < 1:
        raise BadInput("--count", str(args.count), "expected at least one model")
    categories = args.categories.split(",") if args.categories else []
    models, refused = _models_at(args.models)
    # Pick at random by the recipe's seed: the same models each time.
    files = SourceFiles()
    chosen = pick_models(models, categories, args.count, recipe_of(args).seed)
    sources = [object_source(model, files) for model in chosen]
    return run_homes(args, [], sources, refused)


def _models_at(paths: Sequence[Path]) -> tuple[list[ObjectModel], list[tuple[str, str]]]:
    """The distinct models below paths, and (path, reason) of paths without one."""
    from pbrs_farm.read.objects.model_folders import find_models

    models: dict[str, ObjectModel] = {}
    refused = []
    for path in paths:
        # Skip a path without a model, unless it is the only one.
        try:
            models |= {model.id: model for model in find_models([path])}
        except BadInput as error:
            if len(paths) == 1:
                raise
            refused.append((str(path), str(error)))
    return list(models.values()), refused
