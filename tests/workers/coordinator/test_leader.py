"""The coordinator with a ledger in memory: one leads, sends within its window, resends lost tasks."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from pathlib import Path

import pytest

from pbrs_farm.store.secret import Secret
from tests.run.fake_child import FakeClock
from tests.workers.memory_ledger import MemoryLedger, MemoryRegistry
from workers.config import FarmConfig
from workers.coordinator.leader import Coordinator

JOB = "0" * 12


class Bench:
    """A coordinator and its sent messages."""

    def __init__(self, folder: Path) -> None:
        self.clock = FakeClock()
        self.config = FarmConfig(
            redis_url=Secret("redis://127.0.0.1:1/0"), worker="c", scratch=folder,
            window_min=3, window_per_slot=2,
        )  # fmt: skip
        self.ledger = MemoryLedger()
        self.registry = MemoryRegistry()
        self.sent: list[tuple[str, str, str, str]] = []
        self.coordinator = self.another()

    def another(self) -> Coordinator:
        return Coordinator(
            self.config, self.ledger, self._send, registry=self.registry, clock=self.clock
        )

    def _send(self, messages: Iterable[tuple[str, str, str, str]]) -> None:
        self.sent += messages


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_ready_tasks_are_sent_to_their_queues(bench: Bench) -> None:
    bench.ledger.ready = ["h0/-/geometry", "h1/0/light", "-/s0/shard"]
    assert bench.coordinator.turn() == 3
    assert bench.sent == [
        ("geometry", JOB, "h0/-/geometry", "r"),
        ("light", JOB, "h1/0/light", "r"),
        ("reduce", JOB, "-/s0/shard", "r"),
    ]
    bench.ledger.fields["gpu"] = "1"
    bench.ledger.ready = ["h2/0/light"]
    bench.coordinator.turn()
    assert bench.sent[-1][0] == "light.gpu"


def test_the_window_grows_with_the_slots_and_bounds_tasks_in_flight(bench: Bench) -> None:
    bench.ledger.ready = [f"h{k}/-/geometry" for k in range(20)]
    assert [bench.coordinator.turn() for _ in range(2)] == [3, 0]
    bench.registry.n_slots = {"geometry": 4}
    bench.clock.now += 5.0
    assert bench.coordinator.turn() == 2 * 4 - 3


def test_only_the_leader_sends_and_the_next_takes_over(bench: Bench) -> None:
    successor = bench.another()
    assert bench.coordinator.turn() == 0
    bench.ledger.ready = ["h0/-/geometry"]
    assert (successor.turn(), successor.leading) == (0, False)
    bench.ledger.leader = ""
    assert (successor.turn(), successor.leading) == (1, True)
    assert (bench.coordinator.turn(), bench.coordinator.leading) == (0, False)


def test_nothing_is_sent_while_storage_is_unhealthy(bench: Bench) -> None:
    bench.ledger.ready = ["h0/-/geometry"]
    bench.registry.reason = "bucket away"
    assert bench.coordinator.turn() == 0
    bench.registry.reason = ""
    assert bench.coordinator.turn() == 1


def test_an_old_message_is_sent_again_only_when_its_queue_is_empty(bench: Bench) -> None:
    bench.ledger.queued = ["h0/0/gl"]
    bench.ledger.lengths["gl"] = 1
    assert bench.coordinator.turn() == 0
    bench.ledger.lengths["gl"] = 0
    bench.clock.now += 15.0
    assert bench.coordinator.turn() == 1
    assert bench.sent == [("gl", JOB, "h0/0/gl", "r")]


def test_leases_are_reaped_every_five_seconds(bench: Bench) -> None:
    for _ in range(100):
        bench.coordinator.turn()
        bench.clock.now += 0.1
    assert bench.ledger.reaped == 2


def test_redis_away_is_no_end_and_leaving_gives_up_the_lead(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = threading.Event()
    bench.ledger.n_away = 2
    waits: list[float] = []

    def wait(seconds: float | None = None) -> bool:
        waits.append(seconds or 0.0)
        if len(waits) == 3:
            stop.set()
        return stop.is_set()

    monkeypatch.setattr(stop, "wait", wait)
    bench.ledger.ready = ["h0/-/geometry"]
    bench.coordinator.run(stop)
    assert len(bench.sent) == 1
    assert bench.ledger.leader == ""


def test_short_tasks_of_one_house_share_a_message_if_each_slot_gets_some(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = {"gl": 0.5, "light": 20.0}
    monkeypatch.setattr(
        "workers.coordinator.job_counts.mean_s", lambda _views, stage: seconds.get(stage)
    )
    bench.registry.n_slots = {"gl": 2, "light": 2, "geometry": 2}
    units = [f"h{house}/{unit}" for house in (0, 1) for unit in range(3)]
    bench.ledger.ready = [f"{unit}/{stage}" for stage in ("gl", "light") for unit in units]
    bench.ledger.ready += ["h2/-/geometry", "h3/-/geometry"]
    while bench.coordinator.turn():
        pass
    sent = [task for _queue, _job, task, _recipe in bench.sent]
    assert next(task for task in sent if task.endswith("gl")).startswith("h0/0,1")
    # Long tasks, and those of unknown length, are sent one by one.
    assert all("," not in task for task in sent if not task.endswith("gl"))
    assert len([task for task in sent if task.endswith("light")]) > 0


def test_a_jobs_ceiling_bounds_its_tasks_in_flight(bench: Bench) -> None:
    bench.ledger.fields["max_slots"] = "2"
    bench.registry.n_slots = {"gl": 50, "light": 50}
    bench.ledger.ready = [f"h0/{k}/gl" for k in range(5)]
    assert bench.coordinator.turn() == 2
    bench.clock.now += 2
    assert bench.coordinator.turn() == 0
    bench.ledger.queued.clear()
    assert bench.coordinator.turn() == 2


def test_a_job_that_has_spent_its_budget_pauses_itself(bench: Bench) -> None:
    bench.ledger.fields["budget_h"] = "0.5"
    bench.ledger.seconds["light"] = 1799.0
    bench.coordinator.turn()
    assert bench.ledger.fields["state"] == "running"
    bench.ledger.seconds["light"] = 1800.0
    bench.clock.now += 5
    bench.coordinator.turn()
    assert bench.ledger.fields["state"] == "paused"
    assert "0.5 slot-hours" in bench.ledger.fields["reason"]


@pytest.mark.parametrize(
    ("before", "sent", "state"),
    [
        ("done", 1, "running"),
        ("running", 0, "running"),
        ("paused", 0, "running"),
        ("cancelled", 0, "paused"),
        (None, 0, "paused"),
    ],
)
def test_a_job_follows_another_one(bench: Bench, before: str | None, sent: int, state: str) -> None:
    bench.ledger.fields["after"] = "b" * 12
    bench.ledger.ready = ["h0/-/geometry"]
    bench.ledger.others = {} if before is None else {"b" * 12: before}
    assert bench.coordinator.turn() == sent
    assert bench.ledger.fields["state"] == state
    if state == "paused":
        assert "b" * 12 in bench.ledger.fields["reason"]
