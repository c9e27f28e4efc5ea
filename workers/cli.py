"""The farm's verbs of the command line: words -> calls of client.Farm; prints what users read.

Effects: stdout, and the client's. Imported only when celery and redis are installed; none of these
verbs imports mitsuba.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrs_farm.errors import BadInput
from pbrs_farm.recipe import Recipe, recipe_from_name
from workers.show import failures_text, status_text, why_text, workers_text

if TYPE_CHECKING:
    from workers.client import Farm

Handler = Callable[[argparse.Namespace], int]
AddWords = Callable[[argparse.ArgumentParser], None]
RecipeOf = Callable[[argparse.Namespace], Recipe]


def add_verbs(
    verbs: Any,
    common: argparse.ArgumentParser,
    *,
    add_recipe: AddWords | None = None,
    recipe_of: RecipeOf | None = None,
) -> None:
    """Add the farm's verbs. add_recipe, recipe_of: the words of a recipe and what they mean.

    Raises ImportError when the extra `workers` is not installed; imports nothing heavy itself.
    """
    for package in ("celery", "redis"):
        if importlib.util.find_spec(package) is None:
            raise ImportError(package)

    def verb(name: str, handler: Handler, text: str) -> argparse.ArgumentParser:
        sub: argparse.ArgumentParser = verbs.add_parser(
            name, help=text, description=text, parents=[common]
        )
        sub.set_defaults(handler=handler)
        sub.add_argument("--store", default="", metavar="URL", help="default: $PBRS_STORE")
        sub.add_argument("--json", action="store_true", help="for machines")
        return sub

    p = verb("submit", _submitter(recipe_of or _plain_recipe), "put houses on the farm")
    p.add_argument("homes", nargs="+", metavar="HOME", help="files, folders, example homes")
    p.add_argument(
        "--houses", metavar="LIST", help="file with a SUNCG house id a line (HOME: root)"
    )
    (add_recipe or _add_plain_recipe)(p)
    p.add_argument("--modes", nargs="+", default=[], metavar="MODE", help="default: all four")
    p.add_argument("--layers", nargs="+", default=[], metavar="LAYER", help="optional layers")
    p.add_argument("--views", type=int, default=0, metavar="N", help="at most N views a house")
    p.add_argument("--reference", type=Path, help="reference file: select when the job ends")
    p.add_argument("--gpu", action="store_true", help="light goes to the queue light.gpu")
    p.add_argument("--priority", type=int, default=5, choices=range(10), help="0 goes first")
    p.add_argument("--update", action="store_true", help="give the store this recipe")
    p.add_argument("--dry-run", action="store_true", help="print tasks, hours, storage; do nothing")
    p.add_argument("--slots", type=int, default=2, help="for --dry-run: tasks at once")
    p = verb("status", _status, "how far a job is: stages, rate, time left, workers")
    _add_job(p)
    p.add_argument("--watch", action="store_true", help="again every two seconds, to the end")
    p = verb("why", _why, "what a task, a house or a view waits for")
    p.add_argument("task", help="HOUSE, HOUSE/VIEW or HOUSE/UNIT/STAGE")
    _add_job(p, flag=True)
    p = verb("logs", _logs, "the log of a failed or long task")
    p.add_argument("task", help="HOUSE/UNIT/STAGE")
    p.add_argument("--attempt", type=int, default=None)
    _add_job(p, flag=True)
    _add_job(verb("failures", _failures, "what failed for good, alike together"))
    p = verb("retry", _retry, "fresh attempts for failed tasks (all, unless named)")
    p.add_argument("tasks", nargs="*", metavar="TASK")
    _add_job(p, flag=True)
    for name, text in _STEERING.items():
        _add_job(verb(name, _steer, text))
        verbs.choices[name].set_defaults(what=name)
    p = verb("drain", _drain, "a worker finishes what it runs and leaves")
    p.add_argument("worker")
    p.add_argument("--undo", action="store_true", help="let it stay")
    verb("workers", _workers, "the farm's workers")
    p = verb("recover", _recover, "rebuild the ledger of a job from storage")
    p.add_argument("job")
    verb("coordinator", _coordinator, "lead the farm, or stand by")
    p = verb("worker", _worker, "work for the farm until told to leave")
    p.add_argument("--until", type=float, default=None, metavar="S", help="leave after S seconds")


_STEERING = {
    "pause": "start nothing more; what runs, ends",
    "resume": "go on with a paused job",
    "cancel": "stop a job; what is stored stays",
    "reduce": "merge what is there, of a finished or running job",
}


def _add_job(p: argparse.ArgumentParser, *, flag: bool = False) -> None:
    text = "job id (default: the newest)"
    if flag:
        p.add_argument("--job", default="", help=text)
    else:
        p.add_argument("job", nargs="?", default="", help=text)


def _farm(args: argparse.Namespace) -> Farm:
    from workers.client import Farm
    from workers.config import config_from_environment

    config = config_from_environment()
    if args.store:
        url = args.store if "://" in args.store else Path(args.store).absolute().as_uri()
        config = config.model_copy(update={"store_url": url})
    return Farm(config)


def _farm_and_job(args: argparse.Namespace) -> tuple[Farm, str]:
    farm = _farm(args)
    return farm, args.job or farm.newest_job()


def _say(args: argparse.Namespace, value: Any, text: Callable[[], str]) -> None:
    """value as JSON when asked, else the text for people."""
    shown = json.dumps(value, indent=1, sort_keys=True, default=str) if args.json else text()
    sys.stdout.write(shown + "\n")
    sys.stdout.flush()


def _add_plain_recipe(p: argparse.ArgumentParser) -> None:
    p.add_argument("--recipe", default="fast")
    p.add_argument("--set", action="append", default=[], metavar="GROUP.FIELD=VALUE")


def _plain_recipe(args: argparse.Namespace) -> Recipe:
    pairs = [word.partition("=") for word in args.set]
    for path, equals, _text in pairs:
        if not equals:
            raise BadInput("--set", path, "expected group.field=value")
    return recipe_from_name(args.recipe, {path: text for path, _equals, text in pairs})


def _submitter(recipe_of: RecipeOf) -> Handler:
    def submit(args: argparse.Namespace) -> int:
        from pbrs_farm.farm.plan import wanted
        from pbrs_farm.farm.sources import suncg_list
        from workers.client import completed, new_spec
        from workers.estimate import estimate, seconds_per_view
        from workers.houses import group_stages
        from workers.sources import entries_from_words, placed_reference, upload

        words = args.homes
        if args.houses:
            words = suncg_list(Path(words[0]), Path(args.houses))
        want = wanted(args.modes, args.layers, args.views)
        recipe = recipe_of(args)
        found = entries_from_words(words)
        reference = placed_reference(args.reference) if args.reference else ("", b"")
        spec = new_spec(
            recipe,
            modes=tuple(m.value for m in want.modes),
            layers=want.layers,
            n_views=want.n_views,
            reference=reference[0],
            gpu=args.gpu,
            priority=args.priority,
            group_stages=group_stages(want),
            seconds_per_view=seconds_per_view(recipe),
        )
        houses = [entry for entry, _ref in found]
        if args.dry_run:
            _houses, spec = completed(houses, spec)
            plan = estimate(spec, args.slots)
            _say(args, plan, lambda: "\n".join(f"{k:<14}{v}" for k, v in plan.items()))
            return 0
        farm = _farm(args)
        farm.ledger.ping()
        upload(farm.store, [ref for _entry, ref in found])
        if reference[0]:
            farm.store.put_if_absent(*reference)
        job = farm.submit(houses, spec, update=args.update)
        if job.was and not args.json:
            sys.stderr.write(f"pbrs-farm: this job is there already, {job.was}\n")
        _say(args, {"job": job.job_id, "houses": job.n_houses, "was": job.was}, lambda: job.job_id)
        return 0

    return submit


def _status(args: argparse.Namespace) -> int:
    farm, job = _farm_and_job(args)
    while True:
        status = farm.status(job)
        if args.watch and sys.stdout.isatty():
            sys.stdout.write("\x1b[H\x1b[2J")
        _say(args, status, lambda s=status: status_text(s))  # type: ignore[misc]
        if not args.watch or status["state"] in ("done", "cancelled"):
            return 0
        time.sleep(2.0)


def _why(args: argparse.Namespace) -> int:
    farm, job = _farm_and_job(args)
    rows = farm.why(job, args.task)
    _say(args, rows, lambda: why_text(rows))
    return 0


def _logs(args: argparse.Namespace) -> int:
    farm, job = _farm_and_job(args)
    text = farm.logs(job, args.task, args.attempt)
    _say(args, {"task": args.task, "log": text}, lambda: text)
    return 0


def _failures(args: argparse.Namespace) -> int:
    farm, job = _farm_and_job(args)
    groups = farm.failures(job)
    _say(args, groups, lambda: failures_text(groups))
    return 0


def _retry(args: argparse.Namespace) -> int:
    farm, job = _farm_and_job(args)
    tasks = farm.retry(job, args.tasks)
    _say(args, tasks, lambda: f"{len(tasks)} tasks get fresh attempts")
    return 0


def _steer(args: argparse.Namespace) -> int:
    farm, job = _farm_and_job(args)
    state: str = getattr(farm, args.what)(job)
    _say(args, {"job": job, "state": state}, lambda: f"{job} {state}")
    return 0


def _drain(args: argparse.Namespace) -> int:
    _farm(args).drain(args.worker, undo=args.undo)
    _say(args, {"worker": args.worker, "drain": not args.undo}, lambda: f"{args.worker} told")
    return 0


def _workers(args: argparse.Namespace) -> int:
    rows = _farm(args).workers()
    _say(args, rows, lambda: workers_text(rows))
    return 0


def _recover(args: argparse.Namespace) -> int:
    farm = _farm(args)

    def tell(line: str) -> None:
        sys.stderr.write(f"recover: {line}\n")

    farm.recover(args.job, tell)
    status = farm.status(args.job)
    _say(args, status, lambda: status_text(status))
    return 0


def _coordinator(_args: argparse.Namespace) -> int:
    from workers.coordinator import main

    return main()


def _worker(args: argparse.Namespace) -> int:
    from workers.supervisor import main

    return main([] if args.until is None else ["--until", str(args.until)])
