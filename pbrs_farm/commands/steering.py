"""The farm's verbs and services, importing little, as `status` runs often. Effects: Redis, store, stdout."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pbrs_farm.commands.arguments import Handler, Verb, counted, echo, echo_json, farm_of, warn
from pbrs_farm.core.errors import BadInput
from workers.client.text import (
    changes_text,
    explanation_text,
    failures_text,
    jobs_text,
    status_text,
    users_text,
    workers_text,
)
from workers.ledger.task_ledger import SPENT_DAYS, WITH_FAILURES

if TYPE_CHECKING:
    from workers.client.farm_client import Farm


def add_verbs(verb: Verb) -> None:
    """Add status, why, logs, failures, retry, pause ... reduce, drain, workers, recover, adopt; services."""

    printed: dict[str, Handler] = {
        "why": _printer(lambda f, args: f.explain(_job_of(f, args), args.task), explanation_text),
        "failures": _printer(lambda f, args: f.failures(_job_of(f, args)), failures_text),
        "workers": _printer(lambda f, _args: f.workers(), workers_text),
        "audit": _printer(lambda f, args: f.users.changes(args.last), changes_text),
    }
    handlers = {
        "status": _status,
        "jobs": _jobs,
        **printed,
        "logs": _logs,
        "retry": _retry,
        "rerun": _rerun,
        "priority": _priority,
        "limit": _limit,
        "gc": _gc,
        "drain": _drain,
        "coordinator": _coordinator,
        "worker": _worker,
    }
    for name, handler in handlers.items():
        verb(name, handler)
    # Of these the name is that of the farm's method.
    for name in ("pause", "resume", "cancel", "reduce"):
        verb(name, _steer).set_defaults(what=name)
    for name in ("recover", "adopt"):
        verb(name, _recover).set_defaults(what=name)
    text = f"slot-hours of the user's jobs in {SPENT_DAYS} days; 0 = no limit"
    verb("users", _users).add_argument("--slot-hours", type=float, metavar="H", help=text)


def _job_of(farm: Farm, args: argparse.Namespace) -> str:
    return args.job or farm.newest_job()


def _farm_and_job(args: argparse.Namespace) -> tuple[Farm, str]:
    farm = farm_of(args)
    return farm, _job_of(farm, args)


def _printer(
    rows_of: Callable[[Farm, argparse.Namespace], Any], text_of: Callable[[Any], str]
) -> Handler:
    """The handler of a verb that prints rows of the farm."""

    def handler(args: argparse.Namespace) -> None:
        rows = rows_of(farm_of(args), args)
        _show(args, rows, lambda: text_of(rows))

    return handler


def _show(args: argparse.Namespace, value: Any, text: Callable[[], str]) -> None:
    """Print a value as JSON or as text for people, and flush for readers of a pipe."""
    if args.json:
        echo_json(value)
    else:
        echo(text())
    sys.stdout.flush()


def _status(args: argparse.Namespace) -> int:
    farm = farm_of(args)
    # No jobs: normal on a new farm, an error if the ledger was lost.
    if not args.job and not farm.ledger.known_jobs() and not farm.lost_jobs():
        n = sum(row["state"] == "alive" for row in farm.workers())
        _show(args, {"jobs": [], "workers": n}, lambda: f"no job yet; {counted(n, 'worker')}")
        return 0
    farm, job = _farm_and_job(args)
    # Poll every two seconds with --watch until the job ends.
    while True:
        status = farm.status(job)
        if args.watch and args.json:
            echo(json.dumps(status, sort_keys=True))
        elif args.watch and sys.stdout.isatty():
            echo(f"\x1b[H\x1b[2J{status_text(status)}")  # home, clear the screen
        else:
            _show(args, status, lambda s=status: status_text(s))  # type: ignore[misc]
        sys.stdout.flush()
        if not args.watch or status["state"] in ("done", WITH_FAILURES, "cancelled"):
            return 1 if status["state"] == WITH_FAILURES else 0
        time.sleep(2.0)


def _jobs(args: argparse.Namespace) -> None:
    from workers.client.job_rows import job_rows

    rows = job_rows(farm_of(args))
    _show(args, rows, lambda: jobs_text(rows))


def _logs(args: argparse.Namespace) -> None:
    farm, job = _farm_and_job(args)
    text = farm.logs(job, args.task, args.attempt)
    _show(args, {"task": args.task, "log": text}, lambda: text)


def _retry(args: argparse.Namespace) -> None:
    farm, job = _farm_and_job(args)
    tasks = farm.retry(job, args.tasks)
    _show(args, tasks, lambda: f"{len(tasks)} tasks will be retried")


def _rerun(args: argparse.Namespace) -> None:
    from workers.client.rerun import rerun

    farm, job = _farm_and_job(args)
    result = rerun(farm, job, args.task, lambda step: warn(f"rerun: {step}"))
    done = {"task": args.task, "views": result.n_views}
    _show(args, done, lambda: f"{args.task} done; `pbrs-farm retry {args.task}` updates the job")


def _steer(args: argparse.Namespace) -> None:
    farm, job = _farm_and_job(args)
    # Each of these verbs is a method of the farm.
    state: str = getattr(farm, args.what)(job)
    _show(args, {"job": job, "state": state}, lambda: f"{job} {state}")


def _priority(args: argparse.Namespace) -> None:
    farm, job = _farm_and_job(args)
    state = farm.set_priority(job, args.number)
    answer = {"job": job, "state": state, "priority": args.number}
    _show(args, answer, lambda: f"{job} {state}, priority {args.number}")


def _limit(args: argparse.Namespace) -> None:
    farm, job = _farm_and_job(args)
    state = farm.limit(job, max_slots=args.max_slots, budget_h=args.budget)
    again = f"; `pbrs-farm resume {job}` resumes it" if state == "paused" else ""
    _show(args, {"job": job, "state": state}, lambda: f"{job} {state}{again}")


def _gc(args: argparse.Namespace) -> None:
    from workers.client.garbage import garbage, keep_from_text, remove
    from workers.coordinator.recover import jobs_in

    farm, keep_s = farm_of(args), keep_from_text(args.keep)
    # An output folder of `run` has no jobs, and needs no Redis.
    if jobs_in(farm.store):
        farm.ledger.ping()
        if args.yes:
            farm.rights.check_admin("gc --yes")
    groups = garbage(farm, keep_s, time.time())
    n = remove(farm, groups) if args.yes else 0
    rows = [{"kind": g.kind, "objects": len(g.found), "bytes": g.n_bytes} for g in groups]

    def text() -> str:
        lines = [
            f"{g.kind:<22}{len(g.found):>9} objects {g.n_bytes / 1e6:>10.1f} MB" for g in groups
        ]
        lines += [f"    {key}" for g in groups for key in g.found[:3]]
        message = f"{n} objects removed" if args.yes else "nothing removed; --yes removes them"
        return "\n".join([*lines, message])

    _show(args, {"found": rows, "removed": n}, text)


def _drain(args: argparse.Namespace) -> None:
    farm_of(args).drain(args.worker, undo=args.undo)
    _show(
        args,
        {"worker": args.worker, "drain": not args.undo},
        lambda: f"{args.worker}: {'accepts tasks' if args.undo else 'stops after its tasks'}",
    )


def _users(args: argparse.Namespace) -> None:
    from workers.client.users import add_user, change_user, limits_of, remove_user, user_rows

    farm = farm_of(args)
    limits = limits_of(
        share=args.share,
        max_slots=args.max_slots,
        slot_hours=args.slot_hours,
        is_admin=args.admin and args.admin == "yes",
        may_preempt=args.may_preempt and args.may_preempt == "yes",
    )
    if args.what == "list" and not args.name and not limits:
        rows = user_rows(farm)
        _show(args, rows, lambda: users_text(rows))
        return
    if args.what == "list" or not args.name:
        raise BadInput("users", args.what, "expected a name", hint="users add|limit|remove NAME")
    answer: dict[str, Any] = {"user": args.name, "what": args.what}
    if args.what == "add":
        answer["token"] = add_user(farm, args.name, limits)
        message = f"{args.name}'s token, not stored: {answer['token']}"
    elif args.what == "limit":
        change_user(farm, args.name, limits)
        message = f"{args.name} changed"
    else:
        remove_user(farm, args.name)
        message = f"{args.name} removed"
    _show(args, answer, lambda: message)


def _recover(args: argparse.Namespace) -> None:
    farm = farm_of(args)

    def progress(line: str) -> None:
        sys.stderr.write(f"{args.what}: {line}\n")

    getattr(farm, args.what)(args.job, progress)
    status = farm.status(args.job)
    _show(args, status, lambda: status_text(status))


def _coordinator(_args: argparse.Namespace) -> int:
    from workers.coordinator.leader import main

    return main()


def _worker(args: argparse.Namespace) -> int:
    from workers.node.supervisor import main

    chosen = {
        "--until": args.until,
        "--until-idle": args.until_idle,
        "--preempted-code": args.preempted_code,
    }
    return main(
        [word for name, value in chosen.items() if value is not None for word in (name, str(value))]
    )
