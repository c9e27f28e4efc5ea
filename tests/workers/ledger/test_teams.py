"""Teams in the ledger: order of users, slot-hours spent, preempted tasks."""

from __future__ import annotations

import pytest

from tests.workers.conftest import JOB_ID, spec
from tests.workers.drive import Drive, drive, with_config
from workers.job import HouseEntry
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import EVERYWHERE, Finished, GoOn
from workers.ledger.user_table import UserTable
from workers.ledger.worker_registry import Registry


def of_user(ledger: RedisLedger, user: str) -> Drive:
    job = spec(1).model_copy(update={"user": user})
    ledger.create(job)
    ledger.add_houses(job.job_id, 0, [HouseEntry(house_id="h0", source="{}")])
    ledger.open(job.job_id, 5)
    return Drive(ledger, job)


def test_a_worker_may_not_claim_from_a_job_blocked_on_one_of_its_queues(
    ledger: RedisLedger,
) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    for name, queues in (("w1", ("geometry", "light")), ("w2", ("geometry",))):
        Registry(with_config(ledger, worker=name, queues=queues)).heartbeat()
    ledger.set_blocked(JOB_ID, ("light",), "tasks of bob go first")
    claim = d.claim(task, "w1")
    assert (claim.verdict, claim.detail) == ("blocked", "tasks of bob go first")
    # It is ready again after a second, without an attempt, and another worker takes it.
    assert d.dispatch() == []
    ledger.client.zadd(f"{ledger.config.prefix}{{{JOB_ID}}}:later", {task: 0})
    assert d.dispatch() == [task]
    assert d.claim(task, "w2").detail == "1"
    ledger.set_blocked(JOB_ID, (), "")
    view = ledger.view(JOB_ID)
    assert view is not None
    assert view.blocked_queues == ()


def test_a_fully_blocked_job_starts_no_batch_of_its_house(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    first, _second = d.dispatch()
    claim = d.claim(first)
    ledger.set_blocked(JOB_ID, (EVERYWHERE,), "spent")
    go_on = GoOn(d.job.recipe.digest(), ("gl", "light"), is_long=True)
    assert ledger.finish_many(JOB_ID, {first: Finished(9.0)}, claim.token, go_on) == {}


def test_slot_seconds_are_counted_for_the_tasks_user_only(ledger: RedisLedger) -> None:
    table = UserTable(ledger)
    d = of_user(ledger, "ann")
    d.run_all()
    drive(ledger, 1, job_id="ba9876543210").run_all()
    n = sum(d.ran.values())  # one second each
    assert table.spent_h() == {"ann": pytest.approx(n / 3600)}


def test_a_task_that_makes_room_ends_at_its_heartbeat_and_keeps_its_attempts(
    ledger: RedisLedger,
) -> None:
    d = drive(ledger, 2)
    first, second = d.dispatch()
    claim, second_claim = d.claim(first), d.claim(second)
    (first_hold,) = [hold for hold in ledger.holds(JOB_ID) if hold.task == first]
    assert ledger.preempt(JOB_ID, "nobody", [first_hold]) == -1
    assert [ledger.preempt(JOB_ID, d.leader, [first_hold]) for _ in range(2)] == [1, 0]
    assert [hold.is_preempted for hold in ledger.holds(JOB_ID)].count(True) == 1
    assert ledger.heartbeat(JOB_ID, [first], claim.token) == "preempted"
    assert ledger.heartbeat(JOB_ID, [second], second_claim.token) == "ok"
    assert d.fail(first, claim, "preempted") == "handed back"
    assert "attempts" not in ledger.task_facts(JOB_ID, first)
    assert d.dispatch() == [first]
    assert d.claim(first).detail == "1"
    assert not any(name.startswith("failures:") for name in d.counts)
