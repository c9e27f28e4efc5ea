"""How fast a job goes and when it will end; pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from workers.ids import GEOMETRY, GL, JOB, LIGHT, REDUCE, SHARD, STAGES
from workers.ledger.task_ledger import JobView

_TAU_S: Final = 120.0  # of the exponential average
_LEAST_RATE: Final = 1e-6  # tasks per second below which no time left is given


@dataclass(slots=True)
class Rates:
    """Tasks finished per second and stage, averaged with a memory of two minutes."""

    # job -> when it was looked at last, tasks done of each stage by then
    _last: dict[str, tuple[float, Mapping[str, float]]] = field(default_factory=dict)
    _rate: dict[str, dict[str, float]] = field(default_factory=dict)  # job -> stage -> 1/s

    def update(self, view: JobView, now_s: float) -> dict[str, float]:
        """Stage -> tasks per second, a mean over looks at now_s (monotonic); empty after the first look."""
        rates = self._rate.setdefault(view.job_id, {})
        done = {s: view.counts.get(f"done:{s}", 0.0) for s in STAGES}
        before = self._last.get(view.job_id)
        self._last[view.job_id] = (now_s, done)
        if before is None or now_s <= before[0]:
            return dict(rates)
        # Weigh the new rate by the share of the average's memory that has passed.
        seconds = now_s - before[0]
        keep = math.exp(-seconds / _TAU_S)
        for stage in STAGES:
            rate = max(0.0, done[stage] - before[1].get(stage, 0.0)) / seconds
            old = rates.get(stage)
            rates[stage] = rate if old is None else keep * old + (1 - keep) * rate
        return dict(rates)


@dataclass(frozen=True, slots=True)
class StageView:
    """One row of `status`: tasks of a stage in each state, and how long they take."""

    stage: str
    done: int
    running: int
    queued: int  # a message is on the queue
    waiting: int  # all other remaining tasks
    failed: int  # for good
    total: int  # expected, from the houses seen so far
    per_s: float
    mean_s: float  # of a task; so the next two
    p50_s: float
    p90_s: float
    eta_s: float | None  # None while nothing is known


def views_per_hour(view: JobView) -> float:
    """Views finished an hour: the last stage's rate at the leader's last look times a batch's views."""
    last = view.fields.get("stages", "").rpartition(",")[2]
    n_batches = view.counts.get(f"done:{last}", 0.0)
    per_batch = view.counts.get("views", 0.0) / n_batches if n_batches else 0.0
    return 3600 * per_batch * view.rates.get(last, 0.0)


def stage_views(view: JobView, slots: Mapping[str, int]) -> list[StageView]:
    """The job's stages: counts, rate, and an ETA from the rate or, at first, p50; slots: by stage."""
    return [
        _stage_view(view, stage, slots.get(stage, 0)) for stage in STAGES if _has_stage(view, stage)
    ]


def _has_stage(view: JobView, stage: str) -> bool:
    return stage not in (GL, LIGHT) or stage in view.fields.get("stages", "").split(",")


def _stage_view(view: JobView, stage: str, n_slots: int) -> StageView:
    c = view.counts
    done, failed = int(c.get(f"done:{stage}", 0)), int(c.get(f"{stage}:f", 0))
    running, queued = int(c.get(f"{stage}:r", 0)), int(c.get(f"{stage}:q", 0))
    total = expected_total(view, stage)
    n_left = max(0, total - done - failed)
    counts = durations(view, stage)
    p50, p90 = quantile_s(counts, 0.5), quantile_s(counts, 0.9)
    rate = view.rates.get(stage, 0.0)
    is_over = n_left == 0 and (total > 0 or view.state == "done")
    eta = 0.0 if is_over else _eta_s(n_left, rate, p50, n_slots)
    return StageView(
        stage=stage,
        done=done,
        running=running,
        queued=queued,
        waiting=max(0, n_left - running - queued),
        failed=failed,
        total=total,
        per_s=rate,
        mean_s=c.get(f"seconds:{stage}", 0.0) / max(1, sum(counts.values())),
        p50_s=p50,
        p90_s=p90,
        eta_s=eta,
    )


def _eta_s(left: int, rate: float, p50_s: float, n_slots: int) -> float | None:
    """From the measured rate; before there is one, from the typical task and the slots."""
    if rate > _LEAST_RATE:
        return left / rate
    return left * p50_s / n_slots if n_slots and p50_s else None


def expected_total(view: JobView, stage: str) -> int:
    """Tasks of a stage in the whole job, the mean so far for unopened houses; 0 without data."""
    n_houses = int(view.fields.get("n_houses", 0))
    if stage == JOB:
        return 1
    if stage == SHARD:
        return max(1, math.ceil(n_houses / int(view.fields.get("shard_size", 500))))
    if stage == GEOMETRY:
        return n_houses
    n_given_up = int(view.counts.get("houses:quarantined", 0))
    if stage == REDUCE:
        return n_houses - n_given_up
    # Batches of the houses read so far, and as many a house for those still unread.
    opened = view.counts.get("done:geometry", 0)
    batches = view.counts.get("batches", 0)
    unread = view.counts.get("geometry:f", 0) + view.counts.get("geometry:x", 0)
    return int(batches + (n_houses - opened - unread) * (batches / opened if opened else 0))


def durations(view: JobView, stage: str) -> dict[int, float]:
    """Sparse histogram of a stage's durations: k (-3 at least) -> tasks of 2^(k-1) to 2^k seconds."""
    prefix = f"took:{stage}:"
    return {
        int(name.removeprefix(prefix)): n
        for name, n in view.counts.items()
        if name.startswith(prefix)
    }


def mean_s(views: Iterable[JobView], stage: str) -> float:
    """Mean seconds of the stage's finished tasks over all these jobs, 0 before the first."""
    seconds, n = 0.0, 0.0
    for view in views:
        seconds += view.counts.get(f"seconds:{stage}", 0.0)
        n += sum(durations(view, stage).values())
    return seconds / n if n else 0.0


def quantile_s(counts: Mapping[int, float], share: float) -> float:
    """Seconds below which `share` of `durations` ended: a bin's upper edge, up to twice too much; 0 = none."""
    target = share * sum(counts.values())
    n_ended = 0.0
    for power in sorted(counts):
        n_ended += counts[power]
        if n_ended >= target and n_ended > 0:
            return float(2.0**power)
    return 0.0
