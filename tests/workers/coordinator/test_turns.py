"""The user with the least load is next, his most urgent job is fed first, and nobody starves."""

from __future__ import annotations

from collections import Counter

import pytest

from workers.coordinator.turns import Block, Loads, MessageTurns, find_blocked_jobs
from workers.ledger.task_ledger import EVERYWHERE, JobView, User


def job(name: str, priority: int, ready: int = 1000, state: str = "running") -> JobView:
    fields = {"priority": str(priority), "state": state}
    return JobView(name, fields, {"light:w": ready}, {}, 0)


def sent(turns: MessageTurns, views: list[JobView], n_turns: int, room: int = 1) -> Counter[str]:
    """Job -> tasks of light sent in n_turns turns."""
    n: Counter[str] = Counter()
    for _ in range(n_turns):
        for name, quota in turns.split({"light": room}, views).items():
            turns.charge("light", name, quota["light"])
            n[name] += quota["light"]
    return n


@pytest.mark.parametrize("room", [1, 4, 50])
def test_the_urgent_job_gets_nine_tasks_for_one_of_the_other(room: int) -> None:
    views = [job("a", 2), job("b", 7)]
    assert sent(MessageTurns(), views, 100 // room, room) == {"a": 90, "b": 10}


def test_jobs_of_equal_priority_take_turns() -> None:
    assert sent(MessageTurns(), [job("a", 5), job("b", 5)], 10) == {"a": 5, "b": 5}


def test_of_ten_priorities_the_last_gets_something() -> None:
    views = [job(str(k), k, ready=10_000) for k in range(10)]
    n = sent(MessageTurns(), views, 1000)
    assert n["0"] > 700
    assert min(n.values()) >= 5


def test_unused_quota_of_the_urgent_job_goes_to_the_other() -> None:
    quotas = MessageTurns().split({"light": 8}, [job("a", 0, ready=3), job("b", 9)])
    assert (quotas["a"]["light"], quotas["b"]["light"]) == (3, 5)


def test_a_changed_priority_counts_at_the_next_task() -> None:
    turns = MessageTurns()
    sent(turns, [job("a", 1), job("b", 5)], 200)
    assert sent(turns, [job("b", 0), job("a", 1)], 10) == {"b": 9, "a": 1}


def test_a_job_that_comes_late_owes_and_is_owed_nothing() -> None:
    turns = MessageTurns()
    sent(turns, [job("a", 5)], 500)
    assert sent(turns, [job("a", 5), job("b", 5)], 11) == {"a": 6, "b": 5}


def test_light_on_a_gpu_has_a_separate_window() -> None:
    gpu = JobView("g", {"state": "running", "gpu": "1"}, {"light:w": 9}, {}, 0)
    quotas = MessageTurns().split({"light": 4, "light.gpu": 2}, [job("a", 5), gpu])
    assert quotas == {"a": {"light": 4, "light.gpu": 0}, "g": {"light": 0, "light.gpu": 2}}


def test_a_paused_job_gets_nothing() -> None:
    quotas = MessageTurns().split({"light": 4}, [job("a", 0, state="paused"), job("b", 5)])
    assert (quotas["a"]["light"], quotas["b"]["light"]) == (0, 4)


def of_user(name: str, user: str = "", *, urgent: bool = False, **counts: float) -> JobView:
    """counts: light_w=3 means three ready tasks of light."""
    fields = {"state": "running", "user": user, "preempt": str(int(urgent)), "priority": "5"}
    return JobView(name, fields, {k.replace("_", ":"): n for k, n in counts.items()}, {}, 0)


def split(views: list[JobView], room: int, window: int, **shares: float) -> dict[str, int]:
    quotas = MessageTurns().split(
        {"light": room}, views, windows={"light": window}, share_of=lambda u: shares.get(u, 1.0)
    )
    return {name: pools["light"] for name, pools in quotas.items()}


def test_users_have_equal_shares_for_any_number_and_priority_of_jobs() -> None:
    views = [of_user(f"a{k}", "ann", light_w=90) for k in range(3)] + [
        of_user("b", "bob", light_w=90)
    ]
    n = split(views, 60, 60)
    assert n["b"] == 30
    assert [n[f"a{k}"] for k in range(3)] == [10, 10, 10]


def test_a_user_of_three_shares_gets_three_tasks_for_one_of_the_other() -> None:
    n = split([of_user("a", "ann", light_w=90), of_user("b", "bob", light_w=90)], 40, 40, ann=3.0)
    assert n == {"a": 30, "b": 10}


def test_a_late_user_may_fill_his_share_of_a_full_window() -> None:
    views = [of_user("a", "ann", light_w=90, light_q=8, light_r=8), of_user("b", "bob", light_w=90)]
    assert split(views, 0, 16) == {"a": 0, "b": 8}


def test_free_slots_go_to_users_with_fewer_until_none_is_left() -> None:
    views = [of_user("a", "ann", light_w=90, light_r=4), of_user("b", "bob", light_w=2, light_r=1)]
    assert split(views, 6, 11) == {"a": 4, "b": 2}


def test_an_urgent_job_fills_a_full_window_first() -> None:
    views = [
        of_user("a", "ann", light_w=9, light_q=10),
        of_user("u", "bob", urgent=True, light_w=30),
    ]
    assert split(views, 1, 10) == {"a": 0, "u": 10}


def test_users_are_served_by_what_they_hold_over_their_share() -> None:
    loads = Loads(Counter(ann=4, bob=1), lambda user: {"ann": 3.0}.get(user, 1.0))
    waiting = Counter(ann=2, bob=9, cyd=1)

    def has_more(user: str) -> bool:
        waiting[user] -= 1
        return waiting[user] > 0

    served = loads.serve(list(waiting), has_more)
    # Loads of 4/3, 1 and 0: cyd first, then bob until his two exceed four or five thirds.
    assert [next(served) for _ in range(5)] == ["cyd", "bob", "ann", "ann", "bob"]
    assert loads.held == {"ann": 6, "bob": 3, "cyd": 1}


def test_a_waiting_user_goes_first_only_if_he_is_behind_by_more_than_a_slot() -> None:
    loads = Loads(Counter(ann=5, bob=4, cyd=1), lambda _user: 1.0)
    assert loads.find_users_before("ann", ["bob", "cyd", "dan"]) == ["cyd", "dan"]
    assert loads.find_users_before("dan", ["ann", "cyd"]) == []


def test_a_user_above_his_share_leaves_contested_slots_to_waiting_users() -> None:
    ann, bob = of_user("a", "ann", gl_r=4, gl_q=5), of_user("b", "bob", gl_r=1, light_q=2)
    assert find_blocked_jobs([ann, bob], {}, {}) == {
        "a": Block(("light",), "tasks of bob go first", at_once=False)
    }
    # Divided by shares; a user without ready tasks blocks nobody.
    assert find_blocked_jobs([ann, bob], {"ann": User("ann", share=3.0)}, {}) == {}
    assert find_blocked_jobs([ann, of_user("b", "bob", light_w=2)], {}, {}) == {}
    assert find_blocked_jobs([ann, of_user("a2", "ann", light_q=9)], {}, {}) == {}
    # A user who holds no slot goes first, and a difference of one slot is ignored.
    first, two = of_user("a", "ann", geometry_r=1), of_user("a", "ann", geometry_r=2)
    assert find_blocked_jobs([first, of_user("b", "bob", light_q=2)], {}, {}).keys() == {"a"}
    assert find_blocked_jobs([two, of_user("b", "bob", geometry_r=1, light_q=2)], {}, {}) == {}


def test_an_urgent_job_that_waits_goes_before_all_others() -> None:
    views = [of_user("a", "ann"), of_user("u", "ann", urgent=True, gl_q=1, gl_r=9)]
    assert find_blocked_jobs(views, {}, {}) == {"a": Block(("gl",), "job u is urgent")}


def test_spent_slot_hours_hold_every_job_of_their_user_back() -> None:
    views = [of_user("a", "ann", gl_q=1), of_user("b", "bob", gl_q=1)]
    users = {"ann": User("ann", slot_hours=2.0), "bob": User("bob", slot_hours=2.0)}
    blocked = find_blocked_jobs(views, users, {"ann": 2.0, "bob": 1.9})
    assert blocked.keys() == {"a"}
    assert blocked["a"].queues == (EVERYWHERE,)
    assert "ann has used 2 of 2 slot-hours" in blocked["a"].why
