"""The verb that puts houses on the farm: submit. Effects: reads homes; the store, Redis, stdout."""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrs_farm.commands.arguments import (
    Verb,
    add_dress,
    add_farm,
    add_light,
    add_models,
    add_output,
    add_recipe,
    at_least,
    counted,
    dress_seeds,
    echo,
    echo_json,
    farm_of,
    home_arguments,
    recipe_of,
    views_wanted,
    warn,
)
from pbrs_farm.commands.job_file import job_file, job_like, option_words, submit_arguments
from pbrs_farm.core.errors import BadInput
from workers.ids import DEFAULT_PRIORITY, LEAST_URGENT, check_job_id
from workers.ledger.task_ledger import WITH_FAILURES

if TYPE_CHECKING:
    from workers.job import JobSpec


def add_verbs(verb: Verb) -> None:
    """Add submit."""
    p = verb("submit", _submit, "put houses on the farm")
    add_farm(p)
    p.set_defaults(parser=p)
    text = "files, folders, example homes; or one job.toml that says all (docs/farm.md)"
    p.add_argument("homes", nargs="+", metavar="HOME", help=text)
    text = "file with a SUNCG house id a line (HOME: root)"
    p.add_argument("--houses", metavar="LIST", help=text)
    add_models(p)
    add_dress(p)
    add_recipe(p)
    add_light(p)
    add_output(p)
    p.add_argument("--reference", type=Path, help="reference file: select when the job ends")
    p.add_argument("--gpu", action="store_true", help="light goes to the queue light.gpu")
    p.add_argument(
        "--priority", type=int, default=DEFAULT_PRIORITY, choices=range(LEAST_URGENT + 1),
        help=f"0 goes first, {LEAST_URGENT} last",
    )  # fmt: skip
    text = "tasks of it in flight at once, at most (0: as many as there are slots)"
    p.add_argument("--max-slots", type=int, default=0, metavar="N", help=text)
    text = "slot-hours after which it pauses itself (0: none)"
    p.add_argument("--budget", type=float, default=0.0, metavar="HOURS", help=text)
    text = "begin when this job is done, repeatable"
    p.add_argument("--after", action="append", default=[], metavar="JOB", help=text)
    text = "urgent: running tasks of other jobs make room, and keep what they have rendered"
    p.add_argument("--preempt", action="store_true", help=text)
    text = "a job.toml as a template: its options, for the homes that are named here"
    p.add_argument("--like", default="", metavar="FILE", help=text)
    p.add_argument("--update", action="store_true", help="give the store this recipe")
    p.add_argument("--dry-run", action="store_true", help="print tasks, hours, storage; do nothing")
    p.add_argument("--slots", type=int, default=2, help="for --dry-run: tasks at once")


def _submit(args: argparse.Namespace) -> int:
    described = job_like(args.like, args.homes) if args.like else job_file(args.homes)
    if described is not None:
        return _submit_file(args, described)
    _submitted(args)
    return 0


def _submitted(args: argparse.Namespace) -> str:
    """Put the houses on the farm; the job's id, "" after a dry run."""
    from pbrs_farm.prepare.passes import uses_catalogue
    from workers.client.estimate import estimate
    from workers.client.farm_client import completed
    from workers.house_files import (
        entries_from_arguments,
        is_left_in_place,
        needed_plugins,
        placed_reference,
        upload,
        upload_catalogue,
    )

    spec = _spec(args)
    # Read the homes: what each is, and where workers will find it.
    seeds = dress_seeds(args.dress) or (spec.recipe.dress.seed,)
    found = entries_from_arguments(
        home_arguments(args.homes, args.houses), seeds, models=args.models
    )
    reference = placed_reference(args.reference) if args.reference else ("", b"")
    spec = spec.model_copy(update={"reference": reference[0]})
    houses, refs = [entry for entry, _ref in found], [ref for _entry, ref in found]
    _warn_of_paths([ref.location for ref in refs if is_left_in_place(ref)])
    # Estimate, and touch neither the store nor Redis.
    if args.dry_run:
        plan = estimate(completed(houses, spec)[1], args.slots)
        if args.json:
            echo_json(plan)
        else:
            echo("\n".join(f"{k:<14}{v}" for k, v in plan.items()))
        return ""
    # Fail before anything is uploaded where Redis does not answer or no worker has the store.
    farm = farm_of(args)
    farm.ledger.ping()
    farm.check_store()
    farm.rights.who()
    if spec.preempt:
        farm.rights.check_preempt()
    for before in spec.after:
        farm.view(before)
    for line in farm.check_plugins(needed_plugins(refs, spec.recipe, spec.layers)):
        warn(line)
    if any(uses_catalogue(ref, spec.recipe) for ref in refs):
        recipe = upload_catalogue(farm.store, spec.recipe)
        spec = spec.model_copy(update={"recipe": recipe})
    upload(farm.store, refs)
    if reference[0]:
        farm.store.put_if_absent(*reference)
    job = farm.submit(houses, spec, update=args.update)
    if args.json:
        echo_json({"job": job.job_id, "houses": job.n_houses, "was": job.was})
        return job.job_id
    # The same homes and recipe are the same job.
    if job.was:
        warn(f"this job is there already, {job.was}")
    echo(job.job_id)
    return job.job_id


def _submit_file(args: argparse.Namespace, job: dict[str, Any]) -> int:
    """Submit what a job.toml says; with a table pack, wait for the job's end and pack its views."""
    file = args.like or args.homes[0]
    chosen = submit_arguments(job, args, args.parser, file)
    pack = option_words(job.get("pack", {}), file)
    name = _submitted(chosen)
    if not pack or not name:
        return 0
    farm = farm_of(chosen)
    warn(f"packing when job {name} is done; this command may be ended and begun again")
    while (state := farm.view(name).outcome) not in ("done", WITH_FAILURES):
        if state == "cancelled":
            raise BadInput(name, "", "was cancelled: nothing is packed")
        time.sleep(2.0)
    selected = ["--selection", name] if job.get("select", {}).get("reference") else []
    command = [sys.executable, "-m", "pbrs_farm.cli", "pack", farm.store.url, *selected, *pack]
    return subprocess.run(command, check=False).returncode


def _warn_of_paths(in_place: Sequence[str]) -> None:
    """Warn of sources that are read where they lie."""
    if in_place:
        where = f"{in_place[0]}{' ...' if len(in_place) > 1 else ''}"
        count = counted(len(in_place), "house")
        warn(f"{count} not uploaded: {where}; workers must see that path")


def _spec(args: argparse.Namespace) -> JobSpec:
    """What the job is made with, its houses apart; raises BadInput, BadRecipe."""
    from pbrs_farm.run.plan import wanted
    from workers.client.estimate import seconds_per_view
    from workers.client.farm_client import new_spec
    from workers.node.house_runner import batch_stages

    at_least("--slots", args.slots, 1)
    at_least("--max-slots", args.max_slots, 0)
    if not 0 <= args.budget < math.inf:
        raise BadInput("--budget", args.budget, "expected slot-hours, 0 or more")
    want = wanted(args.modes, args.layers, views_wanted(args))
    recipe = recipe_of(args)
    return new_spec(
        recipe,
        modes=tuple(m.value for m in want.modes),
        layers=want.layers,
        n_views=want.n_views,
        gpu=args.gpu,
        priority=args.priority,
        max_slots=args.max_slots,
        budget_h=args.budget,
        preempt=args.preempt,
        after=tuple(check_job_id(job) for job in args.after),
        batch_stages=batch_stages(want),
        seconds_per_view=seconds_per_view(recipe),
    )
