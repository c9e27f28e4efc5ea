"""A whole farm of real processes on one machine: Redis, coordinator, Celery workers, and a runner."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from benchmarks.memory import descendants
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.operating_system import die_with_parent
from pbrs_farm.settings import settings_from_environment
from pbrs_farm.store import Store, StoreSettings
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import LAYOUT
from pbrs_farm.store.secret import Secret
from tests.workers.fake_runner import FakeRunner, batches_of
from tests.workers.redis_server import RedisServer
from workers.client.farm_client import Farm, new_spec
from workers.config import FarmConfig
from workers.job import HouseEntry
from workers.runner import TaskRequest

FAKE_RUNNER = "tests.workers.fake_runner:runner"
REAL_RUNNER = "workers.node.house_runner:runner"
REPO = Path(__file__).parents[2]


class SmallFarm:
    """Starts processes and ends every one of them; the folder `control` steers the fake runner."""

    def __init__(
        self, folder: Path, redis: RedisServer, *, s3: Store | None = None,
        runner: str = FAKE_RUNNER, redis_url: str = "", **settings: object,
    ) -> None:  # fmt: skip
        self.redis_url = redis_url or redis.url  # the address that the processes use
        self.folder = folder
        self.redis = redis
        self.runner = runner
        self.control = folder / "control"
        self.control.mkdir(parents=True)
        self.store: Store = s3 or FolderStore(folder / "store")
        self._settings = {
            "lease_s": 3, "heartbeat_s": 0.5, "retry_delay_s": 0.1, "resend_s": 3, "breaker_s": 12,
            "grace_s": 30, "storage_patience_s": 60, "min_free_mb": 1, **settings,
        }  # fmt: skip
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.farm = Farm(
            FarmConfig(
                redis_url=Secret(redis.url),
                store_url=self.store.url,
                store=settings_from_environment().store if s3 else StoreSettings(),
                runner=runner,
            )
        )
        os.environ["PBRS_TEST_CONTROL"] = str(self.control)
        self.job = ""
        self.houses: list[str] = []

    def environment(self, worker: str, slots: int = 1) -> dict[str, str]:
        keep = ("PBRS_S3_",) if self.store.url.startswith("s3:") else ()
        env = {
            k: v for k, v in os.environ.items() if not k.startswith("PBRS_") or k.startswith(keep)
        }
        env |= {f"PBRS_FARM_{k.upper()}": str(v) for k, v in self._settings.items()}
        scratch = self.folder / "scratch"
        scratch.mkdir(exist_ok=True)
        return env | {
            "PBRS_REDIS_URL": self.redis_url,
            "PBRS_STORE": self.store.url,
            "PBRS_FARM_RUNNER": self.runner,
            "PBRS_FARM_WORKER": worker,
            "PBRS_FARM_SLOTS": str(slots),
            "PBRS_FARM_SCRATCH": str(scratch),
            "PBRS_TEST_CONTROL": str(self.control),
            "PYTHONPATH": str(REPO),
        }

    def start(self, name: str, *words: str, slots: int = 1, prefix: tuple[str, ...] = ()) -> None:
        """A process `python -m words...` of the farm, its output in <folder>/<name>.log."""
        with (self.folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [*prefix, sys.executable, "-m", *words],
                cwd=REPO,
                env=self.environment(name, slots),
                stdout=log,
                stderr=log,
                start_new_session=True,
                preexec_fn=die_with_parent,
            )

    def coordinator(self, name: str = "coordinator") -> None:
        self.start(name, "workers.coordinator.leader")

    def worker(self, name: str, slots: int = 1, prefix: tuple[str, ...] = ()) -> None:
        self.start(name, "workers.node.supervisor", slots=slots, prefix=prefix)

    def submit(self, n_houses: int, prefix: str = "h", token: str = "", **fields: object) -> str:
        """Submit a job of n_houses; `job` is the last one, `houses` are those of all."""
        names = [f"{prefix}{k:03d}" + "x" * (k % 2) for k in range(n_houses)]
        self.houses = sorted({*self.houses, *names})
        houses = [HouseEntry(house_id=h) for h in names]
        spec = new_spec(recipe_from_name("preview"), rules={"shard_size": 5}, **fields)
        farm = Farm(replace(self.farm.config, token=Secret(token))) if token else self.farm
        self.job = farm.submit(houses, spec).job_id
        return self.job

    def kill(self, name: str, sign: signal.Signals = signal.SIGKILL) -> None:
        """Kill the process and its children, like a node that loses power."""
        process = self.processes.pop(name)
        tree = descendants(process.pid)
        for pid in (process.pid, *tree):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, sign)
        process.wait(20)

    def close(self) -> None:
        for name in list(self.processes):
            self.kill(name)
        self.farm.ledger.client.close()

    def wait(self, true: Callable[[], bool], seconds: float, what: str) -> float:
        """Seconds until `true()` holds; on timeout fails with the farm's logs."""
        began = time.monotonic()
        while time.monotonic() - began < seconds:
            if true():
                return time.monotonic() - began
            time.sleep(0.05)
        logs = "\n".join(
            f"--- {p.name}\n{p.read_text()[-3000:]}" for p in sorted(self.folder.glob("*.log"))
        )
        view = self.farm.ledger.view(self.job)
        raise AssertionError(f"not within {seconds} s: {what}\n{view}\n{logs}")

    def state(self) -> str:
        view = self.farm.ledger.view(self.job)
        return view.state if view is not None else ""

    def wait_done(self, seconds: float = 60) -> float:
        return self.wait(lambda: self.state() == "done", seconds, "the job is done")

    def running(self) -> int:
        """Number of tasks that run now."""
        view = self.farm.view(self.job)
        return int(sum(n for k, n in view.counts.items() if k.endswith(":r")))

    def starts(self) -> Counter[str]:
        """Task -> number of times that a runner began it."""
        path = self.control / "starts"
        return Counter(path.read_text().splitlines() if path.exists() else ())

    def objects(self) -> dict[str, bytes]:
        """The stored objects, apart from jobs/, the recipe and the layout."""
        return {
            key: self.store.get(key)
            for key in self.store.list()
            if not key.startswith("jobs/") and key not in ("recipe.json", LAYOUT)
        }

    def expected(self, *, without: tuple[str, ...] = ()) -> dict[str, bytes]:
        """The objects that one process makes of the same houses, without a farm."""
        folder = self.folder / "alone"
        (folder / "control").mkdir(parents=True, exist_ok=True)
        store = FolderStore(folder / "store")
        runner = FakeRunner(store, folder / "control")

        def run(house: str, unit: str, stage: str, views: tuple[str, ...] = ()) -> None:
            request = TaskRequest(job_id="0" * 12, house=house, unit=unit, stage=stage, views=views)
            runner.run(request, lambda _step: None)

        for house in self.houses:
            if house in without:
                continue
            run(house, "-", "geometry")
            for number, views in enumerate(batches_of(house)):
                run(house, str(number), "gl", views)
                run(house, str(number), "light", views)
            run(house, "-", "reduce")
        run("-", "-", "job")
        return {key: store.get(key) for key in store.list()}

    def check_complete(self, *, n_repeats: int) -> int:
        """Check that the store is complete, without extra objects. Returns the repeated starts (<= n_repeats)."""
        objects, expected = self.objects(), self.expected()
        missing, more = (
            sorted(expected.keys() - objects.keys()),
            sorted(objects.keys() - expected.keys()),
        )
        assert (missing, more) == ([], []), f"missing {missing}, too many {more}"
        assert [key for key in expected if objects[key] != expected[key]] == []
        view = self.farm.view(self.job)
        n_batches = sum(len(batches_of(h)) for h in self.houses)
        n_markers = Counter(
            key.rpartition("/")[2].partition(".")[0] for key in self.objects() if "/done/" in key
        )
        assert view.counts["done:gl"] == view.counts["done:light"] == n_batches
        assert view.counts["done:geometry"] == n_markers["house"] == len(self.houses)
        assert 2 * view.counts["done:light"] == n_markers["light"]
        starts = self.starts()
        n_extra = sum(n - 1 for n in starts.values())
        assert n_extra <= n_repeats, [t for t, n in starts.items() if n > 1]
        return n_extra
