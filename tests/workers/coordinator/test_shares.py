"""The most urgent job is fed first, and none waits for ever."""

from __future__ import annotations

from collections import Counter

import pytest

from workers.coordinator.shares import Shares
from workers.ledger.task_ledger import JobView


def job(name: str, priority: int, ready: int = 1000, state: str = "running") -> JobView:
    fields = {"priority": str(priority), "state": state}
    return JobView(name, fields, {"light:w": ready}, {}, 0)


def sent(shares: Shares, views: list[JobView], turns: int, room: int = 1) -> Counter[str]:
    """Job -> tasks of light that were sent in so many turns."""
    n: Counter[str] = Counter()
    for _ in range(turns):
        for name, given in shares.split({"light": room}, views).items():
            shares.charge("light", name, given["light"])
            n[name] += given["light"]
    return n


@pytest.mark.parametrize("room", [1, 4, 50])
def test_nine_tasks_of_the_urgent_job_are_sent_for_one_of_the_other(room: int) -> None:
    views = [job("a", 2), job("b", 7)]
    assert sent(Shares(), views, 100 // room, room) == {"a": 90, "b": 10}


def test_jobs_of_equal_priority_take_turns() -> None:
    assert sent(Shares(), [job("a", 5), job("b", 5)], 10) == {"a": 5, "b": 5}


def test_of_ten_priorities_the_last_gets_something() -> None:
    views = [job(str(k), k, ready=10_000) for k in range(10)]
    n = sent(Shares(), views, 1000)
    assert n["0"] > 700
    assert min(n.values()) >= 5


def test_what_the_urgent_job_has_not_goes_to_the_other() -> None:
    given = Shares().split({"light": 8}, [job("a", 0, ready=3), job("b", 9)])
    assert (given["a"]["light"], given["b"]["light"]) == (3, 5)


def test_a_changed_priority_counts_at_the_next_task() -> None:
    shares = Shares()
    sent(shares, [job("a", 1), job("b", 5)], 200)
    assert sent(shares, [job("b", 0), job("a", 1)], 10) == {"b": 9, "a": 1}


def test_a_job_that_comes_late_owes_and_is_owed_nothing() -> None:
    shares = Shares()
    sent(shares, [job("a", 5)], 500)
    assert sent(shares, [job("a", 5), job("b", 5)], 11) == {"a": 6, "b": 5}


def test_light_on_a_gpu_has_a_room_of_its_own() -> None:
    gpu = JobView("g", {"state": "running", "gpu": "1"}, {"light:w": 9}, {}, 0)
    given = Shares().split({"light": 4, "light.gpu": 2}, [job("a", 5), gpu])
    assert given == {"a": {"light": 4, "light.gpu": 0}, "g": {"light": 0, "light.gpu": 2}}


def test_a_paused_job_gets_nothing() -> None:
    given = Shares().split({"light": 4}, [job("a", 0, state="paused"), job("b", 5)])
    assert (given["a"]["light"], given["b"]["light"]) == (0, 4)
