"""Which running tasks end so that urgent jobs begin; no effects."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence

from workers.coordinator.job_counts import WORK_POOLS, n_slots
from workers.ids import pool_of, task_from_text
from workers.ledger.task_ledger import Hold, JobView, WorkerView


def choose_victims(
    views: Sequence[JobView], holds_of: Callable[[str], list[Hold]], workers: Iterable[WorkerView]
) -> list[Hold]:
    """Choose the holds to end: of the least urgent job first, and its most recent ones.

    Frees as many slots as queued tasks of urgent jobs need, minus slots already free or ending. Only
    slots of workers on the urgent tasks' queue count. Urgent jobs' tasks and merges are never chosen.
    holds_of: the holds of a job. [] while no urgent task waits.
    """
    lacking = {
        pool: sum(n_slots(v, pool, "QUEUED") for v in views if v.is_urgent and v.state == "running")
        for pool in WORK_POOLS
    }
    if not any(lacking.values()):
        return []
    by_slot: dict[str, list[Hold]] = defaultdict(list)  # token -> what the slot holds
    for view in views:
        for hold in holds_of(view.job_id):
            by_slot[hold.token].append(hold)
    living = [w for w in workers if w.state == "alive"]
    free = {w.name: int(w.fields.get("slots", 0)) for w in living}
    for slot in by_slot.values():
        if slot[0].worker in free:
            free[slot[0].worker] -= 1
    of_job = {view.job_id: view for view in views}

    def rank(slot: list[Hold]) -> tuple[int, float]:
        return -of_job[slot[0].job].priority, -max(hold.since for hold in slot)

    may_end = sorted((h for h in by_slot.values() if _may_end(h[0], of_job)), key=rank)
    ending = [h for h in may_end if any(hold.is_preempted for hold in h)]
    rest = [h for h in may_end if h not in ending]
    chosen: list[Hold] = []
    for pool, n in lacking.items():
        takers = {w.name for w in living if pool in w.fields.get("queues", "").split(",")}
        # Use free slots first,
        for name in takers:
            n_here = max(0, min(n, free[name]))
            free[name] -= n_here
            n -= n_here
        # then slots that end already, then others.
        for slot in _first_of_workers(ending, takers, n):
            ending.remove(slot)
            n -= 1
        for slot in _first_of_workers(rest, takers, n):
            rest.remove(slot)
            chosen += slot
    return chosen


def _may_end(hold: Hold, of_job: Mapping[str, JobView]) -> bool:
    """True if a slot's tasks may be ended: no urgent job, no merge."""
    view = of_job[hold.job]
    pool = pool_of(task_from_text(hold.task).stage, gpu=view.uses_gpu)
    return pool in WORK_POOLS and not view.is_urgent


def _first_of_workers(slots: Sequence[list[Hold]], workers: set[str], n: int) -> list[list[Hold]]:
    """The first n slots of these workers."""
    return [slot for slot in slots if slot[0].worker in workers][:n]
