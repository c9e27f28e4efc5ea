"""A slot of a worker with a fake clock and fake processes."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.run.processes.limits import ProcessLimits
from pbrs_farm.run.processes.render_process import RenderProcess
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.secret import Secret
from tests.run.fake_child import FakeChild, FakeClock
from tests.workers.memory_ledger import MemoryLedger, MemoryRegistry
from workers.config import FarmConfig, Limits
from workers.ids import task_from_text
from workers.node.slot import Slot

JOB = "0" * 12


TASK = "h0/0/gl"


class Bench:
    """One slot; `next` is the next process that it will start."""

    def __init__(self, folder: Path) -> None:
        self.clock = FakeClock()
        self.started: list[FakeChild] = []
        self.next = FakeChild(self.clock)
        self.ledger = MemoryLedger(inputs={TASK: "a,b;c", "h0/1/gl": "a,b;c"})
        self.registry = MemoryRegistry()
        self.config = FarmConfig(
            redis_url=Secret("redis://127.0.0.1:1/0"), store_url=(folder / "store").as_uri(),
            worker="w1", scratch=folder, limits=Limits(silence_s=100.0, gl_s=1000.0),
        )  # fmt: skip
        self.store = FolderStore(folder / "store")
        process = RenderProcess(self._start, ProcessLimits(silence_s=100.0), clock=self.clock)
        self.slot = Slot(
            self.config, self.ledger, self.registry, process, clock=self.clock, sleep=self._sleep
        )

    def _start(self) -> FakeChild:
        self.started.append(self.next)
        self.next = FakeChild(self.clock)
        return self.started[-1]

    def _sleep(self, seconds: float) -> None:
        self.clock.now += seconds

    def run(self, *tasks: str) -> None:
        self.slot.run_tasks(JOB, [task_from_text(task) for task in tasks or (TASK,)], "r")


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)
