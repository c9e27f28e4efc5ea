"""Whose tasks are sent next: the most urgent job's, with a share for the rest; no effects.

Stride scheduling (Waldspurger and Weihl 1995): at each stage a job has a pass; the job with the least one is
next, and its pass grows by its stride. The stride follows the rank of a job's priority among those
that have work, so that no job waits for ever and jobs of equal priority take turns.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from typing import Final

from workers.ids import DEFAULT_PRIORITY, GEOMETRY, JOB, LIGHT, LIGHT_GPU, lane_of
from workers.ledger.task_ledger import STATES, JobView

_RATIO: Final = 9  # tasks of a job for one of a job of the next lower rank
_MOST_RANK: Final = 2  # ranks below this one get as much as it does


class Shares:
    """What each job was sent so far, as passes; one per leading coordinator."""

    def __init__(self) -> None:
        self._passes: dict[str, dict[str, float]] = {}  # stage -> job -> pass
        self._strides: dict[str, dict[str, int]] = {}

    def split(self, room: Mapping[str, int], views: Sequence[JobView]) -> dict[str, dict[str, int]]:
        """Job -> lane -> how many of its tasks may be sent, together at most room[lane].

        A lane is a stage, or light on a GPU. views: most urgent first. What no job has ready is
        left over. Charges nothing: `charge` does.
        """
        given = {view.job_id: dict.fromkeys(room, 0) for view in views}
        for stage, n_free in room.items():
            ready = {v.job_id: n_ready(v, stage) for v in views}
            wanting = [v for v in views if ready[v.job_id]]
            self._enter(stage, wanting)
            # The least pass is next, the more urgent of two equal ones.
            passes = [
                (self._passes[stage][v.job_id], order, v.job_id) for order, v in enumerate(wanting)
            ]
            heapq.heapify(passes)
            for _ in range(n_free):
                if not passes:
                    break
                at, order, job = heapq.heappop(passes)
                given[job][stage] += 1
                if given[job][stage] < ready[job]:
                    heapq.heappush(passes, (at + self._strides[stage][job], order, job))
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


def n_ready(view: JobView, lane: str) -> int:
    """Tasks in a lane that could be sent, those that wait for their time too."""
    stage = stage_of_lane(lane)
    # Of a job that stands still only its last merge goes on.
    if not is_in(view, lane) or (view.state != "running" and stage != JOB):
        return 0
    n = view.counts.get(f"{stage}:{STATES['READY']}", 0.0)
    # A house that is not admitted yet begins with its geometry.
    return int(n) + (view.n_waiting_houses if stage == GEOMETRY else 0)
