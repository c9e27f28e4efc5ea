"""Trouble on a farm is posted once when it begins and once when it ends."""

from __future__ import annotations

from typing import Any

from tests.run.fake_child import FakeClock
from workers.coordinator.farm_alerts import FarmAlerts
from workers.ledger.task_ledger import JobView, WorkerView

JOB = "0" * 12


class Watch:
    """Alerts with a fake clock, and their posts."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.posted: list[tuple[str, str]] = []
        self.is_deaf = False
        self.alerts = FarmAlerts(self._post, self.clock)

    def _post(self, row: dict[str, Any]) -> None:
        if self.is_deaf:
            raise OSError("no answer")
        assert row["text"].startswith("pbrs_farm: ")
        self.posted.append((row["alert"], row["state"]))

    def look(
        self,
        after_s: float = 60.0,
        *,
        state: str = "running",
        silent_s: float = 0.0,
        breaker: str = "",
        **counts: float,
    ) -> list[tuple[str, str]]:
        self.clock.now += after_s
        named = {name.replace("_", ":"): n for name, n in counts.items()}
        view = JobView(JOB, {"state": state}, named, {}, 0)
        before = len(self.posted)
        self.alerts.look([view], [WorkerView("w1", silent_s, {})], breaker)
        return self.posted[before:]


def test_a_share_of_failed_attempts_is_posted_and_its_end() -> None:
    watch = Watch()
    assert watch.look(done_gl=100, failures_bug=50) == []  # from before the coordinator started
    assert watch.look(done_gl=108, failures_bug=52) == []
    assert watch.look(done_gl=108, failures_bug=60) == [(f"failures of job {JOB}", "begins")]
    assert watch.look(done_gl=109, failures_bug=60) == []
    for _ in range(12):
        posts = watch.look(done_gl=300, failures_bug=60)
    assert watch.posted[-1] == (f"failures of job {JOB}", "over")
    assert posts == []


def test_few_failures_post_nothing() -> None:
    watch = Watch()
    watch.look()
    assert watch.look(failures_crash=9) == []


def test_a_worker_that_died_is_posted() -> None:
    watch = Watch()
    assert watch.look(silent_s=20.0) == []
    assert watch.look(silent_s=80.0) == [("lost worker w1", "begins")]
    assert watch.look(silent_s=140.0) == []
    assert watch.look(silent_s=1.0) == [("lost worker w1", "over")]
    assert watch.look(silent_s=80.0) == [("lost worker w1", "begins")]


def test_waiting_tasks_are_posted_if_none_ends() -> None:
    watch = Watch()
    watch.look(gl_q=5, done_gl=3)
    assert watch.look(1700, gl_q=5, done_gl=3) == []
    assert watch.look(200, gl_q=5, done_gl=3) == [(f"stuck job {JOB}", "begins")]
    assert watch.look(gl_q=4, done_gl=4) == [(f"stuck job {JOB}", "over")]
    # A paused job, and a job without ready tasks, is not stuck.
    assert watch.look(4000, state="paused", gl_q=4, done_gl=4) == []
    assert watch.look(4000, done_gl=4, gl_r=1) == []


def test_a_store_in_trouble_is_posted_after_a_minute() -> None:
    watch = Watch()
    assert watch.look(breaker="the store is full") == []
    assert watch.look(breaker="the store is full") == [("store", "begins")]
    assert watch.look() == [("store", "over")]


def test_an_alert_that_could_not_be_posted_is_posted_later() -> None:
    watch = Watch()
    watch.is_deaf = True
    watch.look(silent_s=80.0)
    watch.is_deaf = False
    assert watch.look(silent_s=90.0) == [("lost worker w1", "begins")]
