"""The coordinator: one leader that admits houses, sends messages, and ends the leases of the dead.

Effects: Redis and its broker. It keeps a window of messages in flight, so Redis stays small
whatever the size of a job; it may be killed at any time, and a standby takes over in 15 seconds.
"""

from __future__ import annotations

import logging
import os
import platform
import secrets
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import groupby
from typing import Final

from pbrs_farm.core.errors import PbrsError
from pbrs_farm.store import store_from_url
from workers.config import FarmConfig, config_from_environment, make_scratch
from workers.coordinator.dispatcher import Dispatcher, NotLeading, Send, celery_sender
from workers.coordinator.farm_alerts import FarmAlerts
from workers.coordinator.preemption import choose_victims
from workers.coordinator.progress_rates import Rates
from workers.coordinator.turns import find_blocked_jobs
from workers.coordinator.webhook import Webhook, poster, watch_jobs
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import JobView, LedgerUnavailable, User
from workers.ledger.user_table import UserTable
from workers.ledger.worker_registry import Registry
from workers.liveness import touch
from workers.logs import log_to_stderr

_log = logging.getLogger("pbrs.coordinator")
_BUSY_PAUSE_S: Final = 0.05  # after a turn that sent something
_IDLE_PAUSE_S: Final = 0.5  # at most, after one that did not: a ready task notifies
_STANDBY_PAUSE_S: Final = 1.0  # between two tries to take the lead
_REDIS_AWAY_S: Final = 2.0
_REAP_EVERY_S: Final = 5.0
_RESEND_EVERY_S: Final = 15.0
_RATES_EVERY_S: Final = 10.0
_NOTICE_EVERY_S: Final = 10.0
_LIMITS_EVERY_S: Final = 1.0
_SPENT_EVERY_S: Final = 10.0
_OVER_SHARE_S: Final = 1.0  # seconds a user may exceed his share before his jobs are blocked


class Coordinator:
    """Leads the farm, or waits until the leader is gone.

    Several may run; the ledger has one leader, and refuses commands of others. `run` calls `turn` until it is
    stopped; a turn ends dead leases, applies budgets, limits and shares, and sends ready tasks.

    ledger, registry, users: in Redis, or in memory for tests; without users all jobs share alike. send: puts
    messages on queues, each (queue, job, task, recipe digest). notice: called occasionally while leading, to
    post news of jobs. clock: monotonic, s.
    """

    def __init__(
        self,
        config: FarmConfig,
        ledger: RedisLedger,
        send: Send,
        *,
        registry: Registry,
        notice: Callable[[], None] = lambda: None,
        users: UserTable | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config = config
        self._ledger = ledger
        self._registry = registry
        self._notice = notice
        self._table = users
        self._over_since: dict[str, float] = {}  # job that others go before -> since when
        self._users: Mapping[str, User] = {}
        self._spent_h: Mapping[str, float] = {}  # user -> slot-hours of his jobs in the last days
        self._clock = clock
        self._token = f"{platform.node()}:{os.getpid()}:{secrets.token_hex(4)}"
        self._dispatcher = Dispatcher(config, ledger, send, self._token)
        self._due: dict[str, float] = {}  # duty -> when it is due next
        self._rates = Rates()
        self._waiting: set[str] = set()  # jobs that follow others
        self.leading = False

    def run(self, stop: threading.Event) -> None:
        """Turn after turn until stop is set; survives outages of Redis.

        stop: set by a signal; the loop ends within a turn and a pause. It never raises LedgerUnavailable: it
        logs it, loses the lead and retries. Several processes may run it, one of which leads.
        """
        while not stop.is_set():
            try:
                if self.turn():
                    stop.wait(_BUSY_PAUSE_S)
                elif self.leading:
                    self._ledger.wait(_IDLE_PAUSE_S)
                else:
                    stop.wait(_STANDBY_PAUSE_S)
            except LedgerUnavailable as error:
                _log.warning("%s; trying again", error)
                self.leading = False
                stop.wait(_REDIS_AWAY_S)
        # A standby need not wait for the lead to run out.
        try:
            self._ledger.resign(self._token)
        except LedgerUnavailable as error:
            _log.warning("%s", error)

    def turn(self) -> int:
        """One round of duties; returns the number of messages sent.

        For tests and for `run`; the caller pauses between turns. 0 also on standby and while the breaker is
        open. Duties with longer periods (leases, rates, limits, notices) have separate clocks. Raises
        LedgerUnavailable.
        """
        # A standby is alive as well.
        if self._is_due("alive", _REAP_EVERY_S):
            touch(self._config.heartbeat_file)
        leading = self._ledger.lead(self._token)
        if leading != self.leading:
            _log.info("leading" if leading else "not leading; standing by")
            self.leading = leading
        if not leading:
            return 0
        # End the leases of the dead, and see who is left.
        if self._is_due("slots", _REAP_EVERY_S):
            self._dispatcher.slots = self._registry.slots()
            self._ledger.reap(self._token)
        views = [v for j in self._ledger.active_jobs() if (v := self._ledger.view(j)) is not None]
        if self._is_due("rates", _RATES_EVERY_S):
            for view in views:
                self._ledger.set_rates(view.job_id, self._rates.update(view, self._clock()))
        if self._is_due("notice", _NOTICE_EVERY_S):
            self._notice()
        # While storage is unhealthy nothing is sent: it could only fail.
        if self._registry.breaker():
            return 0
        if self._is_due("limits", _LIMITS_EVERY_S):
            self._waiting = {view.job_id for view in views if self._waits(view)}
            for view in views:
                self._keep_budget(view)
            self._read_users()
            self._preempt(views)
        views = self._block_jobs(views)
        try:
            n_sent = self._dispatcher.send_ready(
                [v for v in views if v.job_id not in self._waiting]
            )
        except NotLeading:
            self.leading = False
            return 0
        if self._is_due("resend", _RESEND_EVERY_S):
            n_sent += self._dispatcher.send_lost_again(views)
        return n_sent

    def _waits(self, view: JobView) -> bool:
        """Whether a job follows others that are not done; pauses it where they never will be."""
        for job in view.after:
            before = self._ledger.view(job)
            state = before.state if before is not None else "unknown"
            if state in ("cancelled", "unknown") and view.state == "running":
                self._ledger.steer(view.job_id, "pause", f"follows job {job}, which is {state}")
            if state != "done":
                return True
        return False

    def _keep_budget(self, view: JobView) -> None:
        """Pause a job that has spent its slot-hours; what runs, ends."""
        if view.budget_h and view.spent_h >= view.budget_h and view.state == "running":
            reason = f"its budget of {view.budget_h:g} slot-hours is spent"
            self._ledger.steer(view.job_id, "pause", f"{reason}; `pbrs-farm limit` raises it")

    def _read_users(self) -> None:
        if self._table is None:
            return
        self._users = self._dispatcher.users = self._table.all()
        if any(user.slot_hours for user in self._users.values()) and self._is_due(
            "spent", _SPENT_EVERY_S
        ):
            self._spent_h = self._table.spent_h()

    def _preempt(self, views: list[JobView]) -> None:
        """Have running tasks end where an urgent job's wait and no slot is free."""
        if not any(view.is_urgent for view in views):
            return
        chosen = choose_victims(views, self._ledger.holds, self._registry.workers())
        for job, holds in groupby(chosen, key=lambda hold: hold.job):
            n = self._ledger.preempt(job, self._token, list(holds))
            _log.info("interrupting %d tasks of job %s for an urgent job", n, job)

    def _block_jobs(self, views: list[JobView]) -> list[JobView]:
        """The jobs with the queues where they are blocked now; writes what changed to the ledger."""
        blocks, jobs, now = find_blocked_jobs(views, self._users, self._spent_h), [], self._clock()
        # Block only after a second over share; urgent jobs and spent slot-hours take effect
        # immediately.
        self._over_since = {job: self._over_since.get(job, now) for job in blocks}
        for view in views:
            block = blocks.get(view.job_id)
            queues: tuple[str, ...] = ()
            why = ""
            if block and (block.at_once or now - self._over_since[view.job_id] >= _OVER_SHARE_S):
                queues, why = block.queues, block.why
            if (queues, why) != (view.blocked_queues, view.blocked_why):
                self._ledger.set_blocked(view.job_id, queues, why)
                changed = {"blocked": ",".join(queues), "blocked_why": why}
                view = replace(view, fields={**view.fields, **changed})
            jobs.append(view)
        return jobs

    def _is_due(self, what: str, every_s: float) -> bool:
        now = self._clock()
        if now < self._due.get(what, 0.0):
            return False
        self._due[what] = now + every_s
        return True


def _notice(config: FarmConfig, ledger: RedisLedger) -> Callable[[], None]:
    """A function that posts news to the configured webhook; a no-op without one."""
    if not config.webhook.reveal():
        return lambda: None

    post, registry = poster(config.webhook), Registry(ledger)
    alerts = FarmAlerts(post)

    def look_at(views: list[JobView]) -> None:
        alerts.look(views, registry.workers(), registry.breaker())

    return watch_jobs(Webhook(ledger, post), ledger, look_at)


def main() -> int:
    """`python -m workers.coordinator.leader`: lead, or wait to lead, until a signal ends it.

    1, with a line on stderr, for an invalid configuration or scratch folder. It waits for Redis
    indefinitely, serves metrics if a port is configured, and gives up the lead on SIGTERM or SIGINT.
    """
    from workers.queue.celery_app import make_app

    log_to_stderr()
    try:
        config = config_from_environment()
        make_scratch(config)
        ledger = RedisLedger(config)
        ledger.wait_until_there(meanwhile=lambda: touch(config.heartbeat_file))
        notice = _notice(config, ledger)
    except PbrsError as error:
        sys.stderr.write(f"pbrs-farm: {error}\n")
        return 1
    _warn_of_lost_jobs(config, ledger)
    users = UserTable(ledger)
    _restore_users(config, users)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    if config.metrics_port:
        from workers.coordinator.metrics import serve_metrics

        serve_metrics(config, ledger)
    send = celery_sender(make_app(config))
    Coordinator(config, ledger, send, registry=Registry(ledger), notice=notice, users=users).run(
        stop
    )
    return 0


def _warn_of_lost_jobs(config: FarmConfig, ledger: RedisLedger) -> None:
    """Say which jobs the store knows where the ledger holds none: its data were lost."""
    from workers.coordinator.recover import lost_jobs

    if not config.store_url:
        return
    try:
        for job in lost_jobs(ledger, store_from_url(config.store_url, config.store)):
            _log.warning("the ledger is empty and the store has job %s: `recover %s`", job, job)
    except PbrsError as error:
        _log.warning("the store is not known yet: %s", error)


def _restore_users(config: FarmConfig, table: UserTable) -> None:
    """Take the store's users where Redis lost them."""
    try:
        if config.store_url and table.restore(store_from_url(config.store_url, config.store)):
            _log.info("loading users from the store")
    except PbrsError as error:
        _log.warning("users are not known yet: %s", error)


if __name__ == "__main__":
    sys.exit(main())
