"""The verb homes: list and fetch the example homes, make new ones. Effects: prints; downloads; writes homes."""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pbrs_farm.commands.arguments import Verb, at_least, counted, echo, echo_json, warn
from pbrs_farm.commands.command_line import add_arguments
from pbrs_farm.core.errors import BadInput, MachineFailed

if TYPE_CHECKING:
    from pbrs_farm.core.catalogue import Catalogue
    from pbrs_farm.core.made_home import MadeHome
    from pbrs_farm.generate.programme import Programme

_SAY_EVERY_S: Final = 5.0


def add_verbs(verb: Verb) -> None:
    """Add homes and its subcommand make."""
    from pbrs_farm.core.made_home import PLANS

    parts = verb("homes", _homes).add_subparsers(metavar="make")
    text = "generate furnished homes as .sh3d files, with their plans in plans.html"
    p = parts.add_parser("make", help=text, description=text)
    p.set_defaults(handler=_make)
    add_arguments(p, "homes:make")
    text = f"type of floor plan (default: drawn by the seed): {', '.join(PLANS)}"
    p.add_argument("--plans", metavar="NAME", help=text)


def _homes(args: argparse.Namespace) -> None:
    from pbrs_farm.assets import furniture_package, homes_package

    if args.fetch:
        homes_package.fetch()
    if args.furniture:
        furniture_package.fetch()
    rows = homes_package.example_homes()
    if args.json:
        echo_json([asdict(row) for row in rows])
        return
    # Listing fetches nothing: the list of homes is part of the program.
    package = homes_package.cached()
    for row in rows:
        levels = counted(row.n_levels, "level")
        echo(f"{row.name:<34} {row.n_rooms:>2} rooms, {levels}")
    echo(f"{'builtin':<34}  2 rooms, 1 level: part of pbrs_farm, no download")
    echo(f"{'made:SEED, made:1..20,rooms=2..4':<34}  generated homes, one for each seed")
    echo()
    echo(f"fetched: {package.label}" if package else "not downloaded yet: pbrs-farm homes --fetch")
    if package and package.note:
        echo(package.note)
    echo("home and models: E. and V. Puybaret / eTeks, CC-BY 3.0")


def _make(args: argparse.Namespace) -> int:
    from pbrs_farm.gallery.made_homes import make_homes

    if args.count < 1:
        raise BadInput("homes make", str(args.count), "expected 1 home or more")
    if args.plan:
        return _make_of_plan(args)
    homes, programme = _asked_for(args)
    if not args.empty:
        catalogue_here()
    # Homes arrive in the order of their seeds; print the progress every _SAY_EVERY_S seconds.
    started = last_report = time.monotonic()
    n_new = 0
    _folder(args.out)
    failed = []
    for number, done in enumerate(make_homes(homes, args.out, programme, n_jobs=args.jobs), 1):
        n_new += done.is_new
        if done.fault:
            failed.append(done)
            warn(done.fault)
        if time.monotonic() - last_report > _SAY_EVERY_S:
            last_report = time.monotonic()
            echo(f"{number} of {len(homes)} homes")
    # Homes neither new nor failed come from an earlier run.
    n_kept = len(homes) - n_new - len(failed)
    text = f"{counted(n_new, 'home')} made in {time.monotonic() - started:.0f} s"
    echo(text + (f", {n_kept} kept" if n_kept else "") + f": {args.out / 'plans.html'}")
    return 1 if failed else 0


def _make_of_plan(args: argparse.Namespace) -> int:
    """Furnish the user's own plan, once for each seed."""
    from pbrs_farm.core.catalogue import EMPTY
    from pbrs_farm.gallery.made_homes import write_home
    from pbrs_farm.generate.plans.plan_format import Part
    from pbrs_farm.prepare.formats import format_of_file
    from pbrs_farm.prepare.plan_house import furnish_plan_file, plan_of_file
    from pbrs_farm.read.common.format import PLAN, GivenFile

    at_least("--floor", args.floor or 0, 0)
    # The plan fixes the rooms, so options about rooms contradict it.
    options = [
        f"--{k}" for k in ("rooms", "area", "storeys", "offices", "programme") if getattr(args, k)
    ]
    if options:
        raise BadInput("--plan", str(args.plan), f"fixes the rooms: omit {options[0]}")
    entry = format_of_file(args.plan)
    if entry is not None and entry.kind != PLAN:
        hint = f"`pbrs-farm run {args.plan}` reads it"
        raise BadInput(args.plan, "", f"is a house ({entry.kind}), not a floor plan", hint=hint)
    plan_file = plan_of_file(GivenFile(args.plan), Part(args.apartment, args.floor))
    for line in plan_file.left_out:
        warn(f"left out: {line}")
    catalogue = EMPTY if args.empty else catalogue_here()
    _folder(args.out)
    for seed in range(args.seed, args.seed + args.count):
        name = args.plan.stem if args.count == 1 else f"{args.plan.stem}-{seed}"
        style = args.style or ""
        home = furnish_plan_file(plan_file, catalogue, seed=seed, style=style, name=name)
        write_home(args.out / f"{name}.sh3d", home)
        echo(str(args.out / f"{name}.sh3d"))
    return 0


def _folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = "is not a folder" if path.exists() else error.strerror or "cannot be made"
        raise BadInput(path, "", text) from None


def _asked_for(args: argparse.Namespace) -> tuple[list[MadeHome], Programme | None]:
    """The homes named by the options; raises BadInput as the words of `run` do."""
    from pbrs_farm.core.made_home import made_homes
    from pbrs_farm.generate.programme_file import programme_from_json

    if args.apartment:
        raise BadInput("--apartment", args.apartment, "needs --plan FILE.csv")
    if args.floor is not None:
        raise BadInput("--floor", str(args.floor), "needs --plan FILE")
    options = [
        f"{k}={v}"
        for k in ("rooms", "area", "style", "plans", "storeys", "offices")
        if (v := getattr(args, k))
    ]
    options += ["furniture=none"] * args.empty
    chosen = [f"--{k}" for k in ("rooms", "area", "offices") if args.programme and getattr(args, k)]
    if args.programme and args.storeys not in (None, "1"):
        raise BadInput(
            "--programme",
            str(args.programme),
            "describes one storey only",
            hint="omit --storeys, or omit --programme: --storeys 2 --rooms 2..4 --area 90..150",
        )
    if chosen:
        raise BadInput("--programme", str(args.programme), f"fixes the rooms: omit {chosen[0]}")
    if args.seed < 0:
        raise BadInput("--seed", str(args.seed), "is below 0", hint="--seed 1")
    first, last = args.seed, args.seed + args.count - 1
    homes = made_homes(",".join((f"made:{first}..{last}", *options)))
    return homes, programme_from_json(args.programme) if args.programme else None


def catalogue_here() -> Catalogue:
    """The packages' furniture, to make homes with; MachineFailed, with the command, if not cached."""
    from pbrs_farm.prepare.dress_catalogue import catalogue_of_words, has_furniture

    if not has_furniture():
        raise MachineFailed(
            "generated homes need the furniture package, which is not downloaded",
            hint="`pbrs-farm homes --furniture` (120 MB), or --empty",
        )
    return catalogue_of_words("")
