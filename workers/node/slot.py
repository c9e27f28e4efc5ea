"""One slot of a worker: claims a task, has it run by its render process, and reports to the ledger.

Effects: Redis, a render process, log objects in storage. The attempt was counted by the claim,
before any work; the lease is kept by heartbeats; the token keeps a slot that lost its lease from ending the task.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import random
import secrets
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, TypeVar

from pbrs_farm.core.errors import PbrsError, StoreFailed
from pbrs_farm.operating_system import is_running
from pbrs_farm.run.processes.child_process import ChildProcess
from pbrs_farm.run.processes.render_process import REPORTED, Ended, RenderProcess
from pbrs_farm.store import Store, store_from_url
from workers.config import FarmConfig, shown_url
from workers.ids import GEOMETRY, QUEUES, WHOLE, TaskId, failed_key, log_key, task_from_text
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import (
    UNCOUNTED,
    Claim,
    Fault,
    FaultClass,
    Finished,
    GoOn,
    LedgerUnavailable,
    batches_from_text,
)
from workers.ledger.worker_registry import Registry
from workers.node.faults import without_numbers
from workers.runner import Result, TaskRequest

T = TypeVar("T")
_log = logging.getLogger("pbrs.slot")
# Classes that say nothing of the task: no log of them is stored.
_NO_LOG: Final = {*UNCOUNTED, "cancelled", "lost"}
# Refusals that another worker may not meet: wait, so that it comes first.
_WAIT_AFTER_REJECTION: Final = {"version", "recipe", "store", "draining", "cooling", "elsewhere"}
# Ends of a task after which the other tasks of its claim are not started.
_ENDS_ALL: Final = {"preempted", "cancelled"}
_POLL_S: Final = 1.0
_REPORT_EVERY_S: Final = 5.0
_LOG_EVERY_S: Final = 60.0  # a long task's log is stored so often
_RETRY_S: Final = 600.0  # how long Redis may be away
_TAIL_IN_FAULT: Final = 2000  # bytes of the log that the ledger keeps
_LOG_STORE_S: Final = 5.0  # how long a log waits for storage


@dataclass(frozen=True, slots=True)
class _Claimed:
    """A task this slot holds the lease of."""

    job: str
    task: TaskId
    claim: Claim

    @property
    def attempt(self) -> int:
        return int(self.claim.detail)

    @property
    def log_key(self) -> str:
        return log_key(self.job, str(self.task), self.attempt)


def make_slot(config: FarmConfig) -> Slot:
    """The slot of this pool process, with its ledger in Redis and its own render process.

    Effects: creates a folder for its log and starts a process. Call it after the fork of the pool, once per pool
    process: the connections and the child must not be shared.
    """
    from workers.node.renderer import HANDLER

    # A folder for each pool process, so that their logs do not mix.
    folder = config.scratch / f"pbrs-{config.worker}-{os.getpid()}"
    folder.mkdir(parents=True, exist_ok=True)
    start = partial(ChildProcess, HANDLER, folder / "log.txt")
    process = RenderProcess(start, config.limits.of_process(config.slots))
    process.start()  # it loads its libraries before it has a task
    ledger = RedisLedger(config)
    return Slot(config, ledger, Registry(ledger), process)


class Slot:
    """One pool process of a worker: claims the tasks of a message, has them rendered, reports them.

    A slot runs one task at a time, in its own render process, which it kills on a deadline, a lost lease or a
    preemption. While a task runs, heartbeats keep its lease and those of the tasks claimed with it. After the
    last task of a message it may continue with others of the same house.

    Not for tests of rendering: run `HouseRunner` for these. `make_slot` makes the slot of a farm; tests pass a
    ledger and a registry in memory, and a test clock.

    ledger: outages up to ten minutes (_RETRY_S) are tolerated, then LedgerUnavailable is raised. process:
    started. clock: monotonic seconds. sleep: waits for a number of seconds.
    """

    def __init__(
        self,
        config: FarmConfig,
        ledger: RedisLedger,
        registry: Registry,
        process: RenderProcess,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._config = config
        self._ledger = ledger
        self._registry = registry
        self._process = process
        self._clock = clock
        self._sleep = sleep
        self._store: Store | None = None
        self._numbers = itertools.count()
        self._is_lack_told = False  # that this machine leaves pictures out
        self._heartbeat_at = 0.0  # next heartbeat of the leases
        self._ended: dict[str, Finished] = {}  # done, and the ledger does not know yet
        self._report_at = 0.0  # when done tasks are reported at the latest
        self._upload_at = 0.0  # next upload of the running task's log

    def run_tasks(self, job: str, tasks: Sequence[TaskId], recipe: str) -> None:
        """Run the tasks of one message that the ledger allows, then others of their house while that pays.

        tasks: of one house and stage. recipe: digest of the job's recipe, as the message has it. Returns when
        all have ended; a task that fails is reported, not raised. Raises LedgerUnavailable.
        """
        # A token is of this claim alone: the ledger can distinguish it from an earlier holder's.
        number, random_part = next(self._numbers), secrets.token_hex(4)
        token = f"{self._config.worker}:{os.getpid()}:{number}:{random_part}"
        names = [str(task) for task in tasks]
        ask = partial(self._ledger.claim_many, job, names, token=token, recipe=recipe)
        claims = dict(zip(names, self._retry(ask), strict=True))
        refused = {name: claim for name, claim in claims.items() if claim.verdict != "run"}
        for k, (name, claim) in enumerate(refused.items()):
            self._rejected(
                job, task_from_text(name), claim, waits=k == 0 and len(refused) == len(claims)
            )
        while claims := {name: c for name, c in claims.items() if c.verdict == "run"}:
            claimed = [_Claimed(job, task_from_text(name), claim) for name, claim in claims.items()]
            claims = self._run_claimed(claimed, recipe)

    def _run_claimed(self, queue: list[_Claimed], recipe: str) -> dict[str, Claim]:
        """Run tasks to their ends, one after another; those to go on with."""
        self._heartbeat_at = self._clock() + self._config.heartbeat_s
        self._ended, self._report_at = {}, self._clock() + _REPORT_EVERY_S
        while queue:
            first, *queue = queue
            if self._is_preempted() and queue:
                # Return tasks that have not started immediately, together with the running one.
                self._hand_back(queue)
                queue = []
            request = _request(first)
            ended = self._render(first, request, queue)
            if ended.cause:
                self._failed(first, ended)
                if ended.cause in _ENDS_ALL:
                    self._hand_back(queue)
                    queue = []
                continue
            result = Result.model_validate(ended.body)
            if result.left_out and not self._is_lack_told:
                self._is_lack_told = True
                _log.warning("skipping pictures of OpenGL: %s", result.left_out)
            end = Finished(ended.seconds, result.batches, result.n_views or len(request.views))
            self._ended[str(first.task)] = end
            _log.info("%s of job %s: done in %.1f s", first.task, first.job, ended.seconds)
            # Successors need not wait for the last of many tasks.
            if queue and self._clock() >= self._report_at:
                self._report(first, None)
            if not queue:
                # A task of seconds gains nothing from the scene another one of its house has loaded.
                is_long = ended.seconds >= self._config.sticky_s
                go_on = GoOn(recipe, self._config.queues or QUEUES, is_long=is_long)
                return self._report(first, None if self._is_preempted() else go_on)
        if self._ended:
            self._report(first, None)
        return {}

    def _report(self, claimed: _Claimed, go_on: GoOn | None) -> dict[str, Claim]:
        """Report finished tasks to the ledger; returns newly granted tasks."""
        ends, self._report_at = self._ended, self._clock() + _REPORT_EVERY_S
        self._ended = {}
        report = partial(self._ledger.finish_many, claimed.job, ends, claimed.claim.token, go_on)
        return self._retry(report)

    def _hand_back(self, tasks: Sequence[_Claimed]) -> None:
        """Return claimed tasks that were not started, uncounted."""
        for item in tasks:
            fault = Fault("preempted", "preempted, not started", "not begun", self._config.worker)
            give = partial(
                self._ledger.fail, item.job, str(item.task), item.claim.token, fault, delay_s=0.0
            )
            self._retry(give)

    def _render(
        self, claimed: _Claimed, request: TaskRequest, waiting: Sequence[_Claimed]
    ) -> Ended:
        """Have the task run, and keep its lease and those of what waits for it meanwhile."""
        self._upload_at = self._clock() + _LOG_EVERY_S
        deadline_s = self._config.limits.deadline_s(claimed.task.stage)
        self._process.begin(request.model_dump_json().encode(), task_s=deadline_s)
        while True:
            heard = self._process.poll(_POLL_S)
            if isinstance(heard, Ended):
                return heard
            # Keep the others from claiming what would wait as well.
            if heard is not None and heard.kind == "waiting":
                self._open_breaker(heard.text)
            stop = self._why_stop(claimed, waiting)
            if stop is not None:
                return self._process.kill(stop, f"stopped: {stop}")
            # A long task's log can be read while it runs.
            if self._clock() >= self._upload_at:
                self._upload_at = self._clock() + _LOG_EVERY_S
                self._put(claimed.log_key, self._process.log_tail())

    def _why_stop(self, claimed: _Claimed, waiting: Sequence[_Claimed]) -> FaultClass | None:
        """None, or why the running task must end now; sends the heartbeat when it is due."""
        if self._is_preempted():
            return "preempted"
        if self._clock() < self._heartbeat_at:
            return None
        self._heartbeat_at = self._clock() + self._config.heartbeat_s
        tasks = [str(claimed.task), *(str(queued.task) for queued in waiting), *self._ended]
        try:
            answer = self._ledger.heartbeat(claimed.job, tasks, claimed.claim.token)
        except LedgerUnavailable as error:
            # Go on: if the lease has run out meanwhile, the token is refused later.
            _log.warning("no heartbeat: %s", error)
            return None
        why: dict[str, FaultClass | None] = {"ok": None, "lost": "lost", "preempted": "preempted"}
        return why.get(answer, "cancelled")

    def _is_preempted(self) -> bool:
        return self._config.preemption_file.exists()

    def _failed(self, claimed: _Claimed, ended: Ended) -> None:
        fault = self._fault(claimed, ended)
        if fault.log:
            self._put(fault.log, self._process.log_tail())
        if fault.fault == "storage":
            self._open_breaker(ended.text)
        # Increasing delays with jitter.
        delay_s = 0.0
        if fault.fault != "preempted":
            delay_s = self._config.retry_delay_s * claimed.attempt * random.uniform(0.7, 1.3)
        task, token = str(claimed.task), claimed.claim.token
        verdict = self._retry(
            lambda: self._ledger.fail(claimed.job, task, token, fault, delay_s=delay_s)
        )
        _log.warning(
            "%s attempt %d: %s (%s): %s", task, claimed.attempt, fault.fault, verdict, fault.message
        )
        # A task that failed for good leaves a record that outlives Redis.
        if verdict == "failed":
            self._put(failed_key(claimed.job, task), fault.json())

    def _fault(self, claimed: _Claimed, ended: Ended) -> Fault:
        """Record of a failed task for the ledger."""
        kind, text = ended.cause, ended.text
        if kind == REPORTED:
            kind, text = str(ended.body["fault"]), str(ended.body["fingerprint"])
        return Fault(
            fault=kind,  # type: ignore[arg-type]  # causes are fault classes
            fingerprint=f"{kind}: {without_numbers(text)}",
            message=ended.text,
            worker=self._config.worker,
            attempt=claimed.attempt,
            log="" if kind in _NO_LOG else claimed.log_key,
            tail=self._process.log_tail(_TAIL_IN_FAULT),
        )

    def _rejected(self, job: str, task: TaskId, claim: Claim, *, waits: bool) -> None:
        """Say why a task is not run. waits: so that another worker comes first, where it may."""
        _log.log(
            logging.DEBUG
            if claim.verdict in ("done", "early", "alone", "blocked")
            else logging.INFO,
            "%s/%s not run: %s %s",
            job,
            task,
            claim.verdict,
            claim.detail,
        )
        # A message came twice, or its holder died with the Celery child that took it.
        if claim.verdict == "leased":
            self._release_dead_sibling(job, task, claim.detail)
        if claim.verdict in ("version", "recipe", "store"):
            reason = f"job {job} wants {claim.verdict} {claim.detail}"
            if claim.verdict == "version":
                reason = f"job {job} has steps of another version; `pbrs-farm adopt {job}`"
            if claim.verdict == "store":
                reason = f"job {job} is in another store than {shown_url(self._config.store_url)}"
            with contextlib.suppress(LedgerUnavailable):
                self._registry.note_rejection(reason)
        if waits and claim.verdict in _WAIT_AFTER_REJECTION:
            self._sleep(1.0)

    def _release_dead_sibling(self, job: str, task: TaskId, holder: str) -> None:
        """A pool process of this very worker died holding the lease: no need to wait for it."""
        # holder: "<token>|worker|since"; a token is "worker:pid:number:random".
        token = holder.partition("|")[0]
        worker, _, pid = token.rpartition(":")[0].rpartition(":")[0].rpartition(":")
        if worker != self._config.worker or not pid.isdigit() or is_running(int(pid)):
            return
        fault = Fault(
            fault="lost",
            fingerprint="lost: a pool process died",
            message=f"pool process {pid} of {worker} died",
            worker=worker,
        )
        self._retry(lambda: self._ledger.fail(job, str(task), token, fault, delay_s=0.0))

    def _open_breaker(self, reason: str) -> None:
        _log.warning("storage: %s", reason)
        with contextlib.suppress(LedgerUnavailable):
            self._registry.open_breaker(reason)

    def _put(self, key: str, text: str) -> None:
        """Store a log or a record of failure; the work does not depend on it."""
        try:
            if self._store is None:
                settings = self._config.store
                settings = replace(settings, s3=replace(settings.s3, retry_timeout_s=_LOG_STORE_S))
                self._store = store_from_url(self._config.store_url, settings)
            self._store.put(key, text.encode())
        except (StoreFailed, PbrsError) as error:
            _log.warning("not stored: %s", error)

    def _retry(self, ask: Callable[[], T]) -> T:
        """ask(), again and again while Redis is away: up to ten minutes."""
        give_up = self._clock() + _RETRY_S
        while True:
            try:
                return ask()
            except LedgerUnavailable as error:
                if self._clock() > give_up or self._is_preempted():
                    raise
                _log.warning("%s; trying again", error)
                self._sleep(random.uniform(1.0, 3.0))


def _request(claimed: _Claimed) -> TaskRequest:
    task, inputs = claimed.task, claimed.claim.inputs
    # Only geometry reads the home itself; later stages find its bundle in the store.
    is_geometry = task.unit == WHOLE and task.stage == GEOMETRY
    return TaskRequest(
        job_id=claimed.job,
        house=task.house,
        unit=task.unit,
        stage=task.stage,
        views=batches_from_text(inputs)[int(task.unit)] if task.unit.isdigit() else (),
        source=inputs if is_geometry else "",
        attempt=claimed.attempt,
    )
