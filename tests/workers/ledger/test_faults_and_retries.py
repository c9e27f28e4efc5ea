"""Three attempts, quarantine, cooldown: the ledger's answer to faults; against a real Redis."""

from __future__ import annotations

import pytest

from tests.workers.drive import drive, with_config
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.worker_registry import Registry


def test_after_three_attempts_the_batch_fails_and_the_house_continues(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    answers = []
    for _ in range(3):
        for task in d.dispatch():
            if task == "h0/1/gl":
                answers.append(d.fail(task, d.claim(task)))
                d.ran[task] += 1
            else:
                d.run(task)
    assert answers == ["retry", "retry", "failed"]
    d.run_all()
    assert d.state == "done"
    assert d.ran["h0/-/reduce"] == 1
    assert d.counts["gl:f"] == 1
    ((task, fault),) = ledger.faults(d.job.job_id)
    assert (task, fault.fault) == ("h0/1/gl", "crash")


def test_a_bad_house_is_not_tried_again_and_is_quarantined(ledger: RedisLedger) -> None:
    d = drive(ledger, 2)
    for task in d.dispatch():
        if task.startswith("h0"):
            assert d.fail(task, d.claim(task), "data") == "failed"
        else:
            d.run(task)
    d.run_all()
    assert d.state == "done"
    assert d.counts["houses:quarantined"] == 1
    assert d.counts["houses:done"] == 1


def test_most_batches_failing_quarantines_the_house_and_cancels_the_rest(
    ledger: RedisLedger,
) -> None:
    d = drive(ledger, 1)
    batches = (("a",), ("b",), ("c",))
    d.run(d.dispatch()[0], batches)
    tasks = d.dispatch()
    running = d.claim(tasks[2])
    for task in tasks[:2]:
        assert d.fail(task, d.claim(task), "data") == "failed"
    assert ledger.heartbeat(d.job.job_id, [tasks[2]], running.token) == "lost"
    assert d.claim(tasks[2], "w2").verdict == "cancelled"
    d.run_all()
    assert d.state == "done"
    assert d.counts["houses:quarantined"] == 1


@pytest.mark.parametrize("kind", ["preempted", "storage"])
def test_faults_of_the_machine_are_not_counted(ledger: RedisLedger, kind: str) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    for _ in range(5):
        claim = d.claim(task)
        assert claim.detail == "1"
        assert d.fail(task, claim, kind) == "handed back"  # type: ignore[arg-type]
        d.ran[task] += 1
        assert d.dispatch() == [task]


def test_a_failed_attempt_is_repeated_on_another_worker(ledger: RedisLedger) -> None:
    for name in ("w1", "w2"):
        Registry(with_config(ledger, worker=name)).heartbeat()
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    d.fail(task, d.claim(task, "w1"))
    d.ran[task] += 1
    assert d.dispatch() == [task]
    assert d.claim(task, "w1").verdict == "elsewhere"
    ledger.client.zadd(f"{ledger.config.prefix}{{{d.job.job_id}}}:later", {task: 0})
    assert d.dispatch() == [task]
    assert d.claim(task, "w2").verdict == "run"


def test_a_lonely_worker_may_try_again_itself(ledger: RedisLedger) -> None:
    Registry(ledger).heartbeat()
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    d.fail(task, d.claim(task, "w1"))
    d.ran[task] += 1
    d.dispatch()
    assert d.claim(task, "w1").verdict == "run"


def test_three_crashes_on_different_houses_cool_the_worker_down(ledger: RedisLedger) -> None:
    for name in ("w1", "w2"):
        Registry(with_config(ledger, worker=name)).heartbeat()
    d = drive(ledger, 4)
    tasks = d.dispatch()
    for task in tasks[:3]:
        d.fail(task, d.claim(task, "w1"), worker="w1")
    assert d.claim(tasks[3], "w1").verdict == "cooling"


def test_a_failed_task_can_be_tried_again_and_the_job_ends_again(ledger: RedisLedger) -> None:
    d = drive(ledger, 2)
    while tasks := d.dispatch():
        for task in tasks:
            if task == "h0/1/light":
                d.fail(task, d.claim(task), "data")
                d.ran[task] += 1
            else:
                d.run(task)
    assert d.state == "done"
    assert ledger.retry(d.job.job_id, "h0/1/light")
    assert not ledger.retry(d.job.job_id, "h0/1/light")
    assert d.state == "running"
    d.run_all()
    assert d.state == "done"
    counts = d.counts
    assert counts["done:reduce"] == counts["houses:done"] == 2
    assert counts["done:light"] == counts["batches"] == 4
    assert counts["done:shard"] == counts["done:job"] == 1
    assert d.ran["h0/-/reduce"] == 2


def test_a_quarantined_house_can_be_tried_again(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    batches = (("a",), ("b",), ("c",), ("d",))
    d.run(d.dispatch()[0], batches)
    for task in d.dispatch()[:3]:
        d.fail(task, d.claim(task), "data")
    d.run_all()
    assert d.counts["houses:quarantined"] == 1
    for task, _fault in list(ledger.faults(d.job.job_id)):
        assert ledger.retry(d.job.job_id, task)
    d.ran.clear()
    d.run_all()
    assert d.state == "done"
    assert d.counts["houses:done"] == 1
    assert "houses:quarantined" not in d.counts
    assert d.counts["done:light"] == 4


def test_alike_failures_pause_the_job(ledger: RedisLedger) -> None:
    d = drive(ledger, 5, max_same_failure=3)
    for task in d.dispatch()[:3]:
        d.fail(task, d.claim(task), "data")
    view = ledger.view(d.job.job_id)
    assert view is not None
    assert view.state == "paused"
    assert view.fields["reason"] == "3 failures alike: data"


def test_many_quarantined_houses_pause_the_job(ledger: RedisLedger) -> None:
    d = drive(ledger, 5, max_quarantined=2)
    for task in d.dispatch()[:2]:
        d.fail(task, d.claim(task), "data")
    assert d.state == "paused"
