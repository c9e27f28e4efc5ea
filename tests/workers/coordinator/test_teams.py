"""Slots follow the user with the fewest over his share, urgent jobs get running ones, quotas hold."""

from __future__ import annotations

import pytest

from workers.coordinator.shares import Shares
from workers.coordinator.teams import barred, victims
from workers.ledger.task_ledger import EVERYWHERE, Hold, JobView, User, WorkerView


def job(name: str, user: str = "", *, urgent: bool = False, **counts: float) -> JobView:
    """counts: light_w=3 are three ready tasks of light."""
    fields = {"state": "running", "user": user, "preempt": str(int(urgent)), "priority": "5"}
    return JobView(name, fields, {k.replace("_", ":"): n for k, n in counts.items()}, {}, 0)


def given(views: list[JobView], room: int, window: int, **shares: float) -> dict[str, int]:
    split = Shares().split(
        {"light": room}, views, windows={"light": window}, share_of=lambda u: shares.get(u, 1.0)
    )
    return {name: lanes["light"] for name, lanes in split.items()}


def test_users_have_equal_shares_whatever_the_number_and_priority_of_their_jobs() -> None:
    views = [job(f"a{k}", "ann", light_w=90) for k in range(3)] + [job("b", "bob", light_w=90)]
    n = given(views, 60, 60)
    assert n["b"] == 30
    assert [n[f"a{k}"] for k in range(3)] == [10, 10, 10]


def test_a_user_of_three_shares_has_three_tasks_for_one_of_the_other() -> None:
    n = given([job("a", "ann", light_w=90), job("b", "bob", light_w=90)], 40, 40, ann=3.0)
    assert n == {"a": 30, "b": 10}


def test_who_comes_late_may_fill_his_share_of_a_window_that_is_full() -> None:
    views = [job("a", "ann", light_w=90, light_q=8, light_r=8), job("b", "bob", light_w=90)]
    assert given(views, 0, 16) == {"a": 0, "b": 8}


def test_what_is_free_goes_to_who_holds_less_and_none_is_left_over() -> None:
    views = [job("a", "ann", light_w=90, light_r=4), job("b", "bob", light_w=2, light_r=1)]
    assert given(views, 6, 11) == {"a": 4, "b": 2}


def test_an_urgent_job_fills_the_window_first_even_where_it_is_full() -> None:
    views = [job("a", "ann", light_w=9, light_q=10), job("u", "bob", urgent=True, light_w=30)]
    assert given(views, 1, 10) == {"a": 0, "u": 10}


def test_jobs_of_who_holds_more_leave_what_comes_to_who_waits_and_only_there() -> None:
    ann, bob = job("a", "ann", gl_r=4, gl_q=5), job("b", "bob", gl_r=1, light_q=2)
    assert barred([ann, bob], {}, {}) == {"a": (("light",), "it is the turn of bob")}
    # By shares, and never because of somebody who has nothing that waits.
    assert barred([ann, bob], {"ann": User("ann", share=3.0)}, {}) == {}
    assert barred([ann, job("b", "bob", light_w=2)], {}, {}) == {}
    assert barred([ann, job("a2", "ann", light_q=9)], {}, {}) == {}
    # Who has nothing goes first, and one slot more or less is no matter.
    one, two = job("a", "ann", geometry_r=1), job("a", "ann", geometry_r=2)
    assert barred([one, job("b", "bob", light_q=2)], {}, {}).keys() == {"a"}
    assert barred([two, job("b", "bob", geometry_r=1, light_q=2)], {}, {}) == {}


def test_an_urgent_job_that_waits_goes_before_all_others() -> None:
    views = [job("a", "ann"), job("u", "ann", urgent=True, gl_q=1, gl_r=9)]
    assert barred(views, {}, {}) == {"a": (("gl",), "job u is urgent")}


def test_spent_slot_hours_hold_every_job_of_their_user_back() -> None:
    views = [job("a", "ann", gl_q=1), job("b", "bob", gl_q=1)]
    users = {"ann": User("ann", slot_hours=2.0), "bob": User("bob", slot_hours=2.0)}
    found = barred(views, users, {"ann": 2.0, "bob": 1.9})
    assert found.keys() == {"a"}
    assert found["a"][0] == (EVERYWHERE,)
    assert "ann has used 2 of 2 slot-hours" in found["a"][1]


def worker(name: str, slots: int, queues: str = "gl,light") -> WorkerView:
    return WorkerView(name, 0.0, {"slots": str(slots), "queues": queues})


def hold(owner: str, number: int, at: str = "w1", *, marked: bool = False) -> Hold:
    return Hold(owner, f"h/{number}/light", f"{owner}{number}", at, float(number), marked)


@pytest.mark.parametrize(("n_free", "n_marked", "expected"), [(0, 0, 2), (1, 0, 1), (0, 1, 1)])
def test_as_many_slots_are_taken_as_wait_but_for_free_ones_and_those_told_already(
    n_free: int, n_marked: int, expected: int
) -> None:
    holds = {"a": [hold("a", k, marked=k < n_marked) for k in range(4)], "u": []}
    views = [job("a"), job("u", urgent=True, light_q=2)]
    chosen = victims(views, holds.__getitem__, [worker("w1", 4 + n_free)])
    # What began last has lost least.
    assert [h.token for h in chosen] == [f"a{3 - k}" for k in range(expected)]


def test_no_urgent_job_s_task_no_merge_and_no_slot_that_could_not_take_it_is_ended() -> None:
    holds = {
        "a": [hold("a", 1, "w2"), Hold("a", "-/s0/shard", "m", "w1", 9.0)],
        "u": [hold("u", 1)],
    }
    views = [job("a"), job("u", urgent=True, light_q=5)]
    workers = [worker("w1", 2), worker("w2", 1, "gl")]
    assert victims(views, holds.__getitem__, workers) == []
