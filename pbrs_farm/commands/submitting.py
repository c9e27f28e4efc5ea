"""The verb that puts houses on the farm: submit. Effects: reads homes; the store, Redis, stdout."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
from workers.ids import DEFAULT_PRIORITY, LEAST_URGENT

if TYPE_CHECKING:
    from workers.job import JobSpec


def add_verbs(verb: Verb) -> None:
    """Add submit."""
    p = verb("submit", _submit, "put houses on the farm")
    add_farm(p)
    p.add_argument("homes", nargs="+", metavar="HOME", help="files, folders, example homes")
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
    p.add_argument("--update", action="store_true", help="give the store this recipe")
    p.add_argument("--dry-run", action="store_true", help="print tasks, hours, storage; do nothing")
    p.add_argument("--slots", type=int, default=2, help="for --dry-run: tasks at once")


def _submit(args: argparse.Namespace) -> int:
    from pbrs_farm.run.dressed_house import uses_catalogue
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
        return 0
    # Fail before anything is uploaded where Redis does not answer or no worker has the store.
    farm = farm_of(args)
    farm.ledger.ping()
    farm.check_store()
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
        return 0
    # The same homes and recipe are the same job.
    if job.was:
        warn(f"this job is there already, {job.was}")
    echo(job.job_id)
    return 0


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
    want = wanted(args.modes, args.layers, views_wanted(args))
    recipe = recipe_of(args)
    return new_spec(
        recipe,
        modes=tuple(m.value for m in want.modes),
        layers=want.layers,
        n_views=want.n_views,
        gpu=args.gpu,
        priority=args.priority,
        batch_stages=batch_stages(want),
        seconds_per_view=seconds_per_view(recipe),
    )
