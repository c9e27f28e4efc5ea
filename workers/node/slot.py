"""One slot of a worker: claims a task, has it run by its renderer, and tells the ledger.

Effects: Redis, a renderer process, log objects in storage. The attempt was counted by the claim,
before any work; the lease is kept by beats; the token fences off whoever lost it.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import random
import secrets
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final, TypeVar

from pbrs_farm.core.errors import PbrsError, StoreFailed
from pbrs_farm.store import Store, store_from_url
from workers.config import FarmConfig
from workers.ids import WHOLE, TaskId, failed_key, log_key, task_from_text
from workers.ledger.interface import Claim, Fault, FaultClass, Finished, LedgerUnavailable
from workers.ledger.redis_ledger import RedisLedger, groups_from_text
from workers.ledger.worker_registry import Registry
from workers.node.faults import without_numbers
from workers.node.renderer_process import Attendant, Ended, Watch
from workers.runner import Request, Result

T = TypeVar("T")
_log = logging.getLogger("pbrs.slot")
_FREE: Final = {"preempted", "drained", "cancelled", "lost", "storage"}
_WAIT_AFTER_REFUSAL: Final = {"version", "recipe", "draining", "blocked", "elsewhere"}
_LOG_EVERY_S: Final = 60.0


class Slot:
    """What one pool process of a worker holds: ledger, renderer and, for logs, the store."""

    def __init__(self, config: FarmConfig) -> None:
        self._config = config
        self._ledger = RedisLedger(config)
        self._registry = Registry(self._ledger)
        self._attendant = Attendant(config)
        self._store: Store | None = None
        self._numbers = itertools.count()

    def perform(self, job: str, task: TaskId, recipe: str) -> None:
        """Run the task if the ledger allows it, then others of its house while that pays."""
        direct = False
        following: TaskId | None = task
        while following is not None:
            token = (
                f"{self._config.worker}:{os.getpid()}:{next(self._numbers)}:{secrets.token_hex(4)}"
            )
            ask = partial(
                self._ledger.claim, job, str(following), token=token, recipe=recipe, direct=direct
            )
            claim = self._insist(ask)
            if claim.verdict != "run":
                self._refused(job, following, claim)
                return
            following = self._run(job, following, claim)
            direct = True

    def _run(self, job: str, task: TaskId, claim: Claim) -> TaskId | None:
        request = _request(job, task, claim)
        ended = self._attendant.run(request, self._watch(job, task, claim))
        if ended.result is None:
            self._failed(job, task, claim, ended)
            return None
        sticky = ended.seconds >= self._config.sticky_s and not self._config.handback_file.exists()
        end = Finished(ended.seconds, ended.result.groups, _n_views(request, ended.result))
        more = self._insist(
            lambda: self._ledger.finish(job, str(task), claim.token, end, sticky=sticky)
        )
        return task_from_text(more) if more else None

    def _watch(self, job: str, task: TaskId, claim: Claim) -> Watch:
        last_beat = last_upload = time.monotonic()

        def wanted() -> FaultClass | None:
            nonlocal last_beat
            if self._config.handback_file.exists():
                return "preempted"
            if time.monotonic() - last_beat < self._config.beat_s:
                return None
            last_beat = time.monotonic()
            try:
                answer = self._ledger.beat(job, str(task), claim.token)
            except LedgerUnavailable as error:
                # Go on: the token fences us off if the lease has run out meanwhile.
                _log.warning("no beat: %s", error)
                return None
            return None if answer == "ok" else "lost" if answer == "lost" else "cancelled"

        def on_log() -> None:
            nonlocal last_upload
            if time.monotonic() - last_upload >= _LOG_EVERY_S:
                last_upload = time.monotonic()
                self._put(log_key(job, str(task), int(claim.detail)), self._attendant.tail())

        return Watch(wanted, self._storage_sick, on_log)

    def _failed(self, job: str, task: TaskId, claim: Claim, ended: Ended) -> None:
        fault_class = ended.fault or "bug"
        attempt = int(claim.detail)
        key = log_key(job, str(task), attempt)
        fault = Fault(
            fault=fault_class,
            fingerprint=f"{fault_class}: {without_numbers(ended.fingerprint)}",
            message=ended.message,
            worker=self._config.worker,
            attempt=attempt,
            log="" if fault_class in _FREE else key,
            tail=self._attendant.tail()[-2000:],
        )
        if fault_class not in _FREE:
            self._put(key, self._attendant.tail())
        if fault_class == "storage":
            self._storage_sick(ended.message)
        delay_s = 0.0 if fault_class == "preempted" else self._config.retry_delay_s * attempt
        delay_s *= random.uniform(0.7, 1.3)
        verdict = self._insist(
            lambda: self._ledger.fail(job, str(task), claim.token, fault, delay_s=delay_s)
        )
        _log.warning(
            "%s attempt %d: %s (%s): %s", task, attempt, fault_class, verdict, fault.message
        )
        if verdict == "failed":
            self._put(failed_key(job, str(task)), fault.json())

    def _refused(self, job: str, task: TaskId, claim: Claim) -> None:
        _log.log(
            logging.DEBUG if claim.verdict in ("done", "early") else logging.INFO,
            "%s/%s not run: %s %s", job, task, claim.verdict, claim.detail,
        )  # fmt: skip
        if claim.verdict == "leased":
            self._release_dead_sibling(job, task, claim.detail)
        if claim.verdict in ("version", "recipe"):
            reason = f"job {job} wants {claim.verdict} {claim.detail}"
            with contextlib.suppress(LedgerUnavailable):
                self._registry.refused(reason)
        if claim.verdict in _WAIT_AFTER_REFUSAL:
            time.sleep(1.0)

    def _release_dead_sibling(self, job: str, task: TaskId, holder: str) -> None:
        """A pool process of this very worker died holding the lease: no need to wait for it."""
        token = holder.partition("|")[0]
        worker, _, rest = token.rpartition(":")[0].rpartition(":")[0].rpartition(":")
        if worker != self._config.worker or not rest.isdigit() or _is_alive(int(rest)):
            return
        fault = Fault(
            fault="lost",
            fingerprint="lost: a pool process died",
            message=f"pool process {rest} of {worker} died",
            worker=worker,
        )
        self._insist(lambda: self._ledger.fail(job, str(task), token, fault, delay_s=0.0))

    def _storage_sick(self, reason: str) -> None:
        _log.warning("storage: %s", reason)
        with contextlib.suppress(LedgerUnavailable):
            self._registry.storage_sick(reason)

    def _put(self, key: str, text: str) -> None:
        """Store a log or a record of failure; the work does not depend on it."""
        try:
            if self._store is None:
                settings = self._config.store
                hasty = replace(settings, s3=replace(settings.s3, retry_timeout_s=5.0))
                self._store = store_from_url(self._config.store_url, hasty)
            self._store.put(key, text.encode())
        except (StoreFailed, PbrsError) as error:
            _log.warning("not stored: %s", error)

    def _insist(self, act: Callable[[], T]) -> T:
        """act(), again and again while Redis is away: up to ten minutes."""
        give_up = time.monotonic() + 600.0
        while True:
            try:
                return act()
            except LedgerUnavailable as error:
                if time.monotonic() > give_up or self._config.handback_file.exists():
                    raise
                _log.warning("%s; trying again", error)
                time.sleep(random.uniform(1.0, 3.0))


def _request(job: str, task: TaskId, claim: Claim) -> Request:
    views: tuple[str, ...] = ()
    if task.unit.isdigit():
        views = groups_from_text(claim.inputs)[int(task.unit)]
    return Request(
        job_id=job,
        house=task.house,
        unit=task.unit,
        stage=task.stage,
        views=views,
        source=claim.inputs if task.unit == WHOLE and task.stage == "geometry" else "",
        attempt=int(claim.detail),
    )


def _n_views(request: Request, result: Result) -> int:
    return result.n_views or len(request.views)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
