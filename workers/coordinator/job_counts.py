"""Tasks and slots of a job in a pool, from the counters of the ledger; no effects.

A pool is a stage; light on a GPU is separate from other light (`workers.ids.pool_of`).
"""

from __future__ import annotations

import math
from typing import Final

from workers.coordinator.progress_rates import mean_s
from workers.ids import GEOMETRY, GL, JOB, LIGHT, LIGHT_GPU, pool_of, stage_of_pool
from workers.ledger.task_ledger import EVERYWHERE, MOST_TOGETHER, STATES, TOGETHER_S, JobView

WORK_POOLS: Final = (GEOMETRY, GL, LIGHT, LIGHT_GPU)  # each has a queue; merging is short


def is_in_pool(view: JobView, pool: str) -> bool:
    """True if the job's tasks of that stage belong to the pool; light has one with and one without GPUs."""
    return pool_of(stage_of_pool(pool), gpu=view.uses_gpu) == pool


def is_stopped(view: JobView, stage: str) -> bool:
    """True if a user's spent slot-hours stop a stage; merges, which are cheap, are never stopped."""
    return view.blocked_queues == (EVERYWHERE,) and stage in (GEOMETRY, GL, LIGHT)


def n_ready(view: JobView, pool: str) -> int:
    """Tasks in a pool that could be sent, with those that wait until they may be tried again.

    Counts of the ledger at the time of the view; a house that is not admitted counts as one task of
    geometry. 0 for a job that does not run, but for its last merge.
    """
    stage = stage_of_pool(pool)
    # Of a job that does not run only its last merge goes on.
    if not is_in_pool(view, pool) or (view.state != "running" and stage != JOB):
        return 0
    if is_stopped(view, stage):
        return 0
    n = view.counts.get(f"{stage}:{STATES['READY']}", 0.0)
    # A house that is not admitted yet begins with its geometry.
    return int(n) + (view.n_waiting_houses if stage == GEOMETRY else 0)


def n_queued_or_running(view: JobView, pool: str) -> int:
    """Tasks in a pool whose message is on its way or that run; `n_ready` counts the others."""
    stage = stage_of_pool(pool)
    if not is_in_pool(view, pool):
        return 0
    return int(sum(view.counts.get(f"{stage}:{STATES[s]}", 0.0) for s in ("QUEUED", "RUNNING")))


def n_slots(view: JobView, pool: str, state: str) -> int:
    """About how many slots the job's tasks of a pool take (RUNNING) or will; a slot claims several."""
    stage = stage_of_pool(pool)
    n = view.counts.get(f"{stage}:{STATES[state]}", 0.0) if is_in_pool(view, pool) else 0.0
    if n <= 0 or stage == GEOMETRY:
        return int(n)
    # A slot claims tasks of one house.
    of_house = view.counts.get("batches", 0.0) / max(1.0, view.counts.get("done:geometry", 0.0))
    return math.ceil(n / min(n_claimed_together(view, stage), max(1, math.ceil(of_house))))


def n_claimed_together(view: JobView, stage: str) -> int:
    """Tasks of a stage that a slot claims together: 1 to MOST_TOGETHER, TOGETHER_S by the job's mean."""
    seconds = mean_s([view], stage)
    return max(1, min(MOST_TOGETHER, int(TOGETHER_S / seconds))) if seconds else 1
