"""Each task runs once, under a lease; against a real Redis."""

from __future__ import annotations

import time

import pytest

from tests.workers.drive import drive
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import Finished, GoOn


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


def test_a_claim_with_a_lost_answer_may_be_repeated(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    assert d.claim(task) == d.claim(task)
    assert ledger.task_facts(d.job.job_id, task)["attempts"] == "1"


def test_the_attempt_is_counted_before_the_work(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    d.claim(task)
    assert ledger.task_facts(d.job.job_id, task)["attempts"] == "1"


def test_gpu_light_is_leased_separately_so_that_workers_of_each_kind_scale(
    ledger: RedisLedger,
) -> None:
    d = drive(ledger, 1, gpu=True)
    d.run(d.dispatch()[0])
    for task in d.dispatch():
        d.run(task)
    task = d.dispatch()[0]
    claim = d.claim(task, "w1")
    sizes = [
        ledger.client.zcard(f"{ledger.config.prefix}lease:{name}")
        for name in ("light", "light.gpu")
    ]
    assert (claim.verdict, sizes) == ("run", [0, 1])
    assert ledger.heartbeat(d.job.job_id, [task], claim.token) == "ok"
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
    assert ledger.heartbeat(d.job.job_id, [task], dead.token) == "lost"
    d.finish(task, dead)
    assert d.claim(task, "w3").verdict == "leased"
    assert ledger.heartbeat(d.job.job_id, [task], heir.token) == "ok"


def test_a_heartbeat_keeps_the_lease(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    claim = d.claim(task)
    for _ in range(4):
        time.sleep(0.12)
        assert ledger.heartbeat(d.job.job_id, [task], claim.token) == "ok"
    assert ledger.reap(d.leader) == 0


def test_an_affine_task_is_offered_and_its_message_finds_it_done(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    first, second = d.dispatch()
    claim = d.claim(first)
    end = Finished(5.0, n_views=2)
    go_on = GoOn(d.job.recipe.digest(), ("gl",), is_long=True)
    claimed = ledger.finish_many(d.job.job_id, {first: end}, claim.token, go_on)
    assert list(claimed) == [second]
    taken = claimed[second]
    assert taken.verdict == "run"
    d.finish(second, taken)
    assert d.claim(second, "w2").verdict == "done"


def test_tasks_of_a_house_are_claimed_and_finished_together_each_with_its_fence(
    ledger: RedisLedger,
) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    tasks = d.dispatch()
    assert len(tasks) == 2
    recipe = d.job.recipe.digest()
    claims = ledger.claim_many(d.job.job_id, tasks, token="t", recipe=recipe)
    assert [(c.verdict, c.detail) for c in claims] == [("run", "1"), ("run", "1")]
    assert d.counts["gl:r"] == 2
    # The first lease expires and another worker takes the task; the second is finished anyway.
    d.fail(tasks[0], claims[0], "preempted")
    ledger.finish_many(d.job.job_id, {t: Finished(1.0, n_views=1) for t in tasks}, "t")
    assert d.counts["done:gl"] == 1
    again = d.dispatch()
    assert again == [tasks[0], tasks[1].replace("/gl", "/light")]
    for task in again:
        d.run(task)
    d.run_all()
    assert d.state == "done"


def test_a_failed_task_is_claimed_in_a_message_with_no_other(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    first, second = d.dispatch()
    d.fail(first, d.claim(first), worker="w9")
    assert d.dispatch() == [first]
    recipe = d.job.recipe.digest()

    def verdicts(*tasks: str) -> list[str]:
        claims = ledger.claim_many(d.job.job_id, tasks, token="t", recipe=recipe)
        return [claim.verdict for claim in claims]

    assert verdicts(second, first) == ["run", "alone"]
    assert verdicts(second, first) == ["run", "early"]
    assert d.dispatch() == [first]
    assert verdicts(first) == ["run"]


def test_a_failed_task_runs_with_no_other(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    first, second = d.dispatch()
    d.fail(first, d.claim(first), worker="w9")
    assert d.dispatch() == [first]
    recipe = d.job.recipe.digest()
    claims = ledger.claim_many(d.job.job_id, [first, second], token="t", recipe=recipe)
    assert [c.verdict for c in claims] == ["run", "alone"]
    assert d.dispatch() == [second]


@pytest.mark.parametrize(
    ("n_waiting", "queues"), [(1, ("gl", "light")), (0, ("gl", "light")), (1, ("gl",))]
)
def test_a_slot_continues_with_its_house_if_others_are_busy(
    ledger: RedisLedger, n_waiting: int, queues: tuple[str, ...]
) -> None:
    d = drive(ledger, 1)
    d.run(d.dispatch()[0])
    tasks = d.dispatch()
    recipe = d.job.recipe.digest()
    if n_waiting:
        ledger.client.rpush(f"{ledger.config.prefix}gl", "a message")
    ledger.claim_many(d.job.job_id, tasks, token="t", recipe=recipe)
    ends = {task: Finished(0.1, n_views=1) for task in tasks}
    claimed = ledger.finish_many(d.job.job_id, ends, "t", GoOn(recipe, queues))
    light = [task.replace("/gl", "/light") for task in tasks]
    # The duration of light is still unknown: one task at first.
    goes_on = bool(n_waiting) and "light" in queues
    assert list(claimed) == (light[:1] if goes_on else [])
    assert d.dispatch() == (light[1:] if goes_on else light)
    assert not ledger.client.llen(f"{ledger.config.prefix}{{{d.job.job_id}}}:out:light")


@pytest.mark.parametrize(("seconds", "n"), [(0.1, 2), (29.0, 1)])
def test_short_tasks_are_claimed_by_the_seconds_they_took(
    ledger: RedisLedger, seconds: float, n: int
) -> None:
    d = drive(ledger, 1)
    recipe = d.job.recipe.digest()
    ledger.client.rpush(f"{ledger.config.prefix}gl", "a message")
    d.run(d.dispatch()[0])
    tasks = d.dispatch()
    counters = f"{ledger.config.prefix}{{{d.job.job_id}}}:n"
    ledger.client.hset(counters, mapping={"seconds:light": str(seconds), "timed:light": "1"})
    ledger.claim_many(d.job.job_id, tasks, token="t", recipe=recipe)
    ends = {task: Finished(0.1, n_views=1) for task in tasks}
    claimed = ledger.finish_many(d.job.job_id, ends, "t", GoOn(recipe, ("gl", "light")))
    assert len(claimed) == n


def test_an_unknown_job_or_task_is_nothing_to_run(ledger: RedisLedger) -> None:
    assert ledger.claim("f" * 12, "h/0/gl", token="t", recipe="r").verdict == "unknown"
    assert ledger.claim("f" * 12, "x'; drop", token="t", recipe="r").verdict == "unknown"
