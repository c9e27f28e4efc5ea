"""The verb submit: send houses to the farm. Effects: reads homes; the store, Redis, stdout."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pbrs_farm.commands.arguments import (
    Verb,
    counted,
    dress_seeds,
    echo,
    echo_json,
    farm_of,
    home_arguments,
    recipe_of,
    warn,
)
from pbrs_farm.commands.job_file import job_file, job_like, option_words, submit_arguments
from pbrs_farm.commands.options import add_options, request_from
from pbrs_farm.core.errors import BadInput
from workers.ids import check_job_id
from workers.ledger.task_ledger import WITH_FAILURES

if TYPE_CHECKING:
    from workers.job import JobSpec, SubmitRequest


def add_verbs(verb: Verb) -> None:
    """Add submit."""
    from workers.job import SubmitRequest

    p = verb("submit", _submit)
    p.set_defaults(parser=p)
    add_options(p, SubmitRequest)


def _submit(args: argparse.Namespace) -> int:
    from pbrs_farm.commands.set_file import is_set
    from workers.job import SubmitRequest

    described = job_like(args.like, args.homes) if args.like else job_file(args.homes)
    if described is not None:
        return _submit_file(args, described)
    if not args.like and len(args.homes) == 1 and is_set(args.homes[0]):
        return _submit_set(args)
    _submitted(args, request_from(args, SubmitRequest))
    return 0


def _submitted(args: argparse.Namespace, request: SubmitRequest) -> str:
    """Send the houses to the farm; returns the job's id, "" after a dry run."""
    from pbrs_farm.prepare.passes import uses_catalogue
    from pbrs_farm.store import store_from_url
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

    spec = _spec(request)
    # Resolve the homes, and the paths where workers will read them.
    seeds = dress_seeds(request.dress) or (spec.recipe.dress.seed,)
    entries = entries_from_arguments(
        home_arguments(args.homes, request.houses), seeds, models=request.models
    )
    reference = placed_reference(request.reference) if request.reference else ("", b"")
    spec = spec.model_copy(update={"reference": reference[0]})
    houses, refs = [entry for entry, _ref in entries], [ref for _entry, ref in entries]
    _warn_of_paths([ref.location for ref in refs if is_left_in_place(ref)])
    # Estimate without access to the store or Redis.
    if request.dry_run:
        if args.store:
            store_from_url(args.store)  # refuses an unknown scheme; connects to nothing
        plan = estimate(completed(houses, spec)[1], request.slots)
        if request.as_json:
            echo_json(plan)
        else:
            echo("\n".join(f"{k:<14}{v}" for k, v in plan.items()))
        return ""
    # Fail before any upload if Redis does not answer or no worker has the store.
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
    job = farm.submit(houses, spec, update=request.update)
    if request.as_json:
        echo_json({"job": job.job_id, "houses": job.n_houses, "was": job.was})
        return job.job_id
    # The same homes and recipe are the same job.
    if job.was:
        warn(f"this job already exists, {job.was}")
    echo(job.job_id)
    return job.job_id


def _submit_file(args: argparse.Namespace, job: dict[str, Any]) -> int:
    """Submit the job of a job.toml; with a table pack, wait for the job's end and pack its views."""
    from workers.job import SubmitRequest

    file = args.like or args.homes[0]
    chosen = submit_arguments(job, args, args.parser, file)
    pack = option_words(job.get("pack", {}), file)
    name = _submitted(chosen, request_from(chosen, SubmitRequest))
    if not pack or not name:
        return 0
    farm = farm_of(chosen)
    warn(f"packing when job {name} is done; this command can be stopped and run again")
    while (state := farm.view(name).outcome) not in ("done", WITH_FAILURES):
        if state == "cancelled":
            raise BadInput(name, "", "was cancelled, so nothing is packed")
        time.sleep(2.0)
    selected = ["--selection", name] if job.get("select", {}).get("reference") else []
    command = [sys.executable, "-m", "pbrs_farm.cli", "pack", farm.store.url, *selected, *pack]
    return subprocess.run(command, check=False).returncode


def _submit_set(args: argparse.Namespace) -> int:
    """Submit a part of a data set; after `pull`, `make` writes its forms."""
    from pbrs_farm.commands.set_file import options_given, set_from_word
    from workers.job import SubmitRequest

    data_set = set_from_word(args.homes[0])
    names = [part.name for part in data_set.parts]
    if args.part not in names and (args.part or len(names) > 1):
        text = "no such part" if args.part else "a store has one recipe, so one part"
        raise BadInput("--part", args.part, text, hint=f"of {', '.join(names)}")
    part = next(part for part in data_set.parts if part.name == (args.part or part.name))
    job = {"homes": list(part.homes), "render": options_given(part)}
    chosen = submit_arguments(job, args, args.parser, data_set.file)
    name = _submitted(chosen, request_from(chosen, SubmitRequest))
    if name and not args.json:
        echo(
            f"when it is done: pbrs-farm pull STORE --out OUT/parts/{part.name};"
            f" with all parts there: pbrs-farm make {args.homes[0]} --out OUT"
        )
    return 0


def _warn_of_paths(in_place: Sequence[str]) -> None:
    """Warn of sources that workers read in place, without an upload."""
    if in_place:
        where = f"{in_place[0]}{' ...' if len(in_place) > 1 else ''}"
        count = counted(len(in_place), "house")
        warn(f"{count} not uploaded: {where}; workers must see that path")


def _spec(request: SubmitRequest) -> JobSpec:
    """The job's settings, without its houses; raises BadInput, BadRecipe."""
    from pbrs_farm.run.request import Wanted, wanted_of
    from workers.client.estimate import seconds_per_view
    from workers.client.farm_client import new_spec
    from workers.job import FarmOptions
    from workers.node.house_runner import batch_stages

    for job in request.after:
        check_job_id(job)
    want = wanted_of(request)
    recipe = recipe_of(request)
    return new_spec(
        recipe,
        batch_stages=batch_stages(want),
        seconds_per_view=seconds_per_view(recipe),
        **{name: getattr(want, name) for name in Wanted.model_fields},
        **{name: getattr(request, name) for name in FarmOptions.model_fields},
    )
