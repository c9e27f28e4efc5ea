"""The coordinator: one leader that admits houses, sends messages, and ends the leases of the dead.

Effects: Redis and its broker. It keeps a window of messages in flight, so Redis stays small
whatever the size of a job; it may be killed at any time, and a standby takes over in 15 seconds.
"""

from __future__ import annotations

import json
import logging
import math
import os
import platform
import secrets
import signal
import sys
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any, Final
from urllib.parse import urlsplit

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.store import store_from_url
from pbrs_farm.store.secret import Secret
from workers.config import FarmConfig, config_from_environment, make_scratch
from workers.coordinator.farm_alerts import FarmAlerts
from workers.coordinator.progress_rates import Rates, mean_s
from workers.coordinator.shares import Shares, is_in, is_shut, n_ready, stage_of_lane
from workers.coordinator.teams import TURN, barred, n_in_flight, together, victims
from workers.ids import LEASES, STAGES, TaskId, group_text, lane_of, queue_of, task_from_text
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import (
    WITH_FAILURES,
    JobView,
    Ledger,
    LedgerUnavailable,
    User,
    Users,
    WorkerRegistry,
)
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
_TURN_S: Final = 1.0  # that a user holds more than his share before others go first
_AHEAD_S: Final = 20.0  # of work on a queue; a standby leads after 15
_WITHOUT_SLOTS: Final = 8  # messages of a stage that nobody takes yet


Send = Callable[[Iterable[tuple[str, str, str, str]]], None]


class Coordinator:
    """Leads the farm, or stands by until the leader is gone.

    send: puts messages on queues, each (queue, job, task, recipe digest). clock: monotonic, s.
    notice: called now and then while it leads; tells others of jobs that ended. users: whose jobs
    share the slots, without it nobody's.
    """

    def __init__(
        self,
        config: FarmConfig,
        ledger: Ledger,
        send: Send,
        *,
        registry: WorkerRegistry,
        notice: Callable[[], None] = lambda: None,
        users: Users | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config = config
        self._ledger = ledger
        self._registry = registry
        self._send = send
        self._notice = notice
        self._table = users
        self._over_since: dict[str, float] = {}  # job that lets others go first -> since when
        self._users: Mapping[str, User] = {}
        self._spent_h: Mapping[str, float] = {}  # user -> slot-hours of his jobs in the last days
        self._clock = clock
        self._token = f"{platform.node()}:{os.getpid()}:{secrets.token_hex(4)}"
        self._due: dict[str, float] = {}  # duty -> when it is due next
        self._slots: dict[str, int] = {}  # stage -> tasks the workers can run at once
        self._rates = Rates()
        self._shares = Shares()
        self._waiting: set[str] = set()  # jobs that follow others
        self.leading = False

    def run(self, stop: threading.Event) -> None:
        """Turn after turn until told to stop; Redis may go away and come back."""
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
        """One round of duties; how many messages were sent."""
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
            self._slots = self._registry.slots()
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
        views = self._with_bars(views)
        n_sent = self._dispatch([v for v in views if v.job_id not in self._waiting])
        if self._is_due("resend", _RESEND_EVERY_S):
            n_sent += self._resend(views)
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
        self._users = self._table.all()
        if any(user.slot_hours for user in self._users.values()) and self._is_due(
            "spent", _SPENT_EVERY_S
        ):
            self._spent_h = self._table.spent_h()

    def _preempt(self, views: list[JobView]) -> None:
        """Tell running tasks to end where an urgent job's wait and no slot is free."""
        if not any(view.is_urgent for view in views):
            return
        chosen = victims(views, self._ledger.holds, self._registry.workers())
        for job, holds in groupby(chosen, key=lambda hold: hold.job):
            n = self._ledger.preempt(job, self._token, list(holds))
            _log.info("%d tasks of job %s make room for an urgent one", n, job)

    def _with_bars(self, views: list[JobView]) -> list[JobView]:
        """The jobs with the queues where others go first; tells the ledger what changed."""
        bars, found, now = barred(views, self._users, self._spent_h), [], self._clock()
        # What is over within a second needs no bar; what is urgent or spent waits for none.
        self._over_since = {job: self._over_since.get(job, now) for job in bars}
        for view in views:
            job = view.job_id
            queues, why = bars.get(job, ((), ""))
            if why.startswith(TURN) and now - self._over_since[job] < _TURN_S:
                queues, why = (), ""
            if (queues, why) != (view.barred, view.fields.get("barred_why", "")):
                self._ledger.set_barred(view.job_id, queues, why)
                fields = {**view.fields, "barred": ",".join(queues), "barred_why": why}
                view = replace(view, fields=fields)
            found.append(view)
        return found

    def _dispatch(self, views: list[JobView]) -> int:
        """Send what there is room for, by the jobs' priorities; how many messages."""
        windows = self._windows(views)
        room = {lane: _room(views, lane, n) for lane, n in windows.items()}
        given = self._shares.split(room, views, windows=windows, share_of=self._share_of)
        left = {v.job_id: _left_of(v) for v in views}  # of a job's own ceiling
        users_left = self._left_of_users(views)
        spare = {s: max(0, n - sum(own[s] for own in given.values())) for s, n in room.items()}
        # Each job its share and what those before it left; then what is still free to whoever has
        # more: a ready task may be waiting for its time, and one may have become ready meanwhile.
        n_sent, rest = 0, list(views)
        for allowed in (given, {v.job_id: dict.fromkeys(room, 0) for v in views}):
            limited = []
            for view in rest:
                may_send = {s: n + spare[s] for s, n in allowed[view.job_id].items()}
                most = min(left[view.job_id], users_left.get(view.user, math.inf))
                n_by_lane = self._send_of(view, _within(may_send, view, most))
                if n_by_lane is None:
                    self.leading = False
                    return n_sent
                n_sent += n_by_lane.total()
                left[view.job_id] -= n_by_lane.total()
                if view.user in users_left:
                    users_left[view.user] -= n_by_lane.total()
                spare = {s: n - n_by_lane[s] for s, n in may_send.items()}
                if any(n_by_lane[s] == n and n_ready(view, s) > n for s, n in may_send.items()):
                    limited.append(view)
            rest = limited if any(spare.values()) else []
        return n_sent

    def _send_of(self, view: JobView, may_send: dict[str, int]) -> Counter[str] | None:
        """Lane -> tasks of one job that were sent, at most may_send; None: not leading."""
        gpu = view.uses_gpu
        tasks = self._ledger.dispatch(
            view.job_id,
            self._token,
            max_open=self._max_open(),
            room={
                stage: 0 if is_shut(view, stage) else may_send[lane_of(stage, gpu=gpu)]
                for stage in STAGES
            },
        )
        if tasks is None:
            return None
        self._publish(view, tasks)
        sent = Counter(lane_of(task.rpartition("/")[2], gpu=gpu) for task in tasks)
        for lane, n in sent.items():
            self._shares.charge(lane, view.job_id, n)
        return sent

    def _share_of(self, user: str) -> float:
        return self._users[user].share if user in self._users else 1.0

    def _left_of_users(self, views: list[JobView]) -> dict[str, float]:
        """User who has a ceiling -> how many more tasks of his jobs may be in flight."""
        left: dict[str, float] = {u.name: u.max_slots for u in self._users.values() if u.max_slots}
        for view in views:
            if view.user in left:
                left[view.user] = max(0, left[view.user] - n_in_flight(view))
        return left

    def _windows(self, views: list[JobView]) -> dict[str, int]:
        """Lane -> messages in flight, over all jobs.

        Light on a GPU has a window of its own: messages that no worker takes hold up no others.
        """
        return {
            lane: self._window([v for v in views if is_in(v, lane)], stage_of_lane(lane))
            for lane in LEASES
        }

    def _window(self, views: list[JobView], stage: str) -> int:
        """Messages of a stage in flight: what slots run, and what they will take soon.

        A queue serves who came first: the shorter it is, the sooner a job's new priority counts.
        """
        n_slots = self._slots.get(stage, 0)
        most = max(self._config.window_min, self._config.window_per_slot * n_slots)
        if not n_slots:
            return min(most, _WITHOUT_SLOTS)
        # Twice as many as run, so that an autoscaler sees more work than there is; more where
        # tasks are short and a standby may need its time to take the lead.
        seconds = mean_s(views, stage)
        per_slot = 1 + max(1, math.ceil(_AHEAD_S / seconds)) if seconds else 2
        return min(most, per_slot * n_slots)

    def _max_open(self) -> int:
        n_slots = max(self._slots.values(), default=0)
        return max(self._config.window_min, self._config.window_per_slot * n_slots)

    def _resend(self, views: list[JobView]) -> int:
        """Messages lost between the ledger and the broker: their queue is empty, they are old."""
        n_sent = 0
        for view in views:
            for stage in STAGES:
                # A message that waits on its queue is late, not lost.
                queue = queue_of(stage, gpu=view.uses_gpu)
                if not view.counts.get(f"{stage}:q") or self._ledger.queue_length(queue):
                    continue
                tasks = self._ledger.resend(view.job_id, self._token, stage, self._config.resend_s)
                if tasks:
                    _log.info("sending %d messages of %s again", len(tasks), stage)
                    self._publish(view, tasks)
                    n_sent += len(tasks)
        return n_sent

    def _publish(self, view: JobView, tasks: list[str]) -> None:
        """Send messages; short tasks of one house go together, as long as each slot gets some."""
        gpu, recipe = view.uses_gpu, view.fields["recipe"]
        # The ledger gives a house's tasks one after another.
        for stage, of_stage in _by_stage(tasks).items():
            n_slots = max(1, self._slots.get(stage, 0))
            n_in_flight = sum(view.counts.get(f"{stage}:{s}", 0) for s in "qr") + len(of_stage)
            most = min(together(view, stage), math.ceil(n_in_flight / n_slots))
            queue = queue_of(stage, gpu=gpu)
            self._send(
                (queue, view.job_id, group_text(group), recipe) for group in _groups(of_stage, most)
            )

    def _is_due(self, what: str, every_s: float) -> bool:
        now = self._clock()
        if now < self._due.get(what, 0.0):
            return False
        self._due[what] = now + every_s
        return True


def _room(views: list[JobView], lane: str, window: int) -> int:
    """How much of a window is free: neither queued nor running."""
    stage = stage_of_lane(lane)
    here = [v for v in views if is_in(v, lane)]
    return max(0, int(window - sum(v.counts.get(f"{stage}:{s}", 0) for v in here for s in "qr")))


def _left_of(view: JobView) -> float:
    """How many more tasks of a job may be in flight."""
    return max(0, view.max_slots - n_in_flight(view)) if view.max_slots else math.inf


def _within(may_send: dict[str, int], view: JobView, most: float) -> dict[str, int]:
    """Lane -> tasks that may be sent, together at most so many; the last stages first."""
    if math.isinf(most):
        return may_send
    allowed = dict.fromkeys(may_send, 0)
    for lane in reversed(LEASES):
        allowed[lane] = min(may_send[lane], n_ready(view, lane), int(most))
        most -= allowed[lane]
    return allowed


def _by_stage(tasks: Iterable[str]) -> dict[str, list[TaskId]]:
    found: dict[str, list[TaskId]] = {}
    for task in map(task_from_text, tasks):
        found.setdefault(task.stage, []).append(task)
    return found


def _groups(tasks: Sequence[TaskId], most: int) -> Iterator[list[TaskId]]:
    """Neighbours of one house, at most so many together."""
    for _house, of_house in groupby(tasks, key=lambda task: task.house):
        rest = list(of_house)
        for k in range(0, len(rest), most):
            yield rest[k : k + most]


# Nothing to be declared (a message goes to a queue by its name), and no repr of its arguments.
_MESSAGE_OPTIONS: Final[dict[str, Any]] = {"declare": (), "argsrepr": "", "kwargsrepr": ""}


def celery_sender(app: Any) -> Send:
    """send for a Coordinator, through a Celery application."""
    from kombu.exceptions import OperationalError

    def send(messages: Iterable[tuple[str, str, str, str]]) -> None:
        try:
            # One connection and one round trip for the whole batch of messages.
            pool = app.producer_pool
            with pool.acquire(block=True, timeout=10) as producer, producer.batch():
                for queue, job, task, recipe in messages:
                    app.send_task(
                        "pbrs.run", args=(job, task, recipe), queue=queue, producer=producer,
                        **_MESSAGE_OPTIONS,
                    )  # fmt: skip
        except (OperationalError, OSError) as error:
            # What was not sent stays "q" in the ledger, and is sent again when it is old.
            raise LedgerUnavailable(f"the broker took no message: {error}") from error

    return send


def _notice(config: FarmConfig, ledger: RedisLedger) -> Callable[[], None]:
    """What tells the configured webhook; nothing where there is none."""
    if not config.webhook.reveal():
        return lambda: None

    post, registry = poster(config.webhook), Registry(ledger)
    alerts = FarmAlerts(post)

    def look_at(views: list[JobView]) -> None:
        alerts.look(views, registry.workers(), registry.breaker())

    return watch_jobs(Webhook(ledger, post), ledger, look_at)


def main() -> int:
    """`python -m workers.coordinator.leader`: lead, or stand by, until told to leave."""
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
    _tell_of_lost_jobs(config, ledger)
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


def _tell_of_lost_jobs(config: FarmConfig, ledger: RedisLedger) -> None:
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
            _log.info("users are taken from the store")
    except PbrsError as error:
        _log.warning("users are not known yet: %s", error)


# Tells a URL when a job ends or pauses itself: one POST of JSON. Effects: a request, the ledger.
# The ledger keeps what was told last of each job, so a new leader repeats nothing and misses
# nothing.


_webhook_log = logging.getLogger("pbrs.webhook")
_TIMEOUT_S: Final = 10.0
_MOST_TRIES: Final = 5
_NEWEST: Final = 50  # jobs that are looked at
_TOLD_STATES: Final = ("done", WITH_FAILURES, "paused", "cancelled")

Post = Callable[[dict[str, Any]], None]


class Webhook:
    """Looks at jobs as the leader sees them and posts each new end or pause. post: may raise OSError."""

    def __init__(self, ledger: Ledger, post: Post) -> None:
        self._ledger = ledger
        self._post = post
        self._tries: Counter[tuple[str, str]] = Counter()

    def look(self, views: list[JobView]) -> None:
        """Tell what is new of these jobs."""
        for view in views:
            told = view.fields.get("told", "")
            if view.outcome not in _TOLD_STATES:
                # A job that runs again may end or pause again.
                if told:
                    self._ledger.set_told(view.job_id, "")
            elif view.outcome != told:
                self._tell(view)

    def _tell(self, view: JobView) -> None:
        try:
            self._post(notice(view))
        except (OSError, ValueError) as error:
            self._tries[view.job_id, view.outcome] += 1
            _webhook_log.warning("the webhook took nothing: %s", error)
            if self._tries[view.job_id, view.outcome] < _MOST_TRIES:
                return
        self._ledger.set_told(view.job_id, view.outcome)


def notice(view: JobView) -> dict[str, Any]:
    """What is posted of a job; `text` is what chat programs show."""
    counts = view.counts
    reason = view.fields.get("reason", "")
    row: dict[str, Any] = {
        "job": view.job_id,
        "state": view.outcome,
        "reason": reason,
        "recipe": view.fields.get("recipe_name", ""),
        "houses": int(view.fields.get("n_houses", 0)),
        "houses_done": int(counts.get("houses:done", 0)),
        "houses_quarantined": int(counts.get("houses:quarantined", 0)),
        "views": int(counts.get("views", 0)),
        "tasks_failed": view.n_failed,
    }
    text = f"pbrs_farm: job {view.job_id} {view.outcome}{f': {reason}' if reason else ''}"
    text += f"; {row['houses_done']} of {row['houses']} houses, {row['views']} views"
    if view.n_failed:
        text += f", {view.n_failed} task{'s' if view.n_failed > 1 else ''} failed"
    return row | {"text": text}


def poster(url: Secret) -> Post:
    """A Post to the URL. Raises BadInput for one that is no http or https."""
    if urlsplit(url.reveal()).scheme not in ("http", "https"):
        raise BadInput("environment", "PBRS_WEBHOOK", "expected an http:// or https:// URL")

    def post(row: dict[str, Any]) -> None:
        request = urllib.request.Request(
            url.reveal(), json.dumps(row).encode(), {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(request, timeout=_TIMEOUT_S):
            pass

    return post


def watch_jobs(
    webhook: Webhook, ledger: Ledger, look_at: Callable[[list[JobView]], None] = lambda _views: None
) -> Callable[[], None]:
    """What the leader calls now and then: a look at the newest jobs, in a thread of its own.

    look_at: is shown the same jobs.

    A URL that does not answer holds up no task; while one look lasts no other begins.
    """
    # Taken by begin, given back by the thread that it starts.
    busy = threading.Lock()

    def look() -> None:
        try:
            known = ledger.known_jobs()[-_NEWEST:]
            views = [v for job in known if (v := ledger.view(job)) is not None]
            webhook.look(views)
            look_at(views)
        except LedgerUnavailable as error:
            _webhook_log.warning("no notice: %s", error)
        finally:
            busy.release()

    def begin() -> None:
        if busy.acquire(blocking=False):
            threading.Thread(target=look, daemon=True).start()

    return begin


if __name__ == "__main__":
    sys.exit(main())
