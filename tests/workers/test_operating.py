"""An operator's cases: differing stores, lasting drains, reported failures, unknown names."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.store.folder import FolderStore
from tests.inputs.submitted_jobs import HOUSES, environment, fail, farm, submit
from workers.client.farm_client import Farm, new_spec
from workers.client.text import explanation_text, status_text, workers_text
from workers.ids import log_key
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import LedgerUnavailable
from workers.ledger.worker_registry import Registry
from workers.node import supervisor
from workers.node.faults import without_numbers
from workers.store_identity import known_store_id, store_id

__all__ = ["farm"]  # a fixture


def registry_of(farm: Farm, **changes: object) -> Registry:
    """The registry as a worker with other settings sees it."""
    return Registry(RedisLedger(replace(farm.config, **changes), farm.ledger.client))


# Stores


def test_one_store_has_one_id_under_any_url(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "a")
    assert known_store_id(store) == ""
    assert store_id(store) == store_id(FolderStore(tmp_path / "x" / ".." / "a")) != ""
    assert store_id(FolderStore(tmp_path / "b")) != store_id(store)


def test_submit_is_refused_if_no_worker_has_the_store(farm: Farm) -> None:
    theirs = {"store_url": "file:///elsewhere", "store_id": "0123"}
    registry_of(farm, worker="w7", **theirs).heartbeat()
    with pytest.raises(BadInput, match=r"no worker uses this store; they use file:///elsewhere"):
        submit(farm)
    assert farm.jobs() == []
    # No file was written into the other store.
    assert list(farm.store.list()) == []
    # One worker that has the store is enough.
    registry_of(farm, worker="w8", store_id=store_id(farm.store)).heartbeat()
    assert submit(farm).state == "running"


def test_plugins_missing_on_workers_are_reported_at_submit(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert farm.check_plugins(["kitchen of lab 1.0"]) == []  # no worker can report
    registry_of(farm, worker="w7").heartbeat()
    with pytest.raises(BadInput, match=r"no worker has all plugins: w7 lacks kitchen of lab 1\.0"):
        farm.check_plugins(["kitchen of lab 1.0"])
    marks = ("kitchen of lab 1.0", "height of lab 1.0")
    monkeypatch.setattr("workers.ledger.worker_registry.installed_marks", lambda: marks)
    registry_of(farm, worker="w8").heartbeat()
    assert farm.check_plugins(["kitchen of lab 1.0"]) == ["w7 lacks kitchen of lab 1.0"]


def test_submit_proceeds_without_workers_and_reports_other_stores(farm: Farm) -> None:
    registry_of(farm, worker="old").heartbeat()
    assert submit(farm).state == "running"


def test_a_worker_of_another_store_refuses_the_task_with_the_reason(farm: Farm) -> None:
    d = submit(farm)
    (task, *_others) = d.dispatch()
    ledger = RedisLedger(replace(farm.config, store_id="ffff"), farm.ledger.client)
    claim = ledger.claim(d.job.job_id, task, token="t", recipe=d.job.recipe.digest())
    assert (claim.verdict, claim.detail) == ("store", store_id(farm.store))
    assert farm.explain(d.job.job_id, task)[0]["state"] == "waits before the next attempt"
    assert farm.status(d.job.job_id)["failures"] == {}


def test_why_reports_that_all_workers_have_another_store(farm: Farm) -> None:
    d = submit(farm)
    d.dispatch()
    registry_of(farm, store_id="ffff").heartbeat()
    (row,) = farm.explain(d.job.job_id, "h0")
    assert row["because"] == "all workers for geometry use another store"


# Draining


def test_a_drain_outlives_the_worker_that_left(farm: Farm) -> None:
    registry = farm.registry
    assert not registry.heartbeat()
    farm.drain("w1")
    assert registry.heartbeat()
    registry.leave()
    # The container is restarted under the same name.
    assert registry.is_drained()
    assert registry.heartbeat(takes_work=False)
    assert registry.slots() == {}
    (row,) = farm.workers()
    assert row["state"] == "drained"
    farm.drain("w1", undo=True)
    assert not registry.is_drained()
    assert not registry.heartbeat()
    assert farm.workers()[0]["state"] == "alive"


def test_a_drain_of_an_absent_worker_can_be_revoked(farm: Farm) -> None:
    farm.registry.heartbeat()
    farm.drain("w1")
    farm.registry.leave()
    farm.drain("w1", undo=True)
    assert not farm.registry.is_drained()


def test_a_restarted_drained_worker_waits_until_undrained(
    farm: Farm, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(supervisor, "DRAINED_POLL_S", 0.1)
    monkeypatch.setattr(supervisor, "_POLL_S", 0.02)
    config = replace(farm.config, scratch=tmp_path)
    farm.registry.heartbeat()
    farm.drain("w1")
    farm.registry.leave()
    answers: list[bool] = []

    orders = supervisor.Orders()

    def wait() -> None:
        answers.append(supervisor.wait_while_drained(config, orders))

    thread = threading.Thread(target=wait)
    thread.start()
    try:
        give_up = time.monotonic() + 10
        while farm.workers() == [] or farm.workers()[0]["state"] != "drained":
            assert time.monotonic() < give_up
            time.sleep(0.02)
        assert config.heartbeat_file.exists()
        assert answers == []
        farm.drain("w1", undo=True)
        thread.join(10)
    finally:
        orders.leave_at = 1.0
        thread.join(10)
    assert answers == [True]


def test_a_waiting_drained_worker_ends_at_a_signal(farm: Farm, tmp_path: Path) -> None:
    farm.registry.heartbeat()
    farm.drain("w1")
    orders = supervisor.Orders(leave_at=1.0)
    assert not supervisor.wait_while_drained(replace(farm.config, scratch=tmp_path), orders)
    assert farm.workers() == []


def test_a_worker_that_leaves_is_seen_without_slots_until_it_is_gone(farm: Farm) -> None:
    farm.registry.heartbeat()
    assert farm.registry.slots() != {}
    farm.registry.heartbeat(is_leaving=True)
    assert farm.workers()[0]["state"] == "draining"
    assert farm.registry.slots() == {}
    assert farm.ledger.client.zcard(f"{farm.config.prefix}workers:gl") == 0
    # It is restarted under its name.
    farm.registry.heartbeat()
    assert farm.workers()[0]["state"] == "alive"


# A fresh farm, and one whose ledger is lost


def test_status_of_a_fresh_farm_is_no_failure_and_a_lost_ledger_names_the_job(
    farm: Farm, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    environment(farm, monkeypatch)
    assert main(["status"]) == 0
    assert capsys.readouterr().out == "no job yet; 0 workers\n"
    job = submit(farm).job.job_id
    assert farm.lost_jobs() == []
    farm.ledger.forget(job)
    farm.ledger.client.delete(*farm.ledger.client.scan_iter(f"{farm.config.prefix}*"))
    assert farm.lost_jobs() == [job]
    assert main(["status"]) == 1
    assert f"pbrs-farm recover {job}" in capsys.readouterr().err
    assert main(["recover", job]) == 0
    assert main(["status"]) == 0


# Failures


def test_a_job_with_failures_ends_with_them_and_status_exits_with_one(
    farm: Farm, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    environment(farm, monkeypatch)
    d = submit(farm)
    job = d.job.job_id
    bad, *good = d.dispatch()
    assert fail(d, bad) == "failed"
    for task in good:
        d.run(task)
    d.run_all()
    assert farm.status(job)["state"] == "done with failures"
    for words in (["status", job], ["status", job, "--watch"], ["status", "--json", job]):
        assert main(words) == 1
        assert "done with failures" in capsys.readouterr().out
    assert farm.submit(HOUSES, new_spec(recipe_from_name("preview"))).was == "done with failures"
    # After a successful retry nothing of the failure remains.
    farm.retry(job)
    d.run_all()
    assert main(["status", job]) == 0
    assert farm.status(job)["failures"] == {}


def test_failures_are_counted_as_tasks_and_attempts_apart(farm: Farm) -> None:
    d = submit(farm)
    task = d.dispatch()[0]
    for _attempt in range(3):
        assert fail(d, task, "bug") in ("retry", "failed")
        d.dispatch()
    status = farm.status(d.job.job_id)
    assert status["failures"] == {"bug": 1}
    assert status["failed_attempts"] == {"bug": 3}
    text = status_text(status)
    assert "permanently failed tasks: 1 bug" in text
    assert "attempts failed: 3 bug" in text


@pytest.mark.parametrize(
    ("message", "headline"),
    [
        ("broken.sh3d: Home: is not a home of Sweet Home 3D 7", "broken.sh3d: Home: is not a home of Sweet Home 3D #"),
        ("2BedroomApartment: wall w3 is 0.03 m thick", "2BedroomApartment: wall w# is # m thick"),
        ("needs 1200MB, has 512 MB", "needs #MB, has # MB"),
        ("room 4 of house 0123456789abcdef", "room # of house #"),
        ("at 0x7f001234 in /tmp/x/y.py", "at # in PATH"),
        ("the defaced facade", "the defaced facade"),
    ],
)  # fmt: skip
def test_headlines_keep_their_words(message: str, headline: str) -> None:
    assert without_numbers(message) == headline


# Workers and names


def test_workers_lists_dead_and_live_ones(farm: Farm) -> None:
    farm.registry.heartbeat()
    gone = registry_of(farm, worker="w9")
    gone.heartbeat()
    farm.ledger.client.zadd(f"{farm.config.prefix}workers", {"w9": farm.ledger.now() - 300})
    states = {row["worker"]: row["state"] for row in farm.workers()}
    assert states == {"w1": "alive", "w9": "dead"}
    assert workers_text(farm.workers()).splitlines()[-1] == "1 alive, 1 dead"


def test_why_reports_a_silent_holder_and_the_end_of_its_lease(farm: Farm) -> None:
    d = submit(farm)
    task = d.dispatch()[0]
    d.claim(task)
    farm.registry.heartbeat()
    (row,) = farm.explain(d.job.job_id, task)
    assert 0 < row["lease_s"] <= farm.config.lease_s
    assert "silent_s" not in row
    farm.ledger.client.zadd(f"{farm.config.prefix}workers", {"w1": farm.ledger.now() - 100})
    rows = farm.explain(d.job.job_id, task)
    text = explanation_text(rows)
    assert "the worker has been silent for 100s" in text
    assert "then another worker gets the task" in text


@pytest.mark.parametrize(
    ("task", "says"),
    [
        ("h7/-/geometry", "no such house"),
        ("h0/7/gl", "no such task"),
        ("h0/-/geometry", "no log stored"),
    ],
)
def test_logs_names_the_unknown_name(farm: Farm, task: str, says: str) -> None:
    d = submit(farm)
    d.dispatch()
    with pytest.raises(BadInput, match=says):
        farm.logs(d.job.job_id, task)


def test_logs_lists_the_attempts_with_a_log(farm: Farm) -> None:
    d = submit(farm)
    d.dispatch()
    farm.store.put(log_key(d.job.job_id, "h0/-/geometry", 2), b"text")
    with pytest.raises(BadInput, match="of attempts 2"):
        farm.logs(d.job.job_id, "h0/-/geometry", 1)


def test_drain_offers_the_name_that_is_near(farm: Farm) -> None:
    registry_of(farm, worker="worker-12").heartbeat()
    with pytest.raises(BadInput, match=r"no such worker \(did you mean worker-12\?\)"):
        farm.drain("worker12")


class FakeJobs:
    """Stands in for a ledger's count of jobs with work; raises an error where a script has one."""

    def __init__(self) -> None:
        self.jobs: list[str] | None = []

    def active_jobs(self) -> list[str]:
        if self.jobs is None:
            raise LedgerUnavailable("no Redis")
        return self.jobs


def test_a_worker_is_idle_since_no_job_had_work_and_never_while_redis_is_silent() -> None:
    now, ledger = [100.0], FakeJobs()
    idleness = supervisor.Idleness(ledger, clock=lambda: now[0])  # type: ignore[arg-type]
    idle_seconds: list[float] = []
    steps: list[tuple[float, list[str] | None]] = [
        (130.0, []), (135.0, ["j"]), (141.0, ["j"]), (200.0, []), (260.0, None), (280.0, []),
    ]  # fmt: skip
    for now[0], ledger.jobs in steps:
        idle_seconds.append(idleness.seconds())
    # At 135 it does not ask yet, as it asked at 130.
    assert idle_seconds == [30.0, 35.0, 0.0, 59.0, 0.0, 20.0]


@pytest.fixture
def handlers() -> Iterator[None]:
    """Restores signal handlers after the test."""
    before = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize(
    ("says", "given", "code"),
    [
        ("pass", {"idle_s": 0.0, "preempted_code": 85}, -signal.SIGTERM),
        ("os.kill(os.getppid(), signal.SIGTERM)", {"preempted_code": 85}, 85),
        ("os.kill(os.getppid(), signal.SIGTERM)", {}, -signal.SIGTERM),
    ],
    ids=["idle", "preempted", "asked to leave"],
)
def test_a_worker_ends_when_idle_and_reports_preemption(
    farm: Farm,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    says: str,
    given: dict[str, Any],
    code: int,
) -> None:
    # In place of Celery: a process that waits for a signal to end.
    program = f"import os, signal, time; {says}; time.sleep(60)"
    monkeypatch.setattr(supervisor, "command", lambda _config: [sys.executable, "-c", program])
    monkeypatch.setattr(supervisor, "_POLL_S", 0.02)
    assert supervisor.supervise(replace(farm.config, scratch=tmp_path), **given) == code
