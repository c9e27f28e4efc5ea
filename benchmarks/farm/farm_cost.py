"""Overhead of the farm: queue, ledger, coordinator, store: `make bench NAME=farm` -> out/bench/farm.json.

A simulated job of 45,622 houses enters the ledger with all its views; some of its tasks run through coordinator, Redis, Celery,
renderer processes and a folder store. Meanwhile, on a second farm, a worker with default settings is killed. Then follow ten
thousand simulated workers, the store requests of a view, and a job compared with `pbrs-farm run`. FULL=1 runs the whole job.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.farm import simulated_farm
from benchmarks.farm.noop_runner import N_HOUSES, batches_of
from benchmarks.farm.store_requests import requests_a_view
from benchmarks.figures import write_report
from benchmarks.memory import cpu_s, descendants, resident_mb
from pbrs_farm.core import keys
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.operating_system import die_with_parent
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.secret import Secret
from workers.client.farm_client import Farm, completed, new_spec
from workers.config import FarmConfig
from workers.ids import job_key
from workers.job import HouseEntry, lines_from_houses
from workers.ledger.task_ledger import HouseState

FULL = os.environ.get("FULL") == "1"
N_TASKS = 410_000 if FULL else 50_000
N_RECOVERED = 50_000
# A busy or slow machine runs fewer tasks rather than for longer; farm.tasks says how many.
MOST_S = 60.0
SIMULATED_S = 600.0 if FULL else 40.0
# The bench as a whole ends within five minutes, unless FULL.
WHOLE_S = float("inf") if FULL else 300.0
SLOTS = int(os.environ.get("SLOTS", "2"))
UNITS = {
    "farm.task_overhead_ms": "ms of CPU a task, all processes",
    "farm.tasks_per_s": "1/s",
    "farm.redis_commands": "a task, those within scripts and of looking at it too",
    "farm.redis_mb": "MB, largest",
    "farm.redis_growth_mb": "MB over the last half",
    "farm.coordinator_mb": "MB, largest",
    "farm.coordinator_growth_mb": "MB over the last half",
    "farm.status_read_s": "s, slowest during the job",
    "farm.status_command_s": "s, slowest during the job",
    "farm.load_s": "s to enter 45,622 houses",
    "farm.recover_s": "s, 50,000 tasks from a folder store",
    "farm.lost_worker_s": "s until a killed worker's task runs again, default settings",
    "farm.tasks": "tasks run",
    "farm.vs_local": "farm seconds / local seconds",
    "farm.store_puts_a_view": "PUT, a home of 12 views, the home's and the job's share among them",
    "farm.store_gets_a_view": "GET and HEAD, the same",
    "farm.store_is_s3": "1 in the S3 that PBRS_S3_ENDPOINT names, 0 in a folder laid out alike",
    **simulated_farm.UNITS,
}


@dataclass
class Bench:
    """Redis and the processes of a farm, in a temporary folder."""

    folder: Path
    env: dict[str, str] = field(default_factory=dict)
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start_redis(self, maxclients: int) -> None:
        with socket.socket() as s:
            s.bind(("127.0.0.1", 0))
            port = s.getsockname()[1]
        (self.folder / "redis").mkdir(parents=True)
        words = ["redis-server", "--port", str(port), "--bind", "127.0.0.1", "--save", ""]
        words += ["--appendonly", "yes", "--dir", str(self.folder / "redis")]
        words += ["--maxclients", str(maxclients)]
        self.env = {
            "PBRS_REDIS_URL": f"redis://127.0.0.1:{port}/0",
            "PBRS_STORE": (self.folder / "store").as_uri(),
            "PBRS_FARM_SCRATCH": str(self.folder),
            "PBRS_FARM_RUNNER": "benchmarks.farm.noop_runner:runner",
        }
        self.start("redis", words)
        time.sleep(0.5)

    def start(self, name: str, words: list[str], **env: str) -> None:
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                words, env={**os.environ, **self.env, **env}, stdout=log, stderr=log,
                start_new_session=True, preexec_fn=die_with_parent,
            )  # fmt: skip

    def python(self, name: str, *words: str, **env: str) -> None:
        self.start(name, [sys.executable, "-m", *words], **env)

    def farm(self) -> Farm:
        return Farm(
            FarmConfig(
                redis_url=Secret(self.env["PBRS_REDIS_URL"]),
                store_url=self.env["PBRS_STORE"],
                runner=self.env["PBRS_FARM_RUNNER"],
            )
        )

    def end(self, name: str, sign: signal.Signals = signal.SIGKILL) -> None:
        process = self.processes.pop(name)
        for pid in (process.pid, *descendants(process.pid)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, sign)
        process.wait(30)

    def close(self) -> None:
        for name in list(self.processes):
            self.end(name)


@contextlib.contextmanager
def bench_farm(maxclients: int = 10_000) -> Iterator[Bench]:
    """A fresh Redis and an empty store; everything is ended and removed afterwards."""
    if shutil.which("redis-server") is None:
        raise RuntimeError("redis-server is not installed")
    with tempfile.TemporaryDirectory(prefix="pbrs-bench-") as name:
        bench = Bench(Path(name))
        bench.start_redis(maxclients)
        try:
            yield bench
        finally:
            bench.close()


def main() -> None:
    """Measure and write out/bench/farm.json."""
    figures: dict[str, Any] = {}
    began = time.monotonic()
    lost = threading.Thread(target=lambda: figures.update(lost_worker()))
    lost.start()
    figures |= throughput()
    lost.join()
    figures |= simulated_farm.simulated_farm(SIMULATED_S)
    figures |= requests_a_view()
    figures |= against_local(began + WHOLE_S)
    write_report("farm", figures, UNITS)


def throughput() -> dict[str, Any]:
    """Load the whole job, run N_TASKS of it, recover it."""
    with bench_farm() as bench:
        farm = bench.farm()
        houses = [HouseEntry(house_id=f"h{k:05d}") for k in range(N_HOUSES)]
        spec_houses, spec = completed(houses, new_spec(recipe_from_name("fast")))
        began = time.monotonic()
        farm.ledger.create(spec)
        farm.ledger.load_houses(spec.job_id, map(opened_house, range(N_HOUSES)))
        farm.ledger.open(spec.job_id, 5)
        load_s = time.monotonic() - began
        farm.store.put(job_key(spec.job_id), spec.model_dump_json().encode())
        farm.store.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(spec_houses))
        print(f"   {N_HOUSES} houses entered in {load_s:.1f} s", flush=True)

        bench.python("coordinator", "workers.coordinator.leader")
        bench.python("worker", "workers.node.supervisor", PBRS_FARM_SLOTS=str(SLOTS))
        watch = Watch(bench, farm, spec.job_id)
        watch.until(N_TASKS)
        figures = watch.figures() | {"farm.load_s": round(load_s, 1)}
        bench.end("worker")
        bench.end("coordinator")
        figures["farm.recover_s"] = recover_s(farm, spec.job_id)
        farm.ledger.client.close()
        return figures


def opened_house(index: int) -> HouseState:
    """A house of the simulated job: its geometry is done, its batches are to be run."""
    batches = batches_of(f"h{index}")
    units = {str(n): ("gl", "l") for n in range(len(batches))}
    return HouseState(index, f"h{index:05d}", False, batches, {**units, "-": ("geometry", "d")})


class Watch:
    """Looks at a running job every two seconds: memory, times of reading, tasks done."""

    def __init__(self, bench: Bench, farm: Farm, job: str) -> None:
        self._bench, self._farm, self._job = bench, farm, job
        self._samples: list[tuple[int, float, float]] = []
        self._reads: list[float] = []
        self._commands: list[float] = []
        self._seconds = 0.0
        self._cpu_s = 0.0
        self._n_redis = 0
        self._n = 0

    def until(self, n_tasks: int) -> None:
        while self._done() < 1:
            time.sleep(0.05)
        began, first, cpu, n_redis_before = (
            time.monotonic(),
            self._done(),
            self._cpu(),
            self._redis(),
        )
        while (done := self._done()) < n_tasks and (FULL or time.monotonic() - began < MOST_S):
            self._sample(done)
            if len(self._samples) % 15 == 1:
                self._commands.append(self._command())
                print(f"   {done} tasks, {self._rate(began, first, done):.0f}/s", flush=True)
            time.sleep(2.0)
        self._seconds = time.monotonic() - began
        self._n = self._done() - first
        self._cpu_s, self._n_redis = self._cpu() - cpu, self._redis() - n_redis_before

    def figures(self) -> dict[str, Any]:
        half = [s for s in self._samples if s[0] >= self._samples[-1][0] / 2]
        redis, coordinator = [s[1] for s in self._samples], [s[2] for s in self._samples]
        return {
            "farm.tasks": self._n,
            "farm.tasks_per_s": round(self._n / self._seconds, 1),
            "farm.task_overhead_ms": round(1e3 * self._cpu_s / self._n, 2),
            "farm.redis_commands": round(self._n_redis / self._n, 1),
            "farm.redis_mb": round(max(redis), 1),
            "farm.redis_growth_mb": round(half[-1][1] - half[0][1], 2),
            "farm.coordinator_mb": round(max(coordinator), 1),
            "farm.coordinator_growth_mb": round(half[-1][2] - half[0][2], 2),
            "farm.status_read_s": round(max(self._reads), 4),
            "farm.status_command_s": round(max(self._commands), 2),
        }

    def _rate(self, began: float, first: int, done: int) -> float:
        return (done - first) / max(1e-9, time.monotonic() - began)

    def _done(self) -> int:
        view = self._farm.view(self._job)
        return int(sum(view.counts.get(f"done:{s}", 0) for s in ("gl", "light", "reduce")))

    def _sample(self, done: int) -> None:
        began = time.perf_counter()
        self._farm.status(self._job)
        self._reads.append(time.perf_counter() - began)
        used = self._farm.ledger.client.info("memory")["used_memory"] / 1e6
        pid = self._bench.processes["coordinator"].pid
        self._samples.append((done, used, resident_mb(pid)))

    def _command(self) -> float:
        began = time.perf_counter()
        words = [sys.executable, "-m", "pbrs_farm.cli", "status", "--json", self._job]
        env = {**os.environ, **self._bench.env}
        subprocess.run(words, env=env, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - began

    def _redis(self) -> int:
        """Commands that Redis has run so far, those within scripts too."""
        stats = self._farm.ledger.client.info("commandstats")
        return sum(int(row["calls"]) for row in stats.values())

    def _cpu(self) -> float:
        pids = [p.pid for p in self._bench.processes.values()]
        return sum(cpu_s(p) for pid in pids for p in (pid, *descendants(pid)))


def recover_s(farm: Farm, job: str) -> float:
    """Seconds to rebuild the ledger after FLUSHALL from a store of N_RECOVERED done tasks or more.

    What the job has not done by then is written as its tasks would have.
    """
    n_done = 0
    for index in range(N_HOUSES):
        if n_done >= N_RECOVERED:
            break
        house = f"h{index:05d}"
        steps = [f"{n}_{s}" for n in range(len(batches_of(house))) for s in ("gl", "light")]
        for step in ("house", "cameras", *steps, "reduce"):
            farm.store.put_if_absent(keys.marker_key(house, step), b"{}")
        n_done += len(steps) + 1
    farm.ledger.client.flushall()
    began = time.monotonic()
    view = farm.recover(job)
    seconds = time.monotonic() - began
    done = sum(view.counts.get(f"done:{s}", 0) for s in ("gl", "light", "reduce"))
    print(f"   recovered {done:.0f} finished tasks in {seconds:.1f} s", flush=True)
    if done < N_RECOVERED:
        raise AssertionError(f"only {done:.0f} tasks were recovered")
    return round(seconds, 1)


def lost_worker() -> dict[str, Any]:
    """Seconds from kill -9 of a worker to the second start of its task, with default settings."""
    with bench_farm() as bench:
        farm = bench.farm()
        bench.python("coordinator", "workers.coordinator.leader")
        bench.python("w1", "workers.node.supervisor", PBRS_FARM_WORKER="w1", PBRS_BENCH_SLEEP="300")
        houses = [HouseEntry(house_id="h00000")]
        job = farm.submit(houses, new_spec(recipe_from_name("fast"))).job_id
        while not _runner_of(farm, job):
            time.sleep(0.1)
        time.sleep(25)  # past its first heartbeat
        bench.python("w2", "workers.node.supervisor", PBRS_FARM_WORKER="w2", PBRS_BENCH_SLEEP="0")
        bench.end("w1")
        began = time.monotonic()
        while farm.view(job).counts.get("done:geometry", 0) < 1:
            time.sleep(0.1)
        seconds = time.monotonic() - began
        farm.ledger.client.close()
    print(f"   a killed worker's task was done elsewhere after {seconds:.0f} s", flush=True)
    return {"farm.lost_worker_s": round(seconds, 1)}


def _runner_of(farm: Farm, job: str) -> str:
    return farm.ledger.task_facts(job, "h00000/-/geometry").get("claim", "")


def against_local(give_up_at: float = float("inf")) -> dict[str, Any]:
    """Wall time of a preview job through the farm over that of `pbrs-farm run --jobs 2`.

    Both begin cold but for the file cache: `run` starts its processes, the farm's worker is there
    and starts its renderers. In the order local, farm, farm, local, so that drift cancels; on a slow
    machine local, farm. give_up_at: of the monotonic clock; no figure if not even that fits.
    """
    subprocess.run([*_COMMAND, "doctor"], check=False, stdout=subprocess.DEVNULL)
    seconds: dict[str, list[float]] = {"local": [], "farm": []}
    with tempfile.TemporaryDirectory(prefix="pbrs-bench-") as name:
        alone = FolderStore(Path(name) / "first")
        seconds["local"].append(_local_s(alone.root))
        n_fit = (give_up_at - time.monotonic()) / (1.2 * seconds["local"][0])
        if n_fit < 1:
            return {}
        for _round in range(2 if n_fit > 3 else 1):
            with bench_farm() as bench:
                seconds["farm"].append(_farm_s(bench))
                n = _same_objects(alone, FolderStore(bench.folder / "store"))
        if len(seconds["farm"]) == 2:
            seconds["local"].append(_local_s(Path(name) / "second"))
    times = ", ".join(f"{who} {' '.join(f'{x:.1f}' for x in xs)} s" for who, xs in seconds.items())
    print(f"   {times}; {n} objects alike", flush=True)
    return {"farm.vs_local": round(sum(seconds["farm"]) / sum(seconds["local"]), 3)}


_COMMAND = (sys.executable, "-m", "pbrs_farm.cli")
_JOB = ("builtin", "--recipe", "preview")


def _local_s(out: Path) -> float:
    began = time.monotonic()
    words = [*_COMMAND, "run", *_JOB, "--jobs", "2", "--out", str(out)]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began


def _farm_s(bench: Bench) -> float:
    bench.env["PBRS_FARM_RUNNER"] = "workers.node.house_runner:runner"
    bench.python("coordinator", "workers.coordinator.leader")
    bench.python("worker", "workers.node.supervisor", PBRS_FARM_SLOTS="2")
    farm = bench.farm()
    while not farm.registry.slots():
        time.sleep(0.1)
    began = time.monotonic()
    env = {**os.environ, **bench.env}
    done = subprocess.run([*_COMMAND, "submit", *_JOB], env=env, check=True, capture_output=True)
    job = done.stdout.decode().strip()
    while farm.view(job).state != "done":
        time.sleep(0.1)
    seconds = time.monotonic() - began
    farm.ledger.client.close()
    return seconds


def _same_objects(alone: FolderStore, farm: FolderStore) -> int:
    """Number of objects of both runs. Raises AssertionError unless they are equal.

    Pictures, labels, JSON and manifests byte for byte; markers but for when, where and how long.
    """
    keys_alone, keys_farm = (
        {key for key in store.list() if not key.startswith("jobs/")} for store in (alone, farm)
    )
    odd = sorted(keys_alone ^ keys_farm)
    common_keys = sorted(keys_alone & keys_farm)
    odd += [key for key in common_keys if _plain(alone, key) != _plain(farm, key)]
    if odd or not keys_alone:
        raise AssertionError(f"{len(odd)} objects of local run and farm differ: {odd[:5]}")
    return len(keys_alone)


def _plain(store: FolderStore, key: str) -> object:
    """The part of an object that must not depend on the run."""
    data = store.get(key)
    if "/done/" not in key:
        return data
    return {k: v for k, v in json.loads(data).items() if k not in _OF_THE_RUN}


_OF_THE_RUN = {"seconds", "worker", "attempt", "finished_utc"}
