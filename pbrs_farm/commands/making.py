"""Verbs that make: demo, run, objects, step. Effects: those of the run."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrs_farm.commands.arguments import (
    Verb,
    add_light,
    add_recipe,
    complain,
    counted,
    recipe_of,
    say,
)
from pbrs_farm.commands.using import write_sheets
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.recipe import Recipe

if TYPE_CHECKING:
    from pbrs_farm.read.source import SourceRef


def add_verbs(verb: Verb) -> None:
    """Add demo, run, objects and step."""
    p = verb("demo", _demo, "render an example home and lay out a sheet: out/demo/sheet.png")
    p.add_argument(
        "--home", default="Studio", help="example home, `builtin`, or a file (default Studio)"
    )
    p.add_argument("--out", default="out/demo", help="output folder")
    add_recipe(p, "preview")
    add_light(p)
    _add_run(p)
    p = verb("run", _run, "houses -> repaired houses -> cameras -> pictures and labels")
    p.add_argument(
        "homes",
        nargs="*",
        metavar="HOME",
        help="file, SUNCG house folder, example home's name, or `builtin`",
    )
    p.add_argument(
        "--home", action="append", default=[], metavar="PATH", help="the same, repeatable"
    )
    p.add_argument(
        "--houses", metavar="LIST", help="file with a SUNCG house id a line (HOME is the root)"
    )
    p.add_argument("--out", required=True, help="output folder or store URL")
    p.add_argument(
        "--cameras", choices=("sampled", "stored"), default=None, help="where viewpoints come from"
    )
    p.add_argument(
        "--camera-file", type=Path, default=None, help="your own: JSON list, or room_camera.txt"
    )
    add_recipe(p)
    add_light(p)
    _add_run(p)
    p = verb(
        "objects", _objects, "single models without context: 20 views each (paper section 4.1)"
    )
    p.add_argument(
        "models",
        nargs="+",
        type=Path,
        metavar="MODELS",
        help="folders of OBJ or GLB (ShapeNet's layout too), .sh3f libraries",
    )
    p.add_argument(
        "--categories", default="", metavar="A,B", help="e.g. bed,chair,cabinet (default all)"
    )
    p.add_argument(
        "--count",
        type=int,
        default=3500,
        metavar="N",
        help="models picked at random (default 3500)",
    )
    p.add_argument("--out", required=True, help="output folder or store URL")
    add_recipe(p)
    add_light(p)
    _add_run(p)
    p = verb("step", _step, "one step in this process: reproduces a failure")
    p.add_argument("step")
    p.add_argument("home")
    p.add_argument("--out", required=True)
    p.add_argument("--view", default=None)
    p.add_argument("--layers", nargs="+", default=[])


def _add_run(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--modes",
        nargs="+",
        default=[],
        metavar="MODE",
        help="opengl_dl opengl_il mlt_ol mlt_il_ol (default all)",
    )
    p.add_argument(
        "--layers", nargs="+", default=[], metavar="LAYER", help="optional layers to write too"
    )
    p.add_argument("--views", type=int, default=0, metavar="N", help="at most N views a house")
    p.add_argument(
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="processes (default 1; each view uses all cores)",
    )
    p.add_argument(
        "--step-timeout", type=float, default=3600.0, metavar="S", help="seconds a step may take"
    )
    p.add_argument(
        "--update",
        action="store_true",
        help="give the output folder this recipe, rendering again what differs",
    )
    p.add_argument("--json", action="store_true", help="a JSON line per event")


def _words(args: argparse.Namespace) -> list[str]:
    from pbrs_farm.read.source import suncg_list

    words = [*args.homes, *args.home]
    if args.houses:
        if len(words) != 1:
            raise BadInput("--houses", args.houses, "needs the SUNCG root as the one HOME")
        words = suncg_list(Path(words[0]), Path(args.houses))
    if not words:
        raise BadInput(
            "run", "", "no home given", hint="a file, an example home's name, or builtin"
        )
    return words


def _run(args: argparse.Namespace) -> int:
    return _run_words(args, _words(args))


def _run_words(
    args: argparse.Namespace, words: list[str], sources: Sequence[SourceRef] = ()
) -> int:
    from pbrs_farm.progress import progress_reporter
    from pbrs_farm.run.local import Run, run_local
    from pbrs_farm.run.plan import wanted
    from pbrs_farm.settings import settings_from_environment

    for name, value, least in (("--jobs", args.jobs, 1), ("--views", args.views, 0)):
        if value < least:
            raise BadInput(name, str(value), f"expected {least} or more")
    run = Run(
        homes=words,
        store_url=args.out,
        recipe=recipe_of(args),
        want=wanted(args.modes, args.layers, args.views),
        n_jobs=args.jobs,
        update=args.update,
        step_timeout_s=args.step_timeout,
        debug=args.debug,
        store=settings_from_environment().store,
        sources=sources,
    )
    _warn_of_slowness()
    started = time.monotonic()
    n_homes = len(words) + len(sources)
    with progress_reporter(n_homes, args.views, as_json=args.json) as report:
        summary = run_local(run, report)
    seconds = time.monotonic() - started
    _report(args, summary, seconds)
    return 1 if summary.failures or summary.n_views == 0 else 0


def _warn_of_slowness() -> None:
    """Say it when only the scalar variant is left."""
    from pbrs_farm.raycast.variant import MIN_LLVM, find_llvm

    if find_llvm() is None and not Path("/proc/driver/nvidia").exists():
        complain(
            f"no LLVM of version {MIN_LLVM} or later: going on with Mitsuba's scalar_rgb, several"
            " times slower (sudo apt-get install -y libllvm19)"
        )


def _report(args: argparse.Namespace, summary: Any, seconds: float) -> None:
    if args.json:
        row = {
            "event": "summary", "houses": summary.houses, "views": summary.n_views,
            "steps_done": summary.n_done, "steps_kept": summary.n_kept,
            "seconds": round(seconds, 1), "peak_mb": round(summary.peak_mb),
            "without_views": [list(pair) for pair in summary.without_views],
            "failures": [dict(zip(("what", "message", "command"), f, strict=True)) for f in summary.failures],
        }  # fmt: skip
        say(json.dumps(row))
        return
    say(
        f"{counted(len(summary.houses), 'house')}, {counted(summary.n_views, 'view')}: "
        f"{counted(summary.n_done, 'step')} done, "
        f"{summary.n_kept} already there, {len(summary.failures)} failed; "
        f"{seconds:.1f} s, peak {summary.peak_mb:.0f} MB a process"
    )
    for house, why in summary.without_views:
        complain(f"{house}: no view: {why}")
    for what, message, command in summary.failures:
        if command:  # the message was printed when it happened
            complain(f"{what} failed; reproduce: {command}")
        else:
            complain(message if message.startswith(what) else f"{what}: {message}")


def _demo(args: argparse.Namespace) -> int:
    words = [args.home]
    if args.home not in ("builtin",) and not Path(args.home).exists():
        from pbrs_farm.assets import homes

        try:
            homes.fetch()
        except (MachineFailed, BadInput) as error:
            complain(f"the example homes cannot be fetched: {error}")
            complain("going on with the built-in home")
            words = ["builtin"]
    code = _run_words(args, words)
    folder = Path(args.out)
    write_sheets(folder, 24)
    return code


def _step(args: argparse.Namespace) -> int:
    from pbrs_farm.read.source import resolve
    from pbrs_farm.run.house_cache import HouseCache
    from pbrs_farm.run.plan import STEPS
    from pbrs_farm.run.step_cache import Work
    from pbrs_farm.run.steps import run_step
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    if args.step not in STEPS:
        raise BadInput("step", args.step, "no such step", hint=f"of {', '.join(STEPS)}")
    store = store_from_url(args.out, settings_from_environment().store)
    recipe = Recipe.model_validate_json(store.get("recipe.json"))
    source = resolve(args.home)
    work = Work(
        store=store, recipe=recipe, house_id=source.house_id, house_cache=HouseCache(), source=source,
        view_id=args.view, layers=tuple(args.layers),
    )  # fmt: skip
    outcome = run_step(args.step, work)
    verdict = "already done" if outcome.was_done else f"done in {outcome.marker.seconds} s"
    say(f"{args.step}: {verdict}")
    for file in outcome.marker.files:
        say(f"  {file.key}  {file.n_bytes} bytes")
    return 0


def _objects(args: argparse.Namespace) -> int:
    from pbrs_farm.read.common.companion_files import SourceFiles
    from pbrs_farm.read.objects.model_folders import find_models, pick_models
    from pbrs_farm.read.source import object_source

    if args.count < 1:
        raise BadInput("--count", str(args.count), "expected at least one model")
    categories = args.categories.split(",") if args.categories else []
    models = find_models(args.models)
    files = SourceFiles()
    chosen = pick_models(models, categories, args.count, recipe_of(args).seed)
    return _run_words(args, [], [object_source(model, files) for model in chosen])
