"""Urgent jobs get the slots of running tasks, as few as they need."""

from __future__ import annotations

import pytest

from workers.coordinator.preemption import choose_victims
from workers.ledger.task_ledger import Hold, JobView, WorkerView


def job(name: str, user: str = "", *, urgent: bool = False, **counts: float) -> JobView:
    """counts: light_w=3 means three ready tasks of light."""
    fields = {"state": "running", "user": user, "preempt": str(int(urgent)), "priority": "5"}
    return JobView(name, fields, {k.replace("_", ":"): n for k, n in counts.items()}, {}, 0)


def worker(name: str, slots: int, queues: str = "gl,light") -> WorkerView:
    return WorkerView(name, 0.0, {"slots": str(slots), "queues": queues})


def hold(owner: str, number: int, at: str = "w1", *, marked: bool = False) -> Hold:
    return Hold(owner, f"h/{number}/light", f"{owner}{number}", at, float(number), marked)


@pytest.mark.parametrize(("n_free", "n_marked", "expected"), [(0, 0, 2), (1, 0, 1), (0, 1, 1)])
def test_as_many_slots_are_taken_as_wait_but_for_free_ones_and_those_that_end_already(
    n_free: int, n_marked: int, expected: int
) -> None:
    holds = {"a": [hold("a", k, marked=k < n_marked) for k in range(4)], "u": []}
    views = [job("a"), job("u", urgent=True, light_q=2)]
    chosen = choose_victims(views, holds.__getitem__, [worker("w1", 4 + n_free)])
    # The youngest task has lost the least.
    assert [h.token for h in chosen] == [f"a{3 - k}" for k in range(expected)]


def test_no_urgent_job_s_task_no_merge_and_no_slot_that_could_not_take_it_is_ended() -> None:
    holds = {
        "a": [hold("a", 1, "w2"), Hold("a", "-/s0/shard", "m", "w1", 9.0)],
        "u": [hold("u", 1)],
    }
    views = [job("a"), job("u", urgent=True, light_q=5)]
    workers = [worker("w1", 2), worker("w2", 1, "gl")]
    assert choose_victims(views, holds.__getitem__, workers) == []
