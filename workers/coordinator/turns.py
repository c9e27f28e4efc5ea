"""Which user is next, for messages and for slots, and which of his jobs; no effects.

A user's load is what he holds divided by his share, and of those who wait the one with the least load is
next. Both decisions of the farm follow `Loads`: `MessageTurns.split` sends messages by it, and `find_blocked_jobs`
keeps workers from claiming the tasks of users who are over their share while others wait; the ledger's
scripts enforce that (`is_blocked` in ledger/lua/common.lua).

Among the jobs of one user it is stride scheduling (Waldspurger and Weihl 1995): in each pool a job has a pass;
the job with the least one is next, and its pass grows by its stride. The stride follows the rank of a
job's priority among those that have work, so that no job waits for ever and jobs of equal priority take turns.
"""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final

from workers.coordinator.job_counts import (
    WORK_POOLS,
    is_in_pool,
    n_queued_or_running,
    n_ready,
    n_slots,
)
from workers.ledger.task_ledger import EVERYWHERE, SPENT_DAYS, JobView, User

_TASKS_PER_RANK: Final = 9  # tasks of a job for one of a job of the next lower rank
_MOST_RANK: Final = 2  # ranks below this one get as much as it does
_URGENT: Final = "!"  # the user of urgent jobs; not a valid user name
_NOBODY: Final = User("")


class Loads:
    """Load of each user by held messages or slots and share, and the choice among several waiting users."""

    def __init__(self, held: Counter[str], share_of: Callable[[str], float]) -> None:
        self.held = held
        self.share_of = share_of

    def load(self, user: str) -> float:
        """The user's held slots, divided by the share."""
        return self.held[user] / self.share_of(user)

    def serve(self, waiting: Iterable[str], has_more: Callable[[str], bool]) -> Iterator[str]:
        """Users one after another, each time the one with the least load, who then holds one more.

        has_more: whether a user who was just served still waits.
        """
        heap = [(self.load(user), user) for user in waiting]
        heapq.heapify(heap)
        while heap:
            _load, user = heapq.heappop(heap)
            self.held[user] += 1
            yield user
            if has_more(user):
                heapq.heappush(heap, (self.load(user), user))

    def find_users_before(self, user: str, waiting: Collection[str]) -> list[str]:
        """The waiting users who get the next slot before this one.

        Their load is less, and still no more once they have one and he has one less: else two
        users would take turns at every task.
        """
        return [
            rival
            for rival in waiting
            if self.load(rival) < self.load(user)
            and (
                not self.held[rival]
                or (self.held[rival] + 1) / self.share_of(rival)
                <= (self.held[user] - 1) / self.share_of(user)
            )
        ]


@dataclass(frozen=True, slots=True)
class Block:
    """Where a job's tasks may not be claimed for now."""

    queues: tuple[
        str, ...
    ]  # a worker that takes one of them claims nothing; (EVERYWHERE,) = nobody does
    why: str
    at_once: bool = True  # False: only once it has lasted a while


def find_blocked_jobs(
    views: Sequence[JobView], users: Mapping[str, User], spent_h: Mapping[str, float]
) -> dict[str, Block]:
    """The running jobs whose tasks may not be claimed for now, by id.

    A job is blocked everywhere while its user has no slot-hours left, and on the queues where a task of an
    urgent job or of a user with less load waits. Urgent jobs are blocked by spent slot-hours alone.
    spent_h: user -> slot-hours used in the last SPENT_DAYS days.
    """
    running = [view for view in views if view.state == "running"]
    # Count slots by user, and note where somebody waits.
    urgent: dict[str, str] = {}  # pool -> the urgent job that waits there
    waiting: dict[str, set[str]] = defaultdict(set)  # user -> pools where he waits
    slots: Counter[str] = Counter()  # user -> slots
    for view in running:
        for pool in WORK_POOLS:
            slots[view.user] += n_slots(view, pool, "RUNNING")
            if n_slots(view, pool, "QUEUED"):
                waiting[view.user].add(pool)
                if view.is_urgent:
                    urgent[pool] = view.job_id
    loads = Loads(slots, lambda name: users.get(name, _NOBODY).share)

    # A worker's queue is named as the pool is.
    blocks: dict[str, Block] = {}
    for view in running:
        user, spent = users.get(view.user, _NOBODY), spent_h.get(view.user, 0.0)
        before = loads.find_users_before(view.user, waiting)
        if user.slot_hours and spent >= user.slot_hours:
            text = f"{user.name} has used {round(spent, 2):g} of {user.slot_hours:g} slot-hours"
            more = f"of {SPENT_DAYS} days; `pbrs-farm users limit` raises it"
            blocks[view.job_id] = Block((EVERYWHERE,), f"{text} {more}")
        elif urgent and not view.is_urgent:
            jobs = " and ".join(sorted(set(urgent.values())))
            blocks[view.job_id] = Block(tuple(sorted(urgent)), f"job {jobs} is urgent")
        elif before and not view.is_urgent:
            pools = set().union(*(waiting[name] for name in before))
            names = ", ".join(sorted(name or "jobs without a user" for name in before))
            why = f"tasks of {names} go first"
            blocks[view.job_id] = Block(tuple(sorted(pools)), why, at_once=False)
    return blocks


class _JobsInTurn:
    """The jobs that have work in a pool, each user's in their turn."""

    def __init__(
        self,
        wanting: Sequence[JobView],
        ready: Mapping[str, int],
        passes: Mapping[str, float],
        strides: Mapping[str, int],
    ) -> None:
        self._left = dict(ready)
        self._strides = strides
        self._of_user: dict[str, list[tuple[float, int, str]]] = {}
        # The least pass is next, the more urgent of two equal ones.
        for order, view in enumerate(wanting):
            entry = (passes[view.job_id], order, view.job_id)
            heapq.heappush(self._of_user.setdefault(_user_of(view), []), entry)

    @property
    def users(self) -> list[str]:
        return list(self._of_user)

    def has(self, user: str) -> bool:
        return bool(self._of_user.get(user))

    def take(self, user: str) -> str:
        """The user's job whose task is next."""
        place, order, job = heapq.heappop(self._of_user[user])
        self._left[job] -= 1
        if self._left[job]:
            heapq.heappush(self._of_user[user], (place + self._strides[job], order, job))
        return job


class MessageTurns:
    """Decides how many tasks of each job are sent next; one per leading coordinator.

    It remembers the number sent to each job as passes: `split` proposes, and `charge` counts tasks actually
    sent.
    """

    def __init__(self) -> None:
        self._passes: dict[str, dict[str, float]] = {}  # pool -> job -> pass
        self._strides: dict[str, dict[str, int]] = {}

    def split(
        self,
        room: Mapping[str, int],
        views: Sequence[JobView],
        *,
        windows: Mapping[str, int] | None = None,
        share_of: Callable[[str], float] = lambda _user: 1.0,
    ) -> dict[str, dict[str, int]]:
        """Job -> pool -> how many of its tasks may be sent.

        room: pool -> how many more messages fit into its window; what no job has ready is left over.
        views: all jobs, most urgent first. windows: pool -> most messages in flight; urgent jobs may
        fill all of it and each user his share of it even where no room is left, so who comes late need
        not wait until the others' tasks have ended. share_of: a user's share.
        """
        quotas = {view.job_id: dict.fromkeys(room, 0) for view in views}
        for pool, n_free in room.items():
            window = (windows or {}).get(pool, 0)
            for job in self._take_turns(pool, n_free, views, window, share_of):
                quotas[job][pool] += 1
        return quotas

    def charge(self, pool: str, job: str, n_sent: int) -> None:
        """Count sent tasks of a job, maybe fewer than `split` gave; no effect without turns there."""
        if job in self._passes.get(pool, {}):
            self._passes[pool][job] += n_sent * self._strides[pool][job]

    def _take_turns(
        self,
        pool: str,
        n_free: int,
        views: Sequence[JobView],
        window: int,
        share_of: Callable[[str], float],
    ) -> Iterator[str]:
        """Jobs in the order in which their tasks are sent, one for each task."""
        ready = {v.job_id: n_ready(v, pool) for v in views}
        wanting = [v for v in views if ready[v.job_id]]
        self._update_strides(pool, wanting)
        jobs = _JobsInTurn(wanting, ready, self._passes[pool], self._strides[pool])
        loads = Loads(_count_in_flight(views, pool), share_of)
        # Serve urgent jobs first, up to the whole window.
        while jobs.has(_URGENT) and loads.held[_URGENT] < window:
            loads.held[_URGENT] += 1
            n_free -= 1
            yield jobs.take(_URGENT)
        # Then the user with the least load, while there is room.
        users = [user for user in jobs.users if user != _URGENT]
        for user in islice(loads.serve(users, jobs.has), max(0, n_free)):
            yield jobs.take(user)
        # Then, without room, every user up to his share of the window.
        n_shares = sum(share_of(user) for user in loads.held if user != _URGENT)
        for user in users:
            quota = max(1, int(window * share_of(user) / n_shares)) if window else 0
            while jobs.has(user) and loads.held[user] < quota:
                loads.held[user] += 1
                yield jobs.take(user)

    def _update_strides(self, pool: str, wanting: Sequence[JobView]) -> None:
        """Passes and strides of the jobs that have work in a pool; the others' are forgotten."""
        ranks = {p: rank for rank, p in enumerate(sorted({v.priority for v in wanting}))}
        strides = {v.job_id: _TASKS_PER_RANK ** min(ranks[v.priority], _MOST_RANK) for v in wanting}
        before = self._passes.get(pool, {})
        passes = {v.job_id: before[v.job_id] for v in wanting if v.job_id in before}
        # A new job begins one stride behind the others, and none is further behind than that:
        # neither a pause nor a lower priority of earlier is held against a job.
        least = min(passes.values(), default=0.0)
        self._passes[pool] = {
            job: min(passes.get(job, least + stride), least + stride)
            for job, stride in strides.items()
        }
        self._strides[pool] = strides


def _user_of(view: JobView) -> str:
    return _URGENT if view.is_urgent else view.user


def _count_in_flight(views: Sequence[JobView], pool: str) -> Counter[str]:
    """User -> queued and running tasks in a pool; 0 for users with only ready tasks."""
    n_of_user: Counter[str] = Counter()
    for view in views:
        n = n_queued_or_running(view, pool)
        if is_in_pool(view, pool) and (n or n_ready(view, pool)):
            n_of_user[_user_of(view)] += n
    return n_of_user
