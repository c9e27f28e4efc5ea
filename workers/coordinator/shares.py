"""Whose tasks are sent next: the user's with the least in flight, then his most urgent job's; no effects.

Stride scheduling (Waldspurger and Weihl 1995): at each stage a job has a pass; the job with the least one is
next, and its pass grows by its stride. The stride follows the rank of a job's priority among those
that have work, so that no job waits for ever and jobs of equal priority take turns. Of several users
the one with the fewest tasks in flight over his share is next, and each may fill his share of the window
even while others' tasks fill it: who comes late need not wait until theirs have ended.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from workers.ids import DEFAULT_PRIORITY, GEOMETRY, GL, JOB, LIGHT, LIGHT_GPU, lane_of
from workers.ledger.task_ledger import EVERYWHERE, STATES, JobView

_RATIO: Final = 9  # tasks of a job for one of a job of the next lower rank
_MOST_RANK: Final = 2  # ranks below this one get as much as it does


_URGENT: Final = "!"  # stands for the user of urgent jobs; no user's name


class _Turns:
    """The jobs that have work in a lane, of each user in their turn."""

    def __init__(
        self,
        wanting: Sequence[JobView],
        ready: Mapping[str, int],
        passes: Mapping[str, float],
        strides: Mapping[str, int],
    ) -> None:
        self._left = dict(ready)
        self._strides = strides
        self._of: dict[str, list[tuple[float, int, str]]] = {}
        # The least pass is next, the more urgent of two equal ones.
        for order, view in enumerate(wanting):
            row = (passes[view.job_id], order, view.job_id)
            heapq.heappush(self._of.setdefault(_whose(view), []), row)

    @property
    def users(self) -> list[str]:
        return list(self._of)

    def has(self, user: str) -> bool:
        return bool(self._of.get(user))

    def take(self, user: str) -> str:
        """The user's job whose task is next."""
        at, order, job = heapq.heappop(self._of[user])
        self._left[job] -= 1
        if self._left[job]:
            heapq.heappush(self._of[user], (at + self._strides[job], order, job))
        return job


class Shares:
    """What each job was sent so far, as passes; one per leading coordinator."""

    def __init__(self) -> None:
        self._passes: dict[str, dict[str, float]] = {}  # stage -> job -> pass
        self._strides: dict[str, dict[str, int]] = {}

    def split(
        self,
        room: Mapping[str, int],
        views: Sequence[JobView],
        *,
        windows: Mapping[str, int] | None = None,
        share_of: Callable[[str], float] = lambda _user: 1.0,
    ) -> dict[str, dict[str, int]]:
        """Job -> lane -> how many of its tasks may be sent, together at most room[lane].

        A lane is a stage, or light on a GPU. views: most urgent first. What no job has ready is
        left over. Charges nothing: `charge` does.

        windows: lane -> tasks in flight, of which a user may have his share and urgent jobs all,
        whatever the room. share_of: a user's.
        """
        given = {view.job_id: dict.fromkeys(room, 0) for view in views}
        for stage, n_free in room.items():
            ready = {v.job_id: n_ready(v, stage) for v in views}
            wanting = [v for v in views if ready[v.job_id]]
            self._enter(stage, wanting)
            turns = _Turns(wanting, ready, self._passes[stage], self._strides[stage])
            in_flight = _in_flight(views, stage)
            window = (windows or {}).get(stage, 0)

            def give(user: str, turns: _Turns = turns, n: Counter[str] = in_flight) -> str:
                n[user] += 1
                return turns.take(user)

            # Urgent jobs first, whatever else is on its way.
            while turns.has(_URGENT) and in_flight[_URGENT] < window:
                given[give(_URGENT)][stage] += 1
                n_free -= 1
            # Then the user with the least in flight over his share.
            users = [(in_flight[u] / share_of(u), u) for u in turns.users if u != _URGENT]
            heapq.heapify(users)
            while users and n_free > 0:
                _least, user = heapq.heappop(users)
                given[give(user)][stage] += 1
                n_free -= 1
                if turns.has(user):
                    heapq.heappush(users, (in_flight[user] / share_of(user), user))
            # Whose share of the window others fill has it nevertheless.
            total = sum(share_of(u) for u in in_flight if u != _URGENT)
            for _least, user in users:
                own = max(1, int(window * share_of(user) / total)) if window else 0
                while turns.has(user) and in_flight[user] < own:
                    given[give(user)][stage] += 1
        return given

    def charge(self, stage: str, job: str, n_sent: int) -> None:
        """So many tasks of the job were sent."""
        if job in self._passes.get(stage, {}):
            self._passes[stage][job] += n_sent * self._strides[stage][job]

    def _enter(self, stage: str, wanting: Sequence[JobView]) -> None:
        """Passes and strides of the jobs that have work at a stage; the others' are forgotten."""
        ranks = {p: rank for rank, p in enumerate(sorted({priority_of(v) for v in wanting}))}
        strides = {v.job_id: _RATIO ** min(ranks[priority_of(v)], _MOST_RANK) for v in wanting}
        before = self._passes.get(stage, {})
        known = {v.job_id: before[v.job_id] for v in wanting if v.job_id in before}
        # Who comes begins one stride behind the others, and nobody waits longer than that:
        # neither a pause nor a lower priority of earlier is held against a job.
        least = min(known.values(), default=0.0)
        self._passes[stage] = {
            job: min(known.get(job, least + stride), least + stride)
            for job, stride in strides.items()
        }
        self._strides[stage] = strides


def _whose(view: JobView) -> str:
    return _URGENT if view.is_urgent else view.user


def _in_flight(views: Sequence[JobView], lane: str) -> Counter[str]:
    """User -> tasks in a lane that are queued or run; those who have none there but want some, too."""
    found: Counter[str] = Counter()
    stage = stage_of_lane(lane)
    for view in views:
        n = sum(view.counts.get(f"{stage}:{STATES[s]}", 0.0) for s in ("QUEUED", "RUNNING"))
        if is_in(view, lane) and (n or n_ready(view, lane)):
            found[_whose(view)] += int(n)
    return found


def priority_of(view: JobView) -> int:
    """The job's number, 0 goes first."""
    return int(view.fields.get("priority", DEFAULT_PRIORITY))


def is_in(view: JobView, lane: str) -> bool:
    """Whether the job's tasks go in the lane."""
    gpu = view.uses_gpu
    return lane_of(stage_of_lane(lane), gpu=gpu) == lane


def stage_of_lane(lane: str) -> str:
    """The stage whose tasks go in the lane."""
    return LIGHT if lane == LIGHT_GPU else lane


def is_shut(view: JobView, stage: str) -> bool:
    """Whether nothing of a stage is sent now: its user has used up what he may."""
    return view.barred == (EVERYWHERE,) and stage in (GEOMETRY, GL, LIGHT)


def n_ready(view: JobView, lane: str) -> int:
    """Tasks in a lane that could be sent, those that wait for their time too."""
    stage = stage_of_lane(lane)
    # Of a job that stands still only its last merge goes on.
    if not is_in(view, lane) or (view.state != "running" and stage != JOB):
        return 0
    if is_shut(view, stage):
        return 0
    n = view.counts.get(f"{stage}:{STATES['READY']}", 0.0)
    # A house that is not admitted yet begins with its geometry.
    return int(n) + (view.n_waiting_houses if stage == GEOMETRY else 0)
