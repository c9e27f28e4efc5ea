"""Pausing, cancelling, draining, and a ledger rebuilt from storage; against a real Redis."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from pbrs_farm.store.secret import Secret
from tests.workers.conftest import JOB_ID, spec
from tests.workers.drive import BATCHES, ROOM, drive, with_config
from tests.workers.redis_server import RedisServer
from workers.config import FarmConfig
from workers.coordinator.leader import Coordinator
from workers.job import HouseEntry
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import HouseState, LedgerUnavailable
from workers.ledger.worker_registry import Registry


def test_a_paused_job_gives_its_tasks_back_and_resumes(ledger: RedisLedger) -> None:
    d = drive(ledger, 1)
    (task,) = d.dispatch()
    assert ledger.steer(d.job.job_id, "pause", "by hand") == "paused"
    assert d.claim(task).verdict == "paused"
    assert d.dispatch() == []
    assert ledger.steer(d.job.job_id, "resume") == "running"
    d.run_all()
    assert d.state == "done"


def test_a_priority_is_changed_while_a_job_runs_and_stays_when_it_is_over(
    ledger: RedisLedger,
) -> None:
    first, second = drive(ledger, 1), drive(ledger, 1, job_id="ba9876543210")
    assert ledger.active_jobs() == [first.job.job_id, second.job.job_id]
    assert ledger.steer(second.job.job_id, "priority", "1") == "running"
    assert ledger.active_jobs() == [second.job.job_id, first.job.job_id]
    second.run_all()
    assert ledger.steer(second.job.job_id, "priority", "7") == "done"
    assert ledger.active_jobs() == [first.job.job_id]
    view = ledger.view(second.job.job_id)
    assert view is not None
    assert view.fields["priority"] == "7"
    assert ledger.steer("0" * 12, "priority", "1") == ""


def test_an_urgent_job_is_sent_first_and_the_other_gets_its_share(ledger: RedisLedger) -> None:
    calm, urgent = drive(ledger, 60), drive(ledger, 60, job_id="ba9876543210")
    ledger.steer(urgent.job.job_id, "priority", "0")
    messages: list[tuple[str, str, str, str]] = []
    config = replace(ledger.config, window_min=20)
    coordinator = Coordinator(config, ledger, messages.extend, registry=Registry(ledger))
    Registry(with_config(ledger, slots=10)).heartbeat()
    coordinator.turn()
    n = Counter(job for _queue, job, _task, _recipe in messages)
    assert n == {urgent.job.job_id: 18, calm.job.job_id: 2}


def test_a_cancelled_job_stops_its_runners(ledger: RedisLedger) -> None:
    d = drive(ledger, 2)
    first, second = d.dispatch()
    claim = d.claim(first)
    assert ledger.steer(d.job.job_id, "cancel", "by hand") == "cancelled"
    assert ledger.heartbeat(d.job.job_id, [first], claim.token) == "cancelled"
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


def test_the_window_bounds_tasks_in_flight(ledger: RedisLedger) -> None:
    d = drive(ledger, 50)
    ledger.lead(d.leader)
    room = {**ROOM, "geometry": 7}
    tasks = ledger.dispatch(d.job.job_id, d.leader, max_open=20, room=room)
    assert tasks is not None
    assert len(tasks) == 7
    assert d.counts["houses:open"] == 20


def test_a_ledger_rebuilt_from_storage_continues(ledger: RedisLedger) -> None:
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
    assert (
        counts["views"] == 5 + 3
    )  # five are stored; Drive reports one for each batch that it runs


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


def test_forgetting_leaves_no_key(ledger: RedisLedger) -> None:
    d = drive(ledger, 3)
    d.claim(d.dispatch()[0])
    ledger.forget(d.job.job_id)
    keys = list(ledger.client.scan_iter(f"{ledger.config.prefix}*"))
    assert set(keys) == {ledger.config.prefix + name for name in ("leader", "notify")}


def test_redis_away_or_wrong_password_is_one_line_without_the_password(config: FarmConfig) -> None:
    away = replace(config, redis_url=Secret("redis://:hush@127.0.0.1:1/0"))
    with pytest.raises(LedgerUnavailable, match="no Redis at redis://127") as caught:
        RedisLedger(away).ping()
    assert "hush" not in str(caught.value)
    assert "\n" not in str(caught.value)
    for ask in (
        lambda client: client.info("memory"),
        lambda client: client.pipeline().ping().execute(),
    ):
        with pytest.raises(LedgerUnavailable, match="no Redis at redis://127"):
            ask(RedisLedger(away).client)


def test_a_service_waits_for_redis_unless_it_is_refused(
    config: FarmConfig, redis_server: RedisServer
) -> None:
    tries = []
    away = RedisLedger(replace(config, redis_url=Secret("redis://127.0.0.1:1/0")))
    away.client.retry = None
    with pytest.raises(LedgerUnavailable, match="no Redis at"):
        away.wait_until_there(0.0, lambda: tries.append("away"))
    RedisLedger(config).wait_until_there(60.0, lambda: tries.append("there"))
    assert tries == ["away", "there"]
    stranger = replace(
        config, redis_url=Secret(f"redis://nobody:x@127.0.0.1:{redis_server.port}/0")
    )
    with pytest.raises(LedgerUnavailable, match="rejects these credentials"):
        RedisLedger(stranger).wait_until_there(600.0)


def test_a_job_s_ceilings_are_changed_while_it_runs_and_resume_ends_its_waiting(
    ledger: RedisLedger,
) -> None:
    limits = {"max_slots": 2, "budget_h": 1.5, "after": ("b" * 12,)}
    job = JOB_ID
    ledger.create(spec(1, job).model_copy(update=limits))
    ledger.open(job, 5)

    def now() -> tuple[int, float, tuple[str, ...]]:
        view = ledger.view(job)
        assert view is not None
        return view.max_slots, view.budget_h, view.after

    assert now() == (2, 1.5, ("b" * 12,))
    assert ledger.steer(job, "max_slots", "7") == "running"
    assert ledger.steer(job, "budget_h", "0") == "running"
    ledger.steer(job, "pause", "follows another one")
    ledger.steer(job, "resume")
    assert now() == (7, 0.0, ())
