"""The ledger's promises, each against a real Redis: nothing lost, nothing twice, three attempts."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from pbrs_farm.store.secret import Secret
from tests.workers.conftest import spec
from tests.workers.drive import BATCHES, ROOM, drive, with_config
from workers.config import FarmConfig
from workers.job import HouseEntry
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import HouseState, LedgerUnavailable
from workers.ledger.worker_registry import Registry


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


def test_three_attempts_then_the_batch_fails_and_the_house_goes_on(ledger: RedisLedger) -> None:
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
    assert ledger.heartbeat(d.job.job_id, tasks[2], running.token) == "lost"
    assert d.claim(tasks[2], "w2").verdict == "cancelled"
    d.run_all()
    assert d.state == "done"
    assert d.counts["houses:quarantined"] == 1


@pytest.mark.parametrize("kind", ["preempted", "storage"])
def test_what_is_nobodys_fault_is_not_counted(ledger: RedisLedger, kind: str) -> None:
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
    assert d.claim(tasks[3], "w1").verdict == "blocked"


def test_a_paused_job_gives_its_tasks_back_and_resumes(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    assert ledger.steer(d.job.job_id, "pause", "by hand") == "paused"
    assert d.claim(task).verdict == "paused"
    assert d.dispatch() == []
    assert ledger.steer(d.job.job_id, "resume") == "running"
    d.run_all()
    assert d.state == "done"


def test_a_cancelled_job_stops_its_runners(ledger: RedisLedger) -> None:
    d = drive(ledger, 2)
    first, second = d.dispatch()
    claim = d.claim(first)
    assert ledger.steer(d.job.job_id, "cancel", "by hand") == "cancelled"
    assert ledger.heartbeat(d.job.job_id, first, claim.token) == "cancelled"
    assert d.fail(first, claim, "cancelled") == "cancelled"
    assert d.claim(second).verdict == "cancelled"
    assert d.dispatch() == []


def test_unhealthy_storage_holds_claims_without_an_attempt(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    Registry(ledger).open_breaker("bucket away")
    assert d.claim(task).verdict == "held"
    assert "attempts" not in ledger.task_facts(d.job.job_id, task)


def test_a_worker_of_another_version_or_recipe_is_refused(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    job = d.job.job_id
    assert ledger.claim(job, task, token="t", recipe="other").verdict == "recipe"
    ledger.client.hset(f"{ledger.config.prefix}{{{job}}}:job", "version", "9.9")
    ledger.client.zadd(f"{ledger.config.prefix}{{{job}}}:later", {task: 0})
    d.dispatch()
    claim = d.claim(task)
    assert (claim.verdict, claim.detail) == ("version", "9.9")


def test_a_drained_worker_claims_nothing_more(ledger: RedisLedger) -> None:
    registry = Registry(ledger)
    registry.heartbeat()
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    assert registry.drain("w1")
    assert d.claim(task, "w1").verdict == "draining"
    assert registry.heartbeat()
    assert not registry.drain("nobody")


def test_only_one_coordinator_leads_and_a_deposed_one_moves_nothing(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    assert ledger.lead("a")
    assert not ledger.lead("b")
    assert ledger.dispatch(d.job.job_id, "b", max_open=9, room=ROOM) is None
    assert ledger.reap("b") == -1
    assert ledger.resend(d.job.job_id, "b", "geometry", 0.0) is None
    ledger.resign("a")
    assert ledger.lead("b")


def test_a_lost_message_is_sent_again(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    assert ledger.resend(d.job.job_id, d.leader, "geometry", 60.0) == []
    assert ledger.resend(d.job.job_id, d.leader, "geometry", 0.0) == [task]
    d.run(task)
    assert ledger.resend(d.job.job_id, d.leader, "geometry", 0.0) == []


def test_the_window_bounds_what_is_in_flight(ledger: RedisLedger) -> None:
    d = drive(ledger, 50)
    ledger.lead(d.leader)
    room = {**ROOM, "geometry": 7}
    tasks = ledger.dispatch(d.job.job_id, d.leader, max_open=20, room=room)
    assert tasks is not None
    assert len(tasks) == 7
    assert d.counts["houses:open"] == 20


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


def test_a_ledger_rebuilt_from_storage_goes_on_where_it_was(ledger: RedisLedger) -> None:
    job = spec(3, "ba9876543210")
    ledger.create(job)
    ledger.load_houses(
        job.job_id,
        [
            HouseState(0, "h0", True, BATCHES, {
                "-": ("reduce", "d"), "0": ("light", "d"), "1": ("light", "d")}),
            HouseState(1, "h1", False, BATCHES, {
                "-": ("geometry", "d"), "0": ("light", "d"), "1": ("light", "l")}),
        ],
    )  # fmt: skip
    ledger.add_houses(job.job_id, 2, [HouseEntry(house_id="h2")])
    ledger.open(job.job_id, 5)
    from tests.workers.drive import Drive

    d = Drive(ledger, job)
    d.run_all()
    assert d.state == "done"
    assert sorted(d.ran) == sorted(
        ["h1/1/light", "h1/-/reduce", "-/s0/shard", "-/-/job", "h2/-/geometry", "h2/0/gl",
         "h2/1/gl", "h2/0/light", "h2/1/light", "h2/-/reduce"]
    )  # fmt: skip
    counts = d.counts
    assert counts["done:light"] == counts["done:gl"] == counts["batches"] == 6
    assert counts["done:geometry"] == counts["done:reduce"] == counts["houses:done"] == 3
    assert counts["views"] == 5 + 3  # five were stored; Drive tells of one a batch it runs


def test_a_partial_reduction_does_not_end_the_job(ledger: RedisLedger) -> None:
    d = drive(ledger, 2)
    ledger.steer(d.job.job_id, "reduce")
    tasks = d.dispatch()
    assert "-/-/job" in tasks
    d.run("-/-/job")
    assert d.state == "running"
    for task in tasks:
        if task != "-/-/job":
            d.run(task)
    d.run_all()
    assert d.state == "done"
    assert d.ran["-/-/job"] == 2


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


def test_forgetting_leaves_no_key(ledger: RedisLedger) -> None:
    d = drive(ledger, 3)
    d.claim(d.dispatch()[0])
    ledger.forget(d.job.job_id)
    left = list(ledger.client.scan_iter(f"{ledger.config.prefix}*"))
    assert set(left) == {ledger.config.prefix + name for name in ("leader", "notify")}


def test_redis_away_or_wrong_password_is_one_line_without_it(config: FarmConfig) -> None:
    away = replace(config, redis_url=Secret("redis://:hush@127.0.0.1:1/0"))
    with pytest.raises(LedgerUnavailable, match="no Redis at redis://127") as caught:
        RedisLedger(away).ping()
    assert "hush" not in str(caught.value)
    assert "\n" not in str(caught.value)
