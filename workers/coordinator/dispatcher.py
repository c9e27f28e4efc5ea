"""Sends ready tasks to the queues: within a window of messages in flight, by turns. Effects: ledger, broker.

A queue serves who came first, so it is kept short: the sooner a job's new priority counts. The window is what
slots run and will take soon; `MessageTurns` divides it among jobs and users; jobs and users may have ceilings.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, Final

from workers.config import FarmConfig
from workers.coordinator.job_counts import (
    is_in_pool,
    is_stopped,
    n_claimed_together,
    n_queued_or_running,
    n_ready,
)
from workers.coordinator.progress_rates import mean_s
from workers.coordinator.turns import MessageTurns
from workers.ids import (
    POOLS,
    STAGES,
    TaskId,
    group_text,
    pool_of,
    queue_of,
    stage_of_pool,
    task_from_text,
)
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import JobView, LedgerUnavailable, User

_log = logging.getLogger("pbrs.coordinator")
_AHEAD_S: Final = (
    20.0  # of work that waits on a queue: outlasts a failover, in which a standby leads after 15 s
)
_WITHOUT_SLOTS: Final = 8  # messages of a stage that nobody takes yet
# Nothing to be declared (a message goes to a queue by its name), and no repr of its arguments.
_MESSAGE_OPTIONS: Final[dict[str, Any]] = {"declare": (), "argsrepr": "", "kwargsrepr": ""}

Send = Callable[[Iterable[tuple[str, str, str, str]]], None]


class NotLeading(Exception):
    """The ledger moved nothing, because another coordinator leads by now."""


class Dispatcher:
    """Sends tasks for the leading coordinator.

    send: puts messages on queues, each (queue, job, task, recipe digest). token: the coordinator's; the
    ledger moves tasks only for the leader's. The leader keeps `slots` and `users` up to date.
    """

    def __init__(self, config: FarmConfig, ledger: RedisLedger, send: Send, token: str) -> None:
        self.slots: Mapping[str, int] = {}  # stage -> maximum concurrent tasks of the workers
        self.users: Mapping[str, User] = {}
        self._config = config
        self._ledger = ledger
        self._send = send
        self._token = token
        self._turns = MessageTurns()

    def send_ready(self, views: Sequence[JobView]) -> int:
        """Send ready tasks up to the available capacity; returns their number.

        views: most urgent first. Capacity is what slots can take soon, so that a job of millions of tasks does
        not fill the broker. Shares between users and priorities hold over time, not per call: capacity that a
        job does not use goes to others. Raises NotLeading, and LedgerUnavailable if Redis or the broker does
        not answer; unsent tasks are sent later.
        """
        windows = self._windows(views)
        room = {pool: _free_in_window(views, pool, n) for pool, n in windows.items()}
        quotas = self._turns.split(room, views, windows=windows, share_of=self._share_of)
        ceilings = _Ceilings(views, self.users)
        spare = {
            pool: max(0, n - sum(of_job[pool] for of_job in quotas.values()))
            for pool, n in room.items()
        }
        # Send each job its quota. Fewer tasks may be available: a ready task may be waiting for its
        # next
        # attempt. So the rest of one job's quota goes to the next, and finally to any job with
        # more.
        n_sent, with_more = self._send_round(views, quotas, spare, ceilings)
        if any(spare.values()):
            n_sent += self._send_round(with_more, {}, spare, ceilings)[0]
        return n_sent

    def send_lost_again(self, views: Sequence[JobView]) -> int:
        """Resend tasks lost between ledger and broker: old messages with an empty queue.

        Only for a stage whose queue is empty and whose tasks have waited `resend_s` seconds. A duplicate
        message is harmless: the second claim is refused. Returns the number of messages, 0 if another
        coordinator leads.
        """
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

    def _send_round(
        self,
        views: Sequence[JobView],
        quotas: Mapping[str, Mapping[str, int]],
        spare: dict[str, int],
        ceilings: _Ceilings,
    ) -> tuple[int, list[JobView]]:
        """Dispatch each job's quota plus spare capacity. Returns the number of tasks and the jobs with more work.

        quotas: job -> pool -> tasks. spare: pool -> tasks of any job; reduced by tasks beyond a quota, and
        raised by unused quotas.
        """
        n_sent, with_more = 0, []
        for view in views:
            quota = quotas.get(view.job_id, {})
            most = {pool: n + quota.get(pool, 0) for pool, n in spare.items()}
            sent = self._send_job(view, ceilings.limit(most, view))
            n_sent += sent.total()
            ceilings.count(view, sent.total())
            spare.update({pool: n - sent[pool] for pool, n in most.items()})
            if any(sent[pool] == n and n_ready(view, pool) > n for pool, n in most.items()):
                with_more.append(view)
        return n_sent, with_more

    def _send_job(self, view: JobView, most: Mapping[str, int]) -> Counter[str]:
        """Send tasks of one job, at most most[pool]; pool -> how many were."""
        gpu = view.uses_gpu
        tasks = self._ledger.dispatch(
            view.job_id,
            self._token,
            max_open=self._most_open_houses(),
            room={
                stage: 0 if is_stopped(view, stage) else most[pool_of(stage, gpu=gpu)]
                for stage in STAGES
            },
        )
        if tasks is None:
            raise NotLeading
        self._publish(view, tasks)
        sent = Counter(pool_of(task.rpartition("/")[2], gpu=gpu) for task in tasks)
        for pool, n in sent.items():
            self._turns.charge(pool, view.job_id, n)
        return sent

    def _publish(self, view: JobView, tasks: Iterable[str]) -> None:
        """Send messages; short tasks of one house go together, as long as each slot gets some."""
        gpu, recipe = view.uses_gpu, view.fields["recipe"]
        # The ledger gives a house's tasks one after another.
        for stage, of_stage in _by_stage(tasks).items():
            n_slots = max(1, self.slots.get(stage, 0))
            n_in_flight = sum(view.counts.get(f"{stage}:{s}", 0) for s in "qr") + len(of_stage)
            most = min(n_claimed_together(view, stage), math.ceil(n_in_flight / n_slots))
            queue = queue_of(stage, gpu=gpu)
            self._send(
                (queue, view.job_id, group_text(group), recipe) for group in _groups(of_stage, most)
            )

    def _share_of(self, user: str) -> float:
        return self.users[user].share if user in self.users else 1.0

    def _windows(self, views: Sequence[JobView]) -> dict[str, int]:
        """Pool -> most messages in flight, over all jobs."""
        return {
            pool: self._window([v for v in views if is_in_pool(v, pool)], stage_of_pool(pool))
            for pool in POOLS
        }

    def _window(self, views: list[JobView], stage: str) -> int:
        """Most messages of a stage in flight: what slots run, and what they will take soon."""
        n_slots = self.slots.get(stage, 0)
        most = max(self._config.window_min, self._config.window_per_slot * n_slots)
        if not n_slots:
            return min(most, _WITHOUT_SLOTS)
        # Twice as many as run, so that an autoscaler sees more work than there is; more where
        # tasks are short and a standby may need its time to take the lead.
        seconds = mean_s(views, stage)
        per_slot = 1 + max(1, math.ceil(_AHEAD_S / seconds)) if seconds else 2
        return min(most, per_slot * n_slots)

    def _most_open_houses(self) -> int:
        n_slots = max(self.slots.values(), default=0)
        return max(self._config.window_min, self._config.window_per_slot * n_slots)


class _Ceilings:
    """Remaining tasks in flight of a job and of a user, if limited."""

    def __init__(self, views: Sequence[JobView], users: Mapping[str, User]) -> None:
        self._of_job = {v.job_id: max(0, v.max_slots - v.n_in_flight) for v in views if v.max_slots}
        self._of_user: dict[str, float] = {
            u.name: u.max_slots for u in users.values() if u.max_slots
        }
        for view in views:
            if view.user in self._of_user:
                self._of_user[view.user] = max(0, self._of_user[view.user] - view.n_in_flight)

    def limit(self, most: Mapping[str, int], view: JobView) -> Mapping[str, int]:
        """Pool -> tasks of the job that may be sent: most, under its ceilings; the last stages first."""
        n_left = min(
            self._of_job.get(view.job_id, math.inf), self._of_user.get(view.user, math.inf)
        )
        if math.isinf(n_left):
            return most
        allowed = dict.fromkeys(most, 0)
        for pool in reversed(POOLS):
            allowed[pool] = min(most[pool], n_ready(view, pool), int(n_left))
            n_left -= allowed[pool]
        return allowed

    def count(self, view: JobView, n_sent: int) -> None:
        """So many tasks of the job were sent."""
        if view.job_id in self._of_job:
            self._of_job[view.job_id] -= n_sent
        if view.user in self._of_user:
            self._of_user[view.user] -= n_sent


def _free_in_window(views: Sequence[JobView], pool: str, window: int) -> int:
    """Free part of a window: neither queued nor running."""
    return max(0, window - sum(n_queued_or_running(view, pool) for view in views))


def _by_stage(tasks: Iterable[str]) -> dict[str, list[TaskId]]:
    by_stage: dict[str, list[TaskId]] = {}
    for task in map(task_from_text, tasks):
        by_stage.setdefault(task.stage, []).append(task)
    return by_stage


def _groups(tasks: Sequence[TaskId], most: int) -> Iterator[list[TaskId]]:
    """Neighbours of one house, at most so many together."""
    for _house, of_house in groupby(tasks, key=lambda task: task.house):
        rest = list(of_house)
        for k in range(0, len(rest), most):
            yield rest[k : k + most]


def celery_sender(app: Any) -> Send:
    """A function that sends messages through a Celery application.

    app: of `make_app`. A message is (queue, job, tasks as `group_text` writes them, digest of the
    recipe). The function raises LedgerUnavailable where the broker takes no message; some of the
    batch may have gone out.
    """
    import redis
    from kombu.exceptions import BatchPublishError, OperationalError

    # A connection lost during a batch does not raise OperationalError.
    away = (OperationalError, BatchPublishError, redis.ConnectionError, redis.TimeoutError, OSError)

    def send(messages: Iterable[tuple[str, str, str, str]]) -> None:
        try:
            # One connection and one round trip for the whole batch of messages.
            pool = app.producer_pool
            with pool.acquire(block=True, timeout=10) as producer, producer.batch():
                for queue, job, task, recipe in messages:
                    app.send_task(
                        "pbrs.run",
                        args=(job, task, recipe),
                        queue=queue,
                        producer=producer,
                        **_MESSAGE_OPTIONS,
                    )
        except away as error:
            # Unsent tasks stay "q" in the ledger, and are resent when they are old.
            why = error.__cause__ if isinstance(error, BatchPublishError) else error
            raise LedgerUnavailable(f"the broker accepts no messages: {why}") from error

    return send
