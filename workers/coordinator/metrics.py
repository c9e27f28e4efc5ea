"""Prometheus metrics of the farm, from O(1) reads, in series that no job adds to. Effects: a web server."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from workers.config import FarmConfig
from workers.coordinator.progress_rates import durations, stage_views, views_per_hour
from workers.ids import QUEUES, STAGES
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import (
    ALIVE_S,
    EVERYWHERE,
    SPENT_DAYS,
    STATES,
    FaultClass,
    JobView,
    LedgerUnavailable,
    WorkerView,
)
from workers.ledger.user_table import UserTable
from workers.ledger.worker_registry import Registry


class FarmCollector:
    """Reads the ledger each time Prometheus asks."""

    def __init__(self, ledger: RedisLedger) -> None:
        self._ledger = ledger
        self._registry = Registry(ledger)
        self._table = UserTable(ledger)

    def collect(self) -> Iterator[Metric]:
        """All metrics, by a few reads a job at each scrape; only pbrs_up 0 when Redis does not answer."""
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
        workers = self._registry.workers()
        yield _queue_slots(workers)
        yield from _workers(workers)
        alive = sum(w.age_s <= ALIVE_S for w in workers)
        yield GaugeMetricFamily("pbrs_workers", f"workers seen in {ALIVE_S:.0f} s", value=alive)
        # Storage and Redis, without which nothing moves.
        is_open = bool(self._registry.breaker())
        yield GaugeMetricFamily("pbrs_breaker_open", "1 while storage is unhealthy", value=is_open)
        used = self._ledger.client.info("memory")["used_memory"]
        yield GaugeMetricFamily("pbrs_redis_bytes", "memory Redis uses", value=used)

    def _jobs(self) -> Iterator[Metric]:
        views = [v for j in self._ledger.active_jobs() if (v := self._ledger.view(j)) is not None]
        yield from (
            _tasks(views),
            _done(views),
            _faults(views),
            _houses_metric(views),
            _seconds(views),
        )
        yield from self._progress(views)
        yield from self._users(views)
        expired = CounterMetricFamily("pbrs_leases_expired", "expired leases", labels=["job"])
        for view in views:
            expired.add_metric([view.job_id], view.counts.get("expired", 0))
        yield expired

    def _progress(self, views: list[JobView]) -> Iterator[Metric]:
        """Views an hour and time left, as `status` shows them."""
        slots = self._registry.slots()
        blocked = GaugeMetricFamily(
            "pbrs_job_held_back", "1 while the user's slot-hours are used up", labels=["job"]
        )
        rate = GaugeMetricFamily("pbrs_views_per_hour", "views finished per hour", labels=["job"])
        eta = GaugeMetricFamily("pbrs_eta_seconds", "remaining time of a job", labels=["job"])
        paused = GaugeMetricFamily("pbrs_job_paused", "1 while a job is paused", labels=["job"])
        for view in views:
            rate.add_metric([view.job_id], views_per_hour(view))
            # A job ends with the slowest of its stages.
            etas = [s.eta_s for s in stage_views(view, slots) if s.eta_s is not None]
            if etas:
                eta.add_metric([view.job_id], max(etas))
            paused.add_metric([view.job_id], view.state == "paused")
            blocked.add_metric([view.job_id], view.blocked_queues == (EVERYWHERE,))
        yield from (rate, eta, paused, blocked)

    def _users(self, views: list[JobView]) -> Iterator[Metric]:
        """A row per user: current share of the farm."""
        users, spent = self._table.all(), self._table.spent_h()
        running = GaugeMetricFamily("pbrs_user_tasks_running", "running tasks", labels=["user"])
        hours = GaugeMetricFamily(
            "pbrs_user_slot_hours", f"used in {SPENT_DAYS} days", labels=["user"]
        )
        for name in users:
            running.add_metric([name], sum(v.n_running for v in views if v.user == name))
            hours.add_metric([name], spent.get(name, 0.0))
        yield from (running, hours)


def _queue_slots(workers: list[WorkerView]) -> Metric:
    """Tasks of a queue that live workers can run; 0 where nobody takes it."""
    metric = GaugeMetricFamily("pbrs_queue_slots", "slots that serve the queue", labels=["queue"])
    for queue in QUEUES:
        takers = (w for w in workers if queue in w.fields.get("queues", "").split(","))
        metric.add_metric(
            [queue], sum(int(w.fields.get("slots", 0)) for w in takers if w.age_s <= ALIVE_S)
        )
    return metric


def _workers(workers: list[WorkerView]) -> Iterator[Metric]:
    """A row per worker seen in the last hour."""
    age = GaugeMetricFamily(
        "pbrs_worker_silence_seconds", "time since the last heartbeat", labels=["worker"]
    )
    slots = GaugeMetricFamily(
        "pbrs_worker_slots", "maximum simultaneous tasks", labels=["worker", "state"]
    )
    memory = GaugeMetricFamily("pbrs_worker_bytes", "memory of its processes", labels=["worker"])
    for worker in workers:
        age.add_metric([worker.name], worker.age_s)
        memory.add_metric([worker.name], 2**20 * float(worker.fields.get("memory_mb", 0)))
        slots.add_metric([worker.name, worker.state], float(worker.fields.get("slots", 0)))
    yield from (age, slots, memory)


def _tasks(views: list[JobView]) -> Metric:
    metric = GaugeMetricFamily("pbrs_tasks", "tasks by state", labels=["job", "stage", "state"])
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
    metric = CounterMetricFamily("pbrs_faults", "failed attempts", labels=["job", "class"])
    for view in views:
        # Export 0 for classes without a failure: Prometheus sees no rise of a missing series.
        for name in get_args(FaultClass):
            metric.add_metric([view.job_id, name], view.counts.get(f"failures:{name}", 0))
    return metric


def _houses_metric(views: list[JobView]) -> Metric:
    metric = GaugeMetricFamily("pbrs_houses", "houses by state", labels=["job", "state"])
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
    """Serve /metrics, unprotected, on the configured port in a thread (server, thread); OSError."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(FarmCollector(ledger))
    return start_http_server(config.metrics_port, registry=registry)
