"""Ten thousand workers on one machine: their heartbeats, claims and ends of tasks, and no rendering.

Coordinators, Redis and ledger are the real ones; messages go through Celery's sender and are taken
from its queues as workers take them. Two drivers simulate the workers: each worker registers, says
every 10 s that it lives, takes a message, holds its tasks as long as they would take, keeps its
leases and ends them. The leading coordinator is killed half-way, and another one takes over.
`python -m benchmarks.farm.simulated_farm FIRST N FILE` is one driver; it ends when FILE.stop is there.
"""

from __future__ import annotations

import base64
import copy
import heapq
import json
import os
import sys
import time
from collections import Counter, deque
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pbrs_farm.core.recipe import recipe_from_name
from workers.client.farm_client import completed, new_spec
from workers.config import FarmConfig, config_from_environment
from workers.ids import QUEUES, TaskId, job_key, task_from_text, tasks_from_group
from workers.job import HouseEntry, lines_from_houses
from workers.ledger import worker_registry
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import Finished, GoOn
from workers.ledger.worker_registry import Registry

N_WORKERS = int(os.environ.get("WORKERS", "10000"))
N_DRIVERS = 2
TASK_S = 5.0  # of one task: 10,000 workers take 2,000 a second
TOGETHER = 50  # workers whose heartbeats a driver sends in one round trip
HEARTBEAT_S, LEASE_S = 10.0, 20.0  # as workers/node does
UNITS = {
    "farm.simulated_workers": "workers that lived at once",
    "farm.simulated_tasks": "tasks they ended",
    "farm.simulated_tasks_per_s": "1/s",
    "farm.coordinator_share": "of a core, leading, 10,000 workers",
    "farm.coordinator_ms": "ms of CPU a task",
    "farm.simulated_redis_share": "of a core",
    "farm.simulated_takeover_s": "s from the leader's death until a standby led",
    "farm.simulated_lost": "tasks that a worker ended and the ledger does not count",
}


class SharedPipeline:
    """Redis as Registry.heartbeat sees it: what many workers say goes in one round trip."""

    def __init__(self, client: Any) -> None:
        self._pipe = client.pipeline(transaction=False)

    def pipeline(self, **_options: bool) -> SharedPipeline:
        return self

    def time(self) -> tuple[int, int]:
        return int(time.time()), 0

    def __getattr__(self, command: str) -> Any:
        return getattr(self._pipe, command)

    def execute(self) -> tuple[int, None]:
        return 0, None  # nobody is to leave

    def send(self) -> None:
        self._pipe.execute()


@dataclass
class Driver:
    """Some of the workers, as one loop over what happens next."""

    ledger: RedisLedger
    first: int
    n: int
    base: FarmConfig = field(init=False)
    events: list[tuple[float, int, str, Any]] = field(default_factory=list)
    idle: deque[int] = field(default_factory=deque)
    ended: Counter[str] = field(default_factory=Counter)
    configs: dict[int, FarmConfig] = field(default_factory=dict)
    number: int = 0

    def __post_init__(self) -> None:
        self.base = self.ledger.config
        self.shared = SharedPipeline(self.ledger.client)
        self.registry = Registry(_with_client(self.ledger, self.shared))
        # The same for all of them, and read from this machine.
        worker_registry.machine_mb = lambda: 64_000.0  # type: ignore[attr-defined]

    def be(self, worker: int) -> None:
        self.ledger.config = self._config(worker)

    def _config(self, worker: int) -> FarmConfig:
        if worker not in self.configs:
            self.configs[worker] = replace(self.base, worker=f"w{worker:05d}", slots=1)
        return self.configs[worker]

    def at(self, when: float, what: str, *more: Any) -> None:
        self.number += 1
        heapq.heappush(self.events, (when, self.number, what, more))

    def run(self, stop: Path) -> dict[str, Any]:
        """Be the workers until the file is there, and end nothing after that."""
        began = time.monotonic()
        workers = range(self.first, self.first + self.n)
        self.idle.extend(workers)
        for k in range(0, self.n, TOGETHER):
            self.at(began + HEARTBEAT_S * k / self.n, "beat", workers[k : k + TOGETHER])
        late, look_at = 0.0, 0.0
        while (now := time.monotonic()) < look_at or not stop.exists():
            look_at = look_at if now < look_at else now + 0.5
            if self.events and self.events[0][0] <= now:
                when, _n, method, more = heapq.heappop(self.events)
                late = max(late, now - when)
                getattr(self, f"_{method}")(*more)
            elif not self._take():
                time.sleep(0.005)
        cpu_s = round(time.process_time(), 1)
        return {"ended": sum(self.ended.values()), "late_s": round(late, 1), "cpu_s": cpu_s}

    def _beat(self, workers: range) -> None:
        for worker in workers:
            self.registry._ledger.config = self._config(worker)
            self.registry.heartbeat(memory_mb=2000.0)
        self.shared.send()
        self.at(time.monotonic() + HEARTBEAT_S, "beat", workers)

    def _take(self) -> int:
        """Messages to idle workers, as many as there are of either."""
        n_taken = 0
        for queue in reversed(QUEUES):
            if not self.idle:
                break
            most = min(len(self.idle), 50)
            for text in self.ledger.client.lpop(f"{self.base.prefix}{queue}", most) or ():
                args = json.loads(base64.b64decode(json.loads(text)["body"]))[0]
                self._claim(self.idle.popleft(), *args)
                n_taken += 1
        return n_taken

    def _claim(self, worker: int, job: str, group: str, recipe: str) -> None:
        self.be(worker)
        self.number += 1
        tasks = tasks_from_group(group)
        token = f"w{worker:05d}:1:{self.number}:x"
        claims = self.ledger.claim_many(job, [*map(str, tasks)], token=token, recipe=recipe)
        claimed = [t for t, claim in zip(tasks, claims, strict=True) if claim.verdict == "run"]
        self._hold(worker, job, recipe, token, claimed)

    def _hold(self, worker: int, job: str, recipe: str, token: str, held: list[TaskId]) -> None:
        if not held:
            self.idle.append(worker)
            return
        ends = time.monotonic() + TASK_S * len(held)
        self.at(ends, "end", worker, job, recipe, token, held)
        if TASK_S * len(held) > LEASE_S:
            self.at(time.monotonic() + LEASE_S, "keep", worker, job, token, held)

    def _keep(self, worker: int, job: str, token: str, held: list[TaskId]) -> None:
        self.be(worker)
        self.ledger.heartbeat(job, [*map(str, held)], token)

    def _end(self, worker: int, job: str, recipe: str, token: str, held: list[TaskId]) -> None:
        from benchmarks.farm.noop_runner import batches_of

        self.be(worker)
        ends = {
            str(t): Finished(TASK_S, batches_of(t.house) if t.stage == "geometry" else (), 1)
            for t in held
        }
        claims = self.ledger.finish_many(job, ends, token, GoOn(recipe, QUEUES, is_long=True))
        self.ended.update(task.stage for task in held)
        more = [task_from_text(name) for name, c in claims.items() if c.verdict == "run"]
        self._hold(worker, job, recipe, token, more)


def _with_client(ledger: RedisLedger, client: Any) -> RedisLedger:
    copied = copy.copy(ledger)
    copied.client = client
    return copied


def simulated_farm(seconds: float) -> dict[str, Any]:
    """Figures of N_WORKERS workers that work so long, after all of them have registered."""
    from benchmarks.farm.farm_cost import N_HOUSES, bench_farm, opened_house
    from benchmarks.memory import cpu_s

    with bench_farm(maxclients=65_000) as bench:
        farm = bench.farm()
        houses = [HouseEntry(house_id=f"h{k:05d}") for k in range(N_HOUSES)]
        spec_houses, spec = completed(houses, new_spec(recipe_from_name("fast")))
        farm.ledger.create(spec)
        farm.ledger.load_houses(spec.job_id, map(opened_house, range(N_HOUSES)))
        farm.store.put(job_key(spec.job_id), spec.model_dump_json().encode())
        farm.store.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(spec_houses))
        each, files = N_WORKERS // N_DRIVERS, []
        for k in range(N_DRIVERS):
            files.append(bench.folder / f"driver{k}.json")
            words = [str(k * each), str(each), str(files[-1])]
            bench.python(f"driver{k}", "benchmarks.farm.simulated_farm", *words)
        while len(farm.registry.workers()) < each * N_DRIVERS:
            time.sleep(1.0)
        farm.ledger.open(spec.job_id, 5)
        bench.python("first", "workers.coordinator.leader")
        n_before = _n_done(farm, spec.job_id)
        while _n_done(farm, spec.job_id) == n_before:
            time.sleep(0.1)
        bench.python("standby", "workers.coordinator.leader")
        n_alive = _n_alive(farm)
        names = ("first", "standby")
        pid = {n: bench.processes[n].pid for n in (*names, "redis")}
        began, cpu = time.monotonic(), {n: cpu_s(p) for n, p in pid.items()}
        n_first = _n_done(farm, spec.job_id)
        time.sleep(seconds / 2)
        used = {n: cpu_s(p) - cpu[n] for n, p in pid.items()}
        half_s, n_half = time.monotonic() - began, _n_done(farm, spec.job_id) - n_first
        print(f"   {n_half} tasks of {n_alive} workers, {n_half / half_s:.0f}/s", flush=True)
        # Without a word of farewell.
        leader = farm.ledger.client.get(f"{farm.config.prefix}leader")
        bench.end("first")
        died = time.monotonic()
        while farm.ledger.client.get(f"{farm.config.prefix}leader") in (None, leader):
            time.sleep(0.1)
        takeover_s = time.monotonic() - died
        time.sleep(max(0.0, began + seconds - time.monotonic()))
        n_alive = min(n_alive, _n_alive(farm))
        seconds_run = time.monotonic() - began
        for file in files:
            file.with_suffix(".stop").touch()
        for k in range(N_DRIVERS):
            bench.processes[f"driver{k}"].wait(120)
        reports = [json.loads(file.read_text()) for file in files]
        n_ended, n_done = (
            sum(row["ended"] for row in reports),
            _n_done(farm, spec.job_id) - n_before,
        )
        print(f"   {n_ended} ended, {n_done} counted, drivers {reports}", flush=True)
        farm.ledger.client.close()
    return {
        "farm.simulated_workers": n_alive,
        "farm.simulated_tasks": n_done,
        "farm.simulated_tasks_per_s": round(n_done / seconds_run, 1),
        "farm.coordinator_share": round(used["first"] / half_s, 3),
        "farm.coordinator_ms": round(1e3 * used["first"] / max(1, n_half), 3),
        "farm.simulated_redis_share": round(used["redis"] / half_s, 3),
        "farm.simulated_takeover_s": round(takeover_s, 1),
        "farm.simulated_lost": max(0, n_ended - n_done),
    }


def _n_alive(farm: Any) -> int:
    return sum(worker.state == "alive" for worker in farm.registry.workers())


def _n_done(farm: Any, job: str) -> int:
    counts = farm.view(job).counts
    return int(sum(n for name, n in counts.items() if name.startswith("done:")))


def main() -> None:
    """One driver."""
    first, n, file = sys.argv[1:4]
    driver = Driver(RedisLedger(config_from_environment()), int(first), int(n))
    Path(file).write_text(json.dumps(driver.run(Path(file).with_suffix(".stop"))))


if __name__ == "__main__":
    main()
