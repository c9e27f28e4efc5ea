"""Prometheus metrics of the farm, from O(1) reads of the ledger. Effects: a web server.

No label names a house or a task, so that the number of series does not grow with a job.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from workers.config import FarmConfig
from workers.coordinator.progress_rates import durations
from workers.ids import QUEUES, STAGES
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import ALIVE_S, STATES, JobView, LedgerUnavailable
from workers.ledger.worker_registry import Registry


class FarmCollector:
    """Reads the ledger each time Prometheus asks."""

    def __init__(self, ledger: RedisLedger) -> None:
        self._ledger = ledger
        self._registry = Registry(ledger)

    def collect(self) -> Iterator[Metric]:
        """All metrics; only pbrs_up 0 when Redis does not answer."""
        try:
            # All or nothing: half an answer would look like a farm that lost its jobs.
            metrics = [*self._farm(), *self._jobs()]
        except LedgerUnavailable:
            yield GaugeMetricFamily("pbrs_up", "1 when Redis answers", value=0)
            return
        yield GaugeMetricFamily("pbrs_up", "1 when Redis answers", value=1)
        yield from metrics

    def _farm(self) -> Iterator[Metric]:
        # Queues, slots and workers: what an autoscaler and a person on call look at.
        depth = GaugeMetricFamily("pbrs_queue_messages", "messages waiting", labels=["queue"])
        for queue in QUEUES:
            depth.add_metric([queue], self._ledger.queue_length(queue))
        yield depth
        slots = GaugeMetricFamily("pbrs_slots", "tasks live workers can run", labels=["stage"])
        for stage, n in self._registry.slots().items():
            slots.add_metric([stage], n)
        yield slots
        alive = sum(w.age_s <= ALIVE_S for w in self._registry.workers())
        yield GaugeMetricFamily("pbrs_workers", f"workers seen in {ALIVE_S:.0f} s", value=alive)
        # Storage and Redis, without which nothing moves.
        is_open = bool(self._registry.breaker())
        yield GaugeMetricFamily("pbrs_breaker_open", "1 while storage is unhealthy", value=is_open)
        used = self._ledger.client.info("memory")["used_memory"]
        yield GaugeMetricFamily("pbrs_redis_bytes", "memory Redis uses", value=used)

    def _jobs(self) -> Iterator[Metric]:
        views = [v for j in self._ledger.active_jobs() if (v := self._ledger.view(j)) is not None]
        yield from (_tasks(views), _done(views), _faults(views), _houses(views), _seconds(views))
        expired = CounterMetricFamily("pbrs_leases_expired", "leases that ran out", labels=["job"])
        for view in views:
            expired.add_metric([view.job_id], view.counts.get("expired", 0))
        yield expired


def _tasks(views: list[JobView]) -> Metric:
    metric = GaugeMetricFamily(
        "pbrs_tasks", "tasks now in a state", labels=["job", "stage", "state"]
    )
    names = {STATES[name.upper()]: name for name in ("ready", "queued", "running", "failed")}
    for view in views:
        for stage in STAGES:
            for letter, name in names.items():
                n = view.counts.get(f"{stage}:{letter}", 0)
                metric.add_metric([view.job_id, stage, name], n)
    return metric


def _done(views: list[JobView]) -> Metric:
    metric = CounterMetricFamily("pbrs_tasks_done", "tasks finished", labels=["job", "stage"])
    for view in views:
        for stage in STAGES:
            metric.add_metric([view.job_id, stage], view.counts.get(f"done:{stage}", 0))
    return metric


def _faults(views: list[JobView]) -> Metric:
    metric = CounterMetricFamily("pbrs_faults", "attempts that failed", labels=["job", "class"])
    for view in views:
        for name, n in view.counts.items():
            if name.startswith("failures:"):
                metric.add_metric([view.job_id, name.removeprefix("failures:")], n)
    return metric


def _houses(views: list[JobView]) -> Metric:
    metric = GaugeMetricFamily("pbrs_houses", "houses in a state", labels=["job", "state"])
    for view in views:
        metric.add_metric([view.job_id, "waiting"], view.n_waiting_houses)
        for state in ("open", "done", "quarantined"):
            metric.add_metric([view.job_id, state], view.counts.get(f"houses:{state}", 0))
    return metric


def _seconds(views: list[JobView]) -> Metric:
    metric = HistogramMetricFamily("pbrs_task_seconds", "task durations", labels=["job", "stage"])
    for view in views:
        for stage in STAGES:
            # Prometheus' buckets are cumulative, their bounds upper ends.
            buckets, total = [], 0.0
            for power, n in sorted(durations(view, stage).items()):
                total += n
                buckets.append((str(2.0**power), total))
            buckets.append(("+Inf", total))
            seconds = view.counts.get(f"seconds:{stage}", 0.0)
            metric.add_metric([view.job_id, stage], buckets, sum_value=seconds)
    return metric


def serve_metrics(config: FarmConfig, ledger: RedisLedger) -> Any:
    """Serve /metrics on the configured port in a thread of its own."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(FarmCollector(ledger))
    return start_http_server(config.metrics_port, registry=registry)
