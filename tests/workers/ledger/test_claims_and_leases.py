"""Each task runs once, under a lease; against a real Redis."""

from __future__ import annotations

import time

from tests.workers.drive import drive
from workers.ledger.redis_ledger import RedisLedger


def test_a_job_runs_every_task_exactly_once_and_ends(ledger: RedisLedger) -> None:
    d = drive(ledger, 7, shard_size=3)
    d.run_all()
    assert d.state == "done"
    assert set(d.ran.values()) == {1}
    # 7 geometry, 14 gl, 14 light, 7 reduce, 3 shards, 1 job.
    assert len(d.ran) == 7 + 14 + 14 + 7 + 3 + 1
    assert d.counts["done:light"] == 14
    assert d.counts["houses:done"] == 7
    assert "houses:open" not in d.counts
    assert ledger.active_jobs() == []


def test_a_house_without_views_ends_too(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    while tasks := d.dispatch():
        for task in tasks:
            d.run(task, batches=())
    assert d.state == "done"
    assert set(d.ran) == {"h0/-/geometry", "h0/-/reduce", "-/s0/shard", "-/-/job"}


def test_a_message_delivered_twice_runs_once(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    first = d.claim(task, "w1")
    assert first.verdict == "run"
    assert d.claim(task, "w2").verdict == "leased"
    d.finish(task, first)
    assert d.claim(task, "w2").verdict == "done"


def test_a_claim_whose_answer_was_lost_may_be_asked_again(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    assert d.claim(task) == d.claim(task)
    assert ledger.task_facts(d.job.job_id, task)["attempts"] == "1"


def test_the_attempt_is_counted_before_the_work(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    d.claim(task)
    assert ledger.task_facts(d.job.job_id, task)["attempts"] == "1"


def test_light_on_a_gpu_is_leased_apart_so_that_each_kind_of_worker_scales_by_its_own(
    ledger: RedisLedger,
) -> None:
    d = drive(ledger, 1, gpu=True)
    d.run(d.dispatch()[0])
    for task in d.dispatch():
        d.run(task)
    task = d.dispatch()[0]
    held = d.claim(task, "w1")
    sizes = [
        ledger.client.zcard(f"{ledger.config.prefix}lease:{name}")
        for name in ("light", "light.gpu")
    ]
    assert (held.verdict, sizes) == ("run", [0, 1])
    assert ledger.heartbeat(d.job.job_id, task, held.token) == "ok"
    time.sleep(0.35)
    assert ledger.reap(d.leader) == 1
    assert ledger.client.zcard(f"{ledger.config.prefix}lease:light.gpu") == 0


def test_an_expired_lease_is_reaped_and_its_holder_fenced_off(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    dead = d.claim(task, "w1")
    time.sleep(0.35)
    assert ledger.reap(d.leader) == 1
    (again,) = d.dispatch()
    assert again == task
    d.ran[task] += 1
    heir = d.claim(task, "w2")
    assert heir.verdict == "run"
    assert heir.detail == "2"
    assert ledger.heartbeat(d.job.job_id, task, dead.token) == "lost"
    d.finish(task, dead)
    assert d.claim(task, "w3").verdict == "leased"
    assert ledger.heartbeat(d.job.job_id, task, heir.token) == "ok"


def test_a_heartbeat_keeps_the_lease(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    claim = d.claim(task)
    for _ in range(4):
        time.sleep(0.12)
        assert ledger.heartbeat(d.job.job_id, task, claim.token) == "ok"
    assert ledger.reap(d.leader) == 0


def test_an_affine_task_is_offered_and_its_message_finds_it_done(ledger: RedisLedger) -> None:
    from workers.ledger.task_ledger import Finished

    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    first, second = d.dispatch()
    claim = d.claim(first)
    end = Finished(5.0, n_views=2)
    assert ledger.finish(d.job.job_id, first, claim.token, end, sticky=True) == second
    taken = d.claim(second, direct=True)
    assert taken.verdict == "run"
    d.finish(second, taken)
    assert d.claim(second, "w2").verdict == "done"


def test_an_unknown_job_or_task_is_nothing_to_run(ledger: RedisLedger) -> None:
    assert ledger.claim("f" * 12, "h/0/gl", token="t", recipe="r").verdict == "unknown"
    assert ledger.claim("f" * 12, "x'; drop", token="t", recipe="r").verdict == "unknown"
