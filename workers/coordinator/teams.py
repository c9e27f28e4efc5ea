"""Whose turn it is among users, and who makes room for an urgent job; no effects.

The slots go to the user who holds the fewest over his share, as long as a message of his waits: workers
that could take it claim nothing of the others' jobs meanwhile, so the next slot that is free is his.
The same holds while an urgent job waits. A job stands still while its user's slot-hours are spent.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from workers.coordinator.progress_rates import mean_s
from workers.coordinator.shares import is_in, stage_of_lane
from workers.ids import GEOMETRY, GL, LIGHT, LIGHT_GPU, STAGES, lane_of, task_from_text
from workers.ledger.task_ledger import (
    EVERYWHERE,
    MOST_TOGETHER,
    SPENT_DAYS,
    STATES,
    TOGETHER_S,
    Hold,
    JobView,
    User,
    WorkerView,
)

_LANES: Final = (GEOMETRY, GL, LIGHT, LIGHT_GPU)  # each is a queue; what merges is short
_NOBODY: Final = User("")
TURN: Final = "it is the turn of"  # begins the reason of a bar among users

Barred = dict[str, tuple[tuple[str, ...], str]]  # job -> queues where others go first, and why


def together(view: JobView, stage: str) -> int:
    """How many tasks of a stage a slot claims at once: about TOGETHER_S of work."""
    seconds = mean_s([view], stage)
    return max(1, min(MOST_TOGETHER, int(TOGETHER_S / seconds))) if seconds else 1


def n_in_flight(view: JobView) -> float:
    """Tasks of a job that are queued or run."""
    return n_running(view) + _n_in(view, "QUEUED")


def n_running(view: JobView) -> float:
    """Tasks of a job that slots hold."""
    return _n_in(view, "RUNNING")


def _n_in(view: JobView, state: str) -> float:
    return sum(view.counts.get(f"{stage}:{STATES[state]}", 0.0) for stage in STAGES)


def barred(
    views: Sequence[JobView], users: Mapping[str, User], spent_h: Mapping[str, float]
) -> Barred:
    """Where others go first, of the jobs that run."""
    running = [view for view in views if view.state == "running"]
    urgent: dict[str, str] = {}  # lane -> the job that waits there
    waiting: dict[str, set[str]] = defaultdict(set)  # user -> lanes where he waits
    held: Counter[str] = Counter()  # user -> slots
    for view in running:
        for lane in _LANES:
            held[view.user] += _n_slots(view, lane, "RUNNING")
            if _n_slots(view, lane, "QUEUED"):
                waiting[view.user].add(lane)
                urgent |= {lane: view.job_id} if view.is_urgent else {}

    def share(name: str) -> float:
        return users.get(name, _NOBODY).share

    over = {name: n / share(name) for name, n in held.items()}
    found: Barred = {}
    for view in running:
        user, spent = users.get(view.user, _NOBODY), spent_h.get(view.user, 0.0)
        # By more than the next slot would mend: else two would take turns at every task.
        first = [
            name
            for name in waiting
            if over[name] < over[view.user]
            and (
                not held[name]
                or (held[name] + 1) / share(name) <= (held[view.user] - 1) / share(view.user)
            )
        ]
        if user.slot_hours and spent >= user.slot_hours:
            said = f"{user.name} has used {round(spent, 2):g} of {user.slot_hours:g} slot-hours"
            more = f"of {SPENT_DAYS} days; `pbrs-farm users limit` raises it"
            found[view.job_id] = (EVERYWHERE,), f"{said} {more}"
        elif urgent and not view.is_urgent:
            jobs = " and ".join(sorted(set(urgent.values())))
            found[view.job_id] = tuple(sorted(urgent)), f"job {jobs} is urgent"
        elif first and not view.is_urgent:
            lanes = set().union(*(waiting[name] for name in first))
            names = ", ".join(sorted(name or "jobs without a user" for name in first))
            found[view.job_id] = tuple(sorted(lanes)), f"{TURN} {names}"
    return found


def _n_slots(view: JobView, lane: str, state: str) -> int:
    """How many slots the tasks of a job in a lane and state hold or will, about."""
    stage = stage_of_lane(lane)
    n = view.counts.get(f"{stage}:{STATES[state]}", 0.0) if is_in(view, lane) else 0.0
    if n <= 0 or stage == GEOMETRY:
        return int(n)
    # A slot claims tasks of one house.
    of_house = view.counts.get("batches", 0.0) / max(1.0, view.counts.get("done:geometry", 0.0))
    return math.ceil(n / min(together(view, stage), max(1, math.ceil(of_house))))


def victims(
    views: Sequence[JobView], holds_of: Callable[[str], list[Hold]], workers: Iterable[WorkerView]
) -> list[Hold]:
    """What shall end so that urgent jobs begin: of the least urgent job what began last."""
    wanted = {
        lane: sum(
            _n_slots(v, lane, "QUEUED") for v in views if v.is_urgent and v.state == "running"
        )
        for lane in _LANES
    }
    if not any(wanted.values()):
        return []
    by_slot: dict[str, list[Hold]] = defaultdict(list)  # token -> what the slot holds
    for view in views:
        for hold in holds_of(view.job_id):
            by_slot[hold.token].append(hold)
    living = [w for w in workers if w.state == "alive"]
    free = {w.name: int(w.fields.get("slots", 0)) for w in living}
    for held in by_slot.values():
        if held[0].worker in free:
            free[held[0].worker] -= 1
    of_job = {view.job_id: view for view in views}

    def rank(held: list[Hold]) -> tuple[int, float]:
        view = of_job[held[0].job]
        return -int(view.fields.get("priority", 0)), -max(hold.since for hold in held)

    may_end = sorted((h for h in by_slot.values() if _may_end(h[0], of_job)), key=rank)
    ending = [h for h in may_end if any(hold.is_preempted for hold in h)]
    rest = [h for h in may_end if h not in ending]
    chosen: list[Hold] = []
    for lane, n in wanted.items():
        takers = {w.name for w in living if lane in w.fields.get("queues", "").split(",")}
        for name in takers:
            n_here = max(0, min(n, free[name]))
            free[name] -= n_here
            n -= n_here
        # Slots that were told already, then others.
        for held in _those_of(ending, takers, n):
            ending.remove(held)
            n -= 1
        for held in _those_of(rest, takers, n):
            rest.remove(held)
            chosen += held
    return chosen


def _may_end(hold: Hold, of_job: Mapping[str, JobView]) -> bool:
    """Whether a slot may be told to end what it does: of no urgent job, and no merge."""
    view = of_job[hold.job]
    lane = lane_of(task_from_text(hold.task).stage, gpu=view.uses_gpu)
    return lane in _LANES and not view.is_urgent


def _those_of(slots: Sequence[list[Hold]], workers: set[str], n: int) -> list[list[Hold]]:
    """The first n slots that are these workers'."""
    return [held for held in slots if held[0].worker in workers][:n]
