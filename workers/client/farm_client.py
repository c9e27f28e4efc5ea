"""Client of the farm: submit, watch, steer. The command line calls it, with the same verbs.

Effects: Redis and the store. Looking at a job imports neither numpy nor celery nor mitsuba, nor the
recipe's models: `status` is called often, on busy machines.

    farm = Farm(config_from_environment())
    job = farm.submit(houses, new_spec(recipe)).job_id
    farm.status(job)
"""

from __future__ import annotations

import copy
import math
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pbrs_farm.core.errors import BadInput, MachineFailed, ObjectMissing
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.store import Store, store_from_url
from workers.client.rights import Rights
from workers.client.task_rows import explain_tasks, rerun_command
from workers.config import FarmConfig
from workers.coordinator.progress_rates import stage_views
from workers.ids import (
    TaskId,
    attempts_from_log_keys,
    check_job_id,
    failed_key,
    job_key,
    log_key,
    task_from_text,
)
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import ALIVE_S, JobView, User
from workers.ledger.user_table import UserTable
from workers.ledger.worker_registry import Registry
from workers.store_identity import known_store_id, store_id

if TYPE_CHECKING:
    from pbrs_farm.core.recipe import Recipe
    from workers.job import HouseEntry, JobSpec

# A submission that takes longer has died; the next one starts afresh.
_LOADING_S = 900.0
# A small job is cut finer, so that its last batch does not leave the other slots idle.
_BATCHES_PER_SLOT = 4
_SLOTS_UNKNOWN = 2
_WAIT = "wait; after 15 minutes the submission counts as dead"
_HOUSE_STATES = ("open", "done", "quarantined")


@dataclass(frozen=True, slots=True)
class Submitted:
    """A job on the farm."""

    job_id: str
    n_houses: int
    was: str  # its state before, "" when it is new


class Farm:
    """One farm: a Redis and a store; submit jobs, watch and steer them.

    Looking needs Redis alone and no rights; what changes something needs the store and, on a farm with users,
    a token (`config.token`). Every method raises PbrsError with one clear line: LedgerUnavailable without
    Redis, MachineFailed without a store, BadInput for a job, house or worker that there is not.

        farm = Farm(config_from_environment())
        submitted = farm.submit(houses, new_spec(recipe_from_name("fast")))
        farm.status(submitted.job_id)["views_done"]
    """

    def __init__(self, config: FarmConfig) -> None:
        self.config = config
        self.ledger = RedisLedger(config)
        self.registry = Registry(self.ledger)
        self.users = UserTable(self.ledger)
        self.rights = Rights(self.users, config.token)

    def acting_as(self, user: User, place: str) -> Farm:
        """The same farm as this user, at a place (for the audit), sees it; ledger, store, registry are shared."""
        farm = copy.copy(self)
        farm.rights = Rights(self.users, self.config.token, user, place)
        return farm

    @cached_property
    def store(self) -> Store:
        """The farm's store; MachineFailed when none is named."""
        if not self.config.store_url:
            raise MachineFailed("no store", hint="PBRS_STORE=file:///folder or s3://bucket/prefix")
        return store_from_url(self.config.store_url, self.config.store)

    def submit(
        self, houses: Sequence[HouseEntry], spec: JobSpec, *, update: bool = False
    ) -> Submitted:
        """Submit a job; an existing equal job is not changed.

        Sets spec.job_id and n_houses; houses are sorted by id. update: the root's recipe may be replaced.
        Raises BadRecipe if the root has another recipe, BadInput if two houses share an id.
        """
        from pbrs_farm.run.output_root import claim_root
        from workers.job import lines_from_houses

        # Equal work has an equal id: an existing job is not changed.
        houses, spec = completed(houses, spec)
        self.ledger.ping()
        user = self.rights.who()
        if spec.preempt:
            self.rights.check_preempt()
        spec = spec.model_copy(update={"user": user.name if user is not None else ""})
        view = self.ledger.view(spec.job_id)
        if view is not None and view.state in ("running", "paused", "done"):
            return Submitted(spec.job_id, len(houses), view.outcome)
        self.check_store()
        # Cut houses fine enough for the slots there are.
        n_slots = max(self.registry.slots().values(), default=_SLOTS_UNKNOWN)
        spec = spec.model_copy(
            update={"min_batches": math.ceil(_BATCHES_PER_SLOT * n_slots / len(houses))}
        )
        # Storage first: from here on the job can be recovered.
        claim_root(self.store, spec.recipe, update=update)
        self.store.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(houses))
        self._put_spec(spec)
        was = self._load(spec, list(houses))
        self.rights.note("submit", spec.job_id, f"{len(houses)} houses, {spec.recipe.name}")
        return Submitted(spec.job_id, len(houses), was)

    def check_store(self) -> None:
        """BadInput if none of the live workers works on this farm's store, where tasks would wait for ever."""
        living = [w for w in self.registry.workers() if w.age_s <= ALIVE_S]
        theirs = {
            w.fields["store_id"]: w.fields["store"] for w in living if w.fields.get("store_id")
        }
        # Workers that name no store, and a farm without workers, prove nothing.
        if theirs and known_store_id(self.store) not in theirs:
            urls = ", ".join(sorted(set(theirs.values()))[:3])
            hint = "--store URL, or PBRS_STORE; or start workers on this store"
            raise BadInput(
                self.store.url, "", f"no worker uses this store; they use {urls}", hint=hint
            )

    def check_plugins(self, marks: Collection[str]) -> list[str]:
        """The live workers that lack a plugin of these marks; BadInput if none of them has all plugins."""
        living = [w for w in self.registry.workers() if w.age_s <= ALIVE_S]
        lacking = {
            w.name: sorted(set(marks) - set(w.fields.get("plugins", "").split("\n")))
            for w in living
        }
        lines = [f"{name} lacks {', '.join(marks)}" for name, marks in lacking.items() if marks]
        if living and len(lines) == len(living):
            hint = "install the same package and version on the workers"
            raise BadInput("plugins", "", f"no worker has all plugins: {lines[0]}", hint=hint)
        return lines

    def recover(self, job: str, progress: Callable[[str], None] = lambda _line: None) -> JobView:
        """Rebuild the ledger of a job from storage, regardless of its state in Redis.

        For a lost ledger (Redis restarted empty) or a suspect one. Houses and steps with markers stay done.
        progress: called with lines for people. Raises BadInput for a job that is not in the store, and for
        another user's.
        """
        from workers.job import stored_houses

        self.users.restore(self.store)
        spec = self.spec(job)
        self.rights.check_owner(job, spec.user)
        houses = [*stored_houses(self.store, job)]
        self._load(spec, houses, progress)
        self.rights.note("recover", job, f"{len(houses)} houses")
        view = self.ledger.view(job)
        assert view is not None
        return view

    def adopt(self, job: str, progress: Callable[[str], None] = lambda _line: None) -> JobView:
        """Let workers of this version go on with a job of another one, whose equal results stay."""
        from workers.job import work_version

        spec = self.spec(job)
        self.rights.check_owner(job, spec.user)
        if spec.version != work_version():
            before = (*spec.versions_before, spec.version)
            spec = spec.model_copy(update={"version": work_version(), "versions_before": before})
            self._put_spec(spec)
        return self.recover(job, progress)

    def _put_spec(self, spec: JobSpec) -> None:
        self.store.put(job_key(spec.job_id), spec.model_dump_json(indent=1).encode())

    def _change_spec(self, job: str, **fields: Any) -> None:
        """Change the stored specification, so that a recovered job keeps it; steering works without a store."""
        if self.config.store_url:
            self._put_spec(self.spec(job).model_copy(update=fields))

    def spec(self, job: str) -> JobSpec:
        """The job's specification from the store, later changes included; BadInput for an unknown or invalid id."""
        from pbrs_farm.core.checked_json import checked
        from workers.job import JobSpec

        try:
            return checked(JobSpec, self.store.get(job_key(check_job_id(job))), job_key(job))
        except ObjectMissing:
            raise BadInput(job, "", f"no such job in {self.store.url}") from None

    def jobs(self) -> list[JobView]:
        """Every job in the ledger, oldest first; `lost_jobs` has those only in the store."""
        return [v for j in self.ledger.known_jobs() if (v := self.ledger.view(j)) is not None]

    def newest_job(self) -> str:
        """The last job entered in the ledger; BadInput (which may suggest recover) without one."""
        jobs = self.ledger.known_jobs()
        if not jobs:
            lost = self.lost_jobs()
            hint = f"`pbrs-farm recover {lost[-1]}`" if lost else "`pbrs-farm submit HOME`"
            raise BadInput("farm", "", "no job in the ledger", hint=hint)
        return jobs[-1]

    def lost_jobs(self) -> list[str]:
        """Jobs that the store knows and an empty ledger does not; [] where it holds any job, or without store."""
        from workers.coordinator.recover import lost_jobs

        return lost_jobs(self.ledger, self.store) if self.config.store_url else []

    def view(self, job: str) -> JobView:
        """The ledger's snapshot of a job, BadInput for an unknown one; `status` is the same for people."""
        view = self.ledger.view(check_job_id(job))
        if view is None:
            hint = "`recover` rebuilds a job from storage"
            raise BadInput(job, "", "not in the ledger", hint=hint)
        return view

    def status(self, job: str) -> dict[str, Any]:
        """State, stages (done, running, queued, failed, rate, ETA), houses, workers, storage.

        Plain JSON values. "eta_s" is the longest of the stages', None where nothing can be said
        yet; "held_back" says why a running job is not claimed now, "storage" is "ok" or why the
        breaker is open. BadInput for an unknown job.
        """
        view = self.view(job)
        workers = self.registry.workers()
        # A handful of reads, whatever the size of the job.
        stages = stage_views(view, self.registry.slots())
        return {
            "job": job,
            "state": view.outcome,
            "reason": view.fields.get("reason", ""),
            "recipe": view.fields.get("recipe_name", ""),
            "user": view.user,
            "priority": view.priority,
            "is_urgent": view.is_urgent,
            "held_back": view.blocked_why if view.state == "running" else "",
            "waits_for": [j for j in view.after if not self._is_done(j)],
            "houses": {
                "total": int(view.fields.get("n_houses", 0)),
                "waiting": view.n_waiting_houses,
                **{s: int(view.counts.get(f"houses:{s}", 0)) for s in _HOUSE_STATES},
            },
            "views_done": int(view.counts.get("views", 0)),
            "stages": [asdict(stage) for stage in stages],
            "eta_s": max((s.eta_s for s in stages if s.eta_s is not None), default=None),
            "failures": _with_prefix(view.counts, "failed:"),
            "failed_attempts": _with_prefix(view.counts, "failures:"),
            "handed_back": _with_prefix(view.counts, "handed_back:"),
            "workers": len([w for w in workers if w.age_s <= ALIVE_S]),
            "refusing": [
                {"worker": w.name, "why": w.fields["refuses"]}
                for w in workers
                if w.age_s <= ALIVE_S and job in w.fields.get("refuses", "")
            ],
            "storage": self.registry.breaker() or "ok",
        }

    def _is_done(self, job: str) -> bool:
        view = self.ledger.view(job)
        return view is not None and view.state == "done"

    def explain(self, job: str, text: str) -> list[dict[str, Any]]:
        """State of a task, of a house's tasks, or of a view (HOUSE/VIEW), with what each waits for; BadInput."""
        rows = explain_tasks(self.ledger, self.registry, self.view(job), text)
        return rows or self._explain_not_admitted(job, text.partition("/")[0])

    def finished_houses(self, job: str, besides: Collection[str] = ()) -> set[str]:
        """The job's finished houses but those in besides, one field each: suits following a large job."""
        from workers.job import stored_houses

        entries = stored_houses(self.store, check_job_id(job))
        candidates = (e.house_id for e in entries if e.house_id not in besides)
        return set(self.ledger.finished(job, candidates))

    def logs(self, job: str, text: str, attempt: int | None = None) -> str:
        """The stored log of a task's attempt (the last one by default); BadInput if there is none.

        text: "HOUSE/UNIT/STAGE". attempt: counts from 1. Only failed attempts and tasks of a minute or more
        leave a log; the error lists the attempts with one. Invalid UTF-8 is replaced.
        """
        task = task_from_text(text)
        # One object an attempt, in the folder of the task's unit.
        folder = log_key(job, str(task), 0).rpartition("/")[0] + "/"
        logs = attempts_from_log_keys(job, str(task), self.store.list(folder))
        # Take the last attempt unless one is named.
        chosen = attempt if attempt is not None else max(logs, default=0)
        if chosen not in logs:
            self.check_task(job, task)
            hint = "logs exist for failed attempts and for tasks that run longer than a minute"
            if logs:
                hint = f"of attempts {', '.join(map(str, sorted(logs)))}"
            raise BadInput(text, "", "no log stored", hint=hint)
        return self.store.get(logs[chosen]).decode("utf-8", "replace")

    def check_task(self, job: str, task: TaskId) -> None:
        """Raises BadInput, saying which part is unknown, where the job has no such task."""
        units = self.ledger.unit_states(self.view(job).job_id, task.house)
        if not units:
            self._explain_not_admitted(job, task.house)
        elif ":" not in units.get(task.unit, ""):
            raise BadInput(str(task), "", "the job has no such task", hint=f"`why {task.house}`")

    def failures(self, job: str) -> list[dict[str, Any]]:
        """Tasks that failed for good, alike ones together, most frequent first.

        A row per fingerprint: how many, an example message and log, up to 20 tasks, and the command
        that repeats one. Reads every fault of the job.
        """
        # fingerprint -> row; faults alike differ in numbers, ids and paths only
        kinds: dict[str, dict[str, Any]] = {}
        for task, fault in self.ledger.faults(job):
            kind = kinds.setdefault(
                fault.fingerprint,
                {
                    "fingerprint": fault.fingerprint,
                    "class": fault.fault,
                    "n": 0,
                    "example": fault.message,
                    "log": fault.log,
                    "tasks": [],
                    "command": rerun_command(job, task),
                },
            )
            kind["n"] += 1
            kind["tasks"] = sorted([*kind["tasks"], task])[:20]
        return sorted(kinds.values(), key=lambda k: (-k["n"], k["fingerprint"]))

    def retry(self, job: str, tasks: Sequence[str] = ()) -> list[str]:
        """Give these tasks, or all failed ones, new attempts; the reset ones. BadInput, also for another user's."""
        # The ledger forgets the failure, then storage does.
        self.rights.check_owner(job, self.view(job).user)
        chosen = list(tasks) or [task for task, _fault in self.ledger.faults(job)]
        again = [t for t in chosen if self.ledger.retry(job, str(task_from_text(t)))]
        for task in again:
            self.store.delete(failed_key(job, task))
        self.rights.note("retry", job, f"{len(again)} tasks")
        return again

    def pause(self, job: str) -> str:
        """Start nothing more; what runs, ends, what waits, waits for `resume`. The state; BadInput."""
        return self._steer(job, "pause", "by hand")

    def resume(self, job: str) -> str:
        """Go on with a paused job."""
        return self._steer(job, "resume")

    def cancel(self, job: str) -> str:
        """Stop a job for good, running tasks too; storage stays, so that submitting again renders only the rest."""
        return self._steer(job, "cancel", "by hand")

    def reduce(self, job: str) -> str:
        """Request a merge of a running or finished job's results; its report lists missing parts."""
        return self._steer(job, "reduce")

    def set_priority(self, job: str, priority: int) -> str:
        """Order a user's jobs by priorities 0 (first) to 9 from the next turn on; the job's state."""
        state = self._steer(job, "priority", str(priority))
        self._change_spec(job, priority=priority)
        return state

    def limit(
        self, job: str, *, max_slots: int | None = None, budget_h: float | None = None
    ) -> str:
        """Give a job another ceiling of tasks in flight or of slot-hours (0 = none); its state.

        What is not given stays. Tasks that run already are not stopped by a lower one. BadInput
        when neither is given, for a job that the ledger has not, and for another user's.
        """
        limits = {"max_slots": max_slots, "budget_h": budget_h}
        chosen = {name: n for name, n in limits.items() if n is not None}
        if not chosen:
            raise BadInput("limit", "", "nothing to change", hint="--max-slots N, --budget HOURS")
        for name, number in chosen.items():
            state = self._steer(job, name, f"{number:g}")
        self._change_spec(job, **chosen)
        return state

    def drain(self, worker: str, *, undo: bool = False) -> None:
        """Ask a worker to finish its tasks and leave (undo: also a restarted one); BadInput. Needs an admin."""
        self.rights.check_admin("drain")
        if not self.registry.drain(worker, undo=undo):
            offer = did_you_mean(worker, [w.name for w in self.registry.workers()])
            raise BadInput(worker, "", "no such worker", hint=offer or "`workers` lists them")
        self.rights.note("drain", worker, "undone" if undo else "asked")

    def workers(self) -> list[dict[str, Any]]:
        """Workers of the last hour: alive, draining, drained (until asked back) or dead (no heartbeat)."""
        return [
            {**w.fields, "worker": w.name, "age_s": round(w.age_s, 1), "state": w.state}
            for w in self.registry.workers()
        ]

    def _load(
        self,
        spec: JobSpec,
        houses: list[HouseEntry],
        progress: Callable[[str], None] = lambda _line: None,
    ) -> str:
        """Enter the job into the ledger, as far along as storage says it is."""
        from workers.coordinator.recover import rebuild
        from workers.runner import runner_maker

        # An interrupted submission leaves the state "loading": only an old one is taken over.
        was = ""
        view = self.ledger.view(spec.job_id)
        if view is not None:
            was = view.state
            if was == "loading" and self.ledger.age_s(view) < _LOADING_S:
                raise BadInput(spec.job_id, "", "is being submitted by somebody else", hint=_WAIT)
            self.ledger.forget(spec.job_id)
        if self.ledger.create(spec, store_id(self.store)) != "":
            raise BadInput(spec.job_id, "", "is being submitted by somebody else", hint=_WAIT)
        # The runner says what the markers of a house mean; it renders nothing here.
        runner = runner_maker(self.config.runner)(self.config, lambda _reason: None)
        rebuild(self.ledger, self.store, runner, spec, houses, progress)
        self.ledger.open(spec.job_id, spec.priority)
        return was

    def _steer(self, job: str, what: str, reason: str = "") -> str:
        self.rights.check_owner(job, self.view(job).user)
        state = self.ledger.steer(job, what, reason)
        self.rights.note(what, job, f"{reason}, {state}" if reason else state)
        return state

    def _explain_not_admitted(self, job: str, house: str) -> list[dict[str, Any]]:
        from workers.job import stored_houses

        houses = [entry.house_id for entry in stored_houses(self.store, check_job_id(job))]
        if house not in houses:
            raise BadInput(house, "", "the job has no such house", hint=did_you_mean(house, houses))
        return [{"task": house, "state": "its house is not admitted yet"}]


def completed(
    houses: Sequence[HouseEntry], spec: JobSpec
) -> tuple[tuple[HouseEntry, ...], JobSpec]:
    """(houses sorted by id, the spec with their number and a digest of both as id); BadInput for none or twice."""
    from workers.job import job_id

    if not houses:
        raise BadInput("submit", "", "no house")
    # An id is a folder of the store: two houses of one id would overwrite each other.
    twice = [h for h, n in Counter(h.house_id for h in houses).items() if n > 1]
    if twice:
        raise BadInput("submit", twice[0], "named twice")
    in_order = tuple(sorted(houses, key=lambda h: h.house_id))
    spec = spec.model_copy(update={"n_houses": len(in_order)})
    return in_order, spec.model_copy(update={"job_id": job_id(spec, in_order)})


def new_spec(recipe: Recipe, **fields: Any) -> JobSpec:
    """A JobSpec of this program's version, to be given to `Farm.submit`, which sets its id.

    fields: any field of JobSpec but job_id, version and recipe. Raises pydantic's
    ValidationError for others.

        new_spec(recipe_from_name("fast"), priority=2, layers=("albedo",))
    """
    from workers.job import JobSpec, work_version

    return JobSpec.model_validate(
        {"job_id": "", "version": work_version(), "recipe": recipe, **fields}
    )


def _with_prefix(counts: Any, prefix: str) -> dict[str, int]:
    return {k.removeprefix(prefix): int(n) for k, n in counts.items() if k.startswith(prefix) and n}
