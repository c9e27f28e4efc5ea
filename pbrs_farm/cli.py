"""The `pbrs-farm` command: words -> calls; prints what users read. Effects: all of them, through others.

Exit codes: 0 done; 1 something failed, the rest was done; 2 the words are wrong; 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pbrs_farm
from pbrs_farm.errors import BadInput, MachineFailed, PbrsError
from pbrs_farm.recipe import RECIPE_NAMES, Recipe, recipe_from_name

Handler = Callable[[argparse.Namespace], int]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    parser = build_parser()
    args = parser.parse_args(arguments)
    if not hasattr(args, "handler"):
        parser.print_help()
        return 2
    try:
        return int(args.handler(args))
    except PbrsError as error:
        if args.debug:
            traceback.print_exc()
        _complain(str(error))
        return 1
    except KeyboardInterrupt:
        _complain("interrupted; the same command goes on where it stopped")
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _complain(text: str) -> None:
    sys.stderr.write(f"pbrs-farm: {text}\n")


def _say(text: str = "") -> None:
    sys.stdout.write(text + "\n")


def _dump(value: Any) -> None:
    _say(json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False))


def build_parser() -> argparse.ArgumentParser:
    """All verbs; the farm's are added when their packages are installed."""
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show tracebacks")
    parser = argparse.ArgumentParser(
        prog="pbrs-farm",
        description="Houses designed by people in, physically-based training images with exact labels out.",
    )
    parser.add_argument("--version", action="version", version=pbrs_farm.__version__)
    parser.set_defaults(debug=False)
    verbs = parser.add_subparsers(title="verbs", metavar="VERB")

    def verb(name: str, handler: Handler, text: str) -> argparse.ArgumentParser:
        sub = verbs.add_parser(name, help=text, description=text, parents=[common])
        sub.set_defaults(handler=handler)
        return sub

    _add_looking(verb)
    _add_making(verb)
    _add_using(verb)
    _add_farm(verbs, common)
    return parser


Verb = Callable[[str, Handler, str], argparse.ArgumentParser]


def _add_looking(verb: Verb) -> None:
    p = verb("doctor", _doctor, "what this machine can do, and what to do about what is missing")
    p.add_argument("--json", action="store_true", help="for machines")
    p.add_argument("--store", default=os.environ.get("PBRS_STORE", ""), help="store to try")
    p.add_argument("--redis", default=os.environ.get("PBRS_REDIS_URL", ""), help="Redis to try")
    p = verb("homes", _homes, "list the example homes; fetch them from the Debian package")
    p.add_argument("--fetch", action="store_true", help="download the package now")
    p.add_argument("--json", action="store_true", help="for machines")
    p = verb("recipes", _recipes, "every field of a recipe and its value")
    p.add_argument("name", nargs="?", default="fast", choices=RECIPE_NAMES)
    p = verb("layers", _layers, "the table of the files of a view")


def _add_recipe(p: argparse.ArgumentParser, default: str = "fast") -> None:
    p.add_argument(
        "--recipe", default=default, help=f"{', '.join(RECIPE_NAMES)} (default {default})"
    )
    p.add_argument(
        "--set", action="append", default=[], metavar="GROUP.FIELD=VALUE", help="override a field"
    )
    p.add_argument("--seed", type=int, default=None, help="the recipe's seed (default 0)")
    p.add_argument("--size", default=None, metavar="WxH", help="picture size, e.g. 640x480")
    p.add_argument("--strict", action="store_true", help="recoverable faults of a home are errors")


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


def _add_making(verb: Verb) -> None:
    p = verb("demo", _demo, "render an example home and lay out a sheet: out/demo/sheet.png")
    p.add_argument(
        "--home", default="Studio", help="example home, `builtin`, or a file (default Studio)"
    )
    p.add_argument("--out", default="out/demo", help="output folder")
    _add_recipe(p, "preview")
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
    _add_recipe(p)
    _add_run(p)
    p = verb("step", _step, "one step in this process: reproduces a failure")
    p.add_argument("step")
    p.add_argument("home")
    p.add_argument("--out", required=True)
    p.add_argument("--view", default=None)
    p.add_argument("--layers", nargs="+", default=[])


def _add_using(verb: Verb) -> None:
    p = verb(
        "sheet", _sheet, "contact sheet (sheet.png) and gallery (index.html) of an output folder"
    )
    p.add_argument("folder", type=Path)
    p.add_argument("--views", type=int, default=24, help="rows of the contact sheet (default 24)")


def _add_farm(verbs: Any, common: argparse.ArgumentParser) -> None:
    """The farm's verbs: imported only here, and only when celery and redis are installed."""
    try:
        from workers.cli import add_verbs
    except ImportError:
        return
    add_verbs(verbs, common)


# What each verb does.


def _doctor(args: argparse.Namespace) -> int:
    from dataclasses import asdict

    from pbrs_farm.farm.doctor import can_run, examine

    findings = examine(args.store, args.redis)
    fine = can_run(findings)
    if args.json:
        _dump({"can_run": fine, "findings": [asdict(f) for f in findings]})
        return 0 if fine else 1
    for f in findings:
        mark = {"ok": "ok      ", "degraded": "degraded", "missing": "MISSING "}[f.state]
        _say(f"{mark}  {f.part:<20} {f.text}")
        if f.state != "ok" and f.remedy:
            _say(f"{'':<32}-> {f.remedy}")
    _say()
    _say(
        "This machine can render." if fine else "This machine cannot render yet: see MISSING above."
    )
    return 0 if fine else 1


def _homes(args: argparse.Namespace) -> int:
    from dataclasses import asdict

    from pbrs_farm import homes

    if args.fetch:
        homes.fetch()
    rows = homes.example_homes()
    if args.json:
        _dump([asdict(row) for row in rows])
        return 0
    package = homes.cached()
    for row in rows:
        _say(f"{row.name:<34} {row.n_rooms:>2} rooms, {row.n_levels} levels")
    _say()
    _say(f"fetched: {package.label}" if package else "not fetched yet: pbrs-farm homes --fetch")
    if package and package.note:
        _say(package.note)
    _say("home and models: E. and V. Puybaret / eTeks, CC-BY 3.0")
    return 0


def _recipes(args: argparse.Namespace) -> int:
    recipe = recipe_from_name(args.name)
    _say(f"# recipe {args.name}; --set group.field=value overrides any field")
    for group, info in Recipe.model_fields.items():
        value = getattr(recipe, group)
        if not hasattr(type(value), "model_fields"):
            _say(f"{group} = {json.dumps(value)}")
            continue
        _say(f"\n# {info.annotation.__doc__ if info.annotation else ''}")
        for name, field in type(value).model_fields.items():
            text = f"{group}.{name} = {json.dumps(getattr(value, name))}"
            _say(f"{text:<48} # {field.description}" if field.description else text)
    return 0


def _layers(_args: argparse.Namespace) -> int:
    from pbrs_farm.layers import table

    _say(table())
    return 0


def recipe_of(args: argparse.Namespace) -> Recipe:
    """The recipe named by the words of a command; raises BadRecipe."""
    overrides: dict[str, str] = {}
    for word in args.set:
        path, equals, text = word.partition("=")
        if not equals:
            raise BadInput("--set", word, "expected group.field=value")
        overrides[path] = text
    if args.size is not None:
        width, _, height = args.size.partition("x")
        overrides |= {"image.width_px": width, "image.height_px": height}
    if args.seed is not None:
        overrides["seed"] = str(args.seed)
    if args.strict:
        overrides["read.strict"] = "true"
    if getattr(args, "cameras", None):
        overrides["cameras.source"] = args.cameras
    return recipe_from_name(args.recipe, overrides)


def _words(args: argparse.Namespace) -> list[str]:
    from pbrs_farm.farm.sources import suncg_list

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


def _run_words(args: argparse.Namespace, words: list[str]) -> int:
    from pbrs_farm.farm.local import Run, run_local
    from pbrs_farm.farm.plan import wanted
    from pbrs_farm.progress import teller
    from pbrs_farm.settings import settings_from_environment

    if args.jobs < 1 or args.views < 0:
        raise BadInput("run", "--jobs/--views", "expected a positive number")
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
    )
    started = time.monotonic()
    with teller(len(words), args.views, as_json=args.json) as tell:
        summary = run_local(run, tell)
    seconds = time.monotonic() - started
    _report(args, summary, seconds)
    return 1 if summary.failures else 0


def _report(args: argparse.Namespace, summary: Any, seconds: float) -> None:
    if args.json:
        row = {
            "event": "summary", "houses": summary.houses, "views": summary.n_views,
            "steps_done": summary.n_done, "steps_kept": summary.n_kept,
            "seconds": round(seconds, 1), "peak_mb": round(summary.peak_mb),
            "failures": [dict(zip(("what", "message", "command"), f, strict=True)) for f in summary.failures],
        }  # fmt: skip
        _say(json.dumps(row))
        return
    _say(
        f"{len(summary.houses)} houses, {summary.n_views} views: {summary.n_done} steps done, "
        f"{summary.n_kept} already there, {len(summary.failures)} failed; "
        f"{seconds:.1f} s, peak {summary.peak_mb:.0f} MB a process"
    )
    for what, message, command in summary.failures:
        _complain(f"{what}: {message}")
        if command:
            _complain(f"    reproduce: {command}")


def _demo(args: argparse.Namespace) -> int:
    words = [args.home]
    if args.home not in ("builtin",) and not Path(args.home).exists():
        from pbrs_farm import homes

        try:
            homes.fetch()
        except (MachineFailed, BadInput) as error:
            _complain(f"the example homes cannot be fetched: {error}")
            _complain("going on with the built-in home")
            words = ["builtin"]
    code = _run_words(args, words)
    folder = Path(args.out)
    _write_sheets(folder, 24)
    return code


def _step(args: argparse.Namespace) -> int:
    from pbrs_farm.farm.loaded import Shelf
    from pbrs_farm.farm.marked import Work
    from pbrs_farm.farm.plan import STEPS
    from pbrs_farm.farm.sources import resolve
    from pbrs_farm.farm.steps import run_step
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    if args.step not in STEPS:
        raise BadInput("step", args.step, "no such step", hint=f"of {', '.join(STEPS)}")
    store = store_from_url(args.out, settings_from_environment().store)
    recipe = Recipe.model_validate_json(store.get("recipe.json"))
    source = resolve(args.home)
    work = Work(
        store=store, recipe=recipe, house_id=source.house_id, shelf=Shelf(), source=source,
        view_id=args.view, layers=tuple(args.layers),
    )  # fmt: skip
    outcome = run_step(args.step, work)
    verdict = "already done" if outcome.was_done else f"done in {outcome.marker.seconds} s"
    _say(f"{args.step}: {verdict}")
    for file in outcome.marker.files:
        _say(f"  {file.key}  {file.n_bytes} bytes")
    return 0


def _sheet(args: argparse.Namespace) -> int:
    _write_sheets(args.folder, args.views)
    return 0


def _write_sheets(folder: Path, max_views: int) -> None:
    from pbrs_farm.farm.sheet import contact_sheet, gallery
    from pbrs_farm.store.folder import FolderStore

    store = FolderStore(folder)
    store.put("sheet.png", contact_sheet(folder, max_views=max_views))
    store.put("index.html", gallery(folder).encode())
    _say(f"{folder / 'sheet.png'}\n{folder / 'index.html'}")


if __name__ == "__main__":
    sys.exit(main())
