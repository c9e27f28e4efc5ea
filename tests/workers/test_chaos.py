"""Faults while a job runs: real processes are killed, Redis is stopped, storage goes away.

After each: the stored objects equal those of a single run byte for byte, the ledger counts match
storage, and only as much was repeated as the fault explains. PBRS_CHAOS_TABLE names a file that
gets a line per test (fault, lost, repeated, seconds to recover): the table of docs/lab/farm.md.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from tests.inputs.farm_processes import note, renderers
from tests.workers.redis_server import RedisServer
from tests.workers.refusals import REFUSALS, configured
from tests.workers.small_farm import SmallFarm
from tests.workers.stalling_proxy import StallingProxy

pytestmark = pytest.mark.chaos


def begin(farm: SmallFarm, n_houses: int = 6, slow_s: float = 0.3) -> None:
    """Start a coordinator, two workers and a job whose tasks take long enough to be interrupted."""
    (farm.control / "slow").write_text(str(slow_s))
    farm.coordinator()
    farm.worker("w1")
    farm.worker("w2")
    farm.submit(n_houses)
    farm.wait(lambda: sum(farm.starts().values()) >= 4, 40, "tasks are being run")


def pool_processes(farm: SmallFarm, worker: str) -> list[int]:
    """Celery's child processes, which each hold a renderer."""
    return [
        int(Path(f"/proc/{pid}/stat").read_text().split()[3]) for pid in renderers(farm, worker)
    ]


def test_a_worker_killed_with_all_its_processes(farm: SmallFarm) -> None:
    begin(farm)
    farm.wait(lambda: farm.running() == 2, 20, "both are busy")
    farm.kill("w1")
    seconds = farm.wait_done()
    repeated = farm.check_complete(n_repeats=1)
    note("kill -9 of a worker and all its processes", farm, repeated, seconds)
    assert farm.farm.view(farm.job).counts["expired"] >= 1


def test_a_renderer_killed(farm: SmallFarm) -> None:
    begin(farm)
    for pid in renderers(farm, "w1"):
        os.kill(pid, signal.SIGKILL)
    seconds = farm.wait_done()
    note("kill -9 of a renderer", farm, farm.check_complete(n_repeats=1), seconds)


def test_a_pool_process_killed(farm: SmallFarm) -> None:
    begin(farm)
    (pid,) = pool_processes(farm, "w1")
    os.kill(pid, signal.SIGKILL)
    seconds = farm.wait_done()
    note("kill -9 of a Celery child", farm, farm.check_complete(n_repeats=1), seconds)


def test_term_lets_a_short_task_end(farm: SmallFarm) -> None:
    begin(farm)
    farm.processes["w1"].send_signal(signal.SIGTERM)
    began = time.monotonic()
    farm.processes["w1"].wait(30)
    left_s = time.monotonic() - began
    farm.wait_done()
    repeated = farm.check_complete(n_repeats=0)
    note("TERM to a worker, short task (seconds: until it left)", farm, repeated, left_s)


def test_term_hands_a_long_task_back_uncounted(tmp_path: Path) -> None:
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server, grace_s=22)
    try:
        begin(farm, n_houses=2)
        (farm.control / "slow").write_text("30")
        farm.wait(lambda: farm.running() == 2, 20, "both are busy")
        time.sleep(1.0)
        farm.processes["w1"].send_signal(signal.SIGTERM)
        began = time.monotonic()
        farm.processes["w1"].wait(20)
        left_s = time.monotonic() - began
        assert farm.farm.view(farm.job).counts["handed_back:preempted"] == 1
        (farm.control / "slow").write_text("0.1")
        farm.wait_done(90)
        repeated = farm.check_complete(n_repeats=1)
        note(
            "TERM to a worker, long task, 22 s grace (seconds: until it left)",
            farm,
            repeated,
            left_s,
        )
    finally:
        farm.close()
        server.end()


def test_redis_stopped_and_started(farm: SmallFarm) -> None:
    begin(farm)
    farm.redis.end(signal.SIGTERM)
    time.sleep(2)
    farm.redis.start()
    seconds = farm.wait_done(120)
    note("Redis stopped for 2 s", farm, farm.check_complete(n_repeats=2), seconds)


def test_redis_killed(farm: SmallFarm) -> None:
    begin(farm)
    farm.redis.end(signal.SIGKILL)
    time.sleep(1)
    farm.redis.start()
    seconds = farm.wait_done(120)
    # AOF everysec: up to a second of the ledger is lost, so tasks of that second may start again.
    note("kill -9 of Redis, AOF everysec", farm, farm.check_complete(n_repeats=8), seconds)


def test_redis_flushed_then_recovered(farm: SmallFarm) -> None:
    begin(farm)
    farm.redis.client.flushall()
    began = time.monotonic()
    farm.farm.recover(farm.job)
    farm.wait_done(120)
    seconds = time.monotonic() - began
    note("FLUSHALL, then recover", farm, farm.check_complete(n_repeats=6), seconds)


def test_every_message_delivered_twice(farm: SmallFarm) -> None:
    from workers.coordinator.dispatcher import celery_sender
    from workers.coordinator.leader import Coordinator

    (farm.control / "slow").write_text("0.05")
    farm.worker("w1")
    farm.worker("w2")
    from workers.queue.celery_app import make_app

    send = celery_sender(make_app(farm.farm.config))

    def send_twice(messages: object) -> None:
        copies = [*messages]  # type: ignore[call-overload]
        send(copies)
        send(copies)

    farm.submit(6)
    coordinator = Coordinator(
        farm.farm.config, farm.farm.ledger, send_twice, registry=farm.farm.registry
    )

    def turn() -> bool:
        coordinator.turn()
        return farm.state() == "done"

    seconds = farm.wait(turn, 60, "the job is done")
    note("every message delivered twice", farm, farm.check_complete(n_repeats=0), seconds)


@pytest.mark.parametrize("fault", ["crash", "bug"])
def test_a_house_that_fails_each_time(farm: SmallFarm, fault: str) -> None:
    farm.coordinator()
    farm.worker("w1")
    farm.worker("w2")
    (farm.control / f"{fault}.h002").touch()
    farm.submit(6)
    seconds = farm.wait_done(90)
    starts = farm.starts()
    assert {starts["h002/0/gl"], starts["h002/1/gl"]} == {3}
    intact = {k: v for k, v in farm.expected(without=("h002",)).items() if k != "manifest.jsonl"}
    assert intact.items() <= farm.objects().items()
    view = farm.farm.view(farm.job)
    assert view.counts["houses:quarantined"] == 1
    assert view.counts["houses:done"] == 5
    (kind,) = farm.farm.failures(farm.job)
    assert kind["n"] == 2
    if fault == "crash":
        assert "about to crash" in farm.farm.logs(farm.job, "h002/0/gl", attempt=3)
    (farm.control / f"{fault}.h002").unlink()
    assert len(farm.farm.retry(farm.job)) == 2
    farm.wait_done(60)
    farm.check_complete(n_repeats=8)  # three more attempts of two batches, shard, job
    note(f"a house whose renderer fails each time ({fault}), then retry", farm, 4, seconds)


def test_a_house_that_hangs(tmp_path: Path) -> None:
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server, limits_silence_s=2)
    try:
        farm.coordinator()
        farm.worker("w1")
        farm.worker("w2")
        (farm.control / "hang.h002").touch()
        farm.submit(4)
        seconds = farm.wait_done(120)
        assert farm.farm.view(farm.job).counts["failures:silent"] == 6
        assert farm.farm.view(farm.job).counts["houses:quarantined"] == 1
        (farm.control / "hang.h002").unlink()
        assert len(farm.farm.retry(farm.job)) == 2
        farm.wait_done(60)
        farm.check_complete(n_repeats=8)
        note("a house that hangs (silence limit 2 s), then retry", farm, 4, seconds)
    finally:
        farm.close()
        server.end()


@pytest.mark.parametrize("trouble", ["away", "full"])
def test_storage_in_trouble_for_a_while(farm: SmallFarm, trouble: str) -> None:
    begin(farm)
    (farm.control / trouble).touch()
    time.sleep(12)
    assert farm.farm.registry.breaker() != ""
    n_before = sum(farm.starts().values())
    time.sleep(2)
    assert sum(farm.starts().values()) == n_before
    (farm.control / trouble).unlink()
    seconds = farm.wait_done(120)
    repeated = farm.check_complete(n_repeats=0)
    assert not any(k.startswith("failures:") for k in farm.farm.view(farm.job).counts)
    note(
        f"storage {trouble} for 14 s (seconds: from its return to the end)", farm, repeated, seconds
    )


def test_two_coordinators_and_the_leader_killed(farm: SmallFarm) -> None:
    farm.coordinator("standby")
    begin(farm, n_houses=10)
    farm.kill("coordinator")
    farm.kill("standby")
    farm.coordinator("third")
    farm.coordinator("fourth")
    seconds = farm.wait_done(120)
    note(
        "leading coordinator killed, two others take over",
        farm,
        farm.check_complete(n_repeats=0),
        seconds,
    )


def test_cancel_and_pause_under_load(farm: SmallFarm) -> None:
    begin(farm, n_houses=10)
    farm.farm.pause(farm.job)
    farm.wait(lambda: farm.running() == 0, 20, "what ran has ended")
    n_paused = sum(farm.starts().values())
    time.sleep(2)
    assert sum(farm.starts().values()) == n_paused
    farm.farm.resume(farm.job)
    farm.wait(lambda: sum(farm.starts().values()) > n_paused, 20, "it goes on")
    (farm.control / "slow").write_text("20")
    farm.wait(lambda: farm.running() == 2, 20, "both are busy")
    time.sleep(0.5)
    farm.farm.cancel(farm.job)
    farm.wait(lambda: farm.running() == 0, 10, "what ran was killed")
    (farm.control / "slow").write_text("0.1")
    farm.submit(10)
    seconds = farm.wait_done(120)
    note(
        "pause, resume, cancel under load, submit again",
        farm,
        farm.check_complete(n_repeats=4),
        seconds,
    )


def test_a_worker_whose_clock_is_a_minute_off(farm: SmallFarm) -> None:
    if subprocess.run(["which", "faketime"], capture_output=True, check=False).returncode:
        pytest.skip("faketime is not installed: apt install faketime")
    (farm.control / "slow").write_text("0.2")
    farm.coordinator()
    farm.worker("w1", prefix=("faketime", "-f", "+60s"))
    farm.worker("w2", prefix=("faketime", "-f", "-60s"))
    farm.submit(6)
    seconds = farm.wait_done(120)
    assert farm.farm.view(farm.job).counts.get("expired", 0) == 0
    note("workers' clocks a minute off, both ways", farm, farm.check_complete(n_repeats=0), seconds)


def test_a_draining_worker_is_listed_until_its_task_is_done(farm: SmallFarm) -> None:
    (farm.control / "slow").write_text("8")
    farm.coordinator()
    farm.worker("w1")
    farm.submit(1)
    farm.wait(lambda: farm.running() > 0, 30, "a task runs")
    farm.processes["w1"].send_signal(signal.SIGTERM)
    config = replace(farm.farm.config, worker="w1", scratch=farm.folder / "scratch")
    farm.wait(config.leaving_file.exists, 10, "it begins to leave")
    # Its task continues; the probe's file and the row of `workers` remain.
    time.sleep(2)
    assert farm.running() > 0
    assert config.heartbeat_file.exists()
    assert [row["state"] for row in farm.farm.workers()] == ["draining"]
    farm.processes["w1"].wait(30)
    assert not config.heartbeat_file.exists()
    assert farm.farm.workers() == []


def test_a_forged_message_ends_no_worker(farm: SmallFarm) -> None:
    begin(farm, n_houses=2)
    envelope = {
        "body": "W10=", "content-encoding": "utf-8", "content-type": "application/x-pbrs-json",
        "headers": {"lang": "py", "task": "celery.backend_cleanup", "id": "x"},
        "properties": {
            "delivery_tag": "x", "delivery_info": {"exchange": "", "routing_key": "gl"},
            "body_encoding": "base64", "delivery_mode": 2,
        },
    }  # fmt: skip
    forged = (
        "not valid JSON",
        "[1]",
        "{}",
        '{"properties": 3}',
        "[" * 100_000,
        json.dumps(envelope),
    )
    for text in forged:
        farm.redis.client.lpush("pbrs:gl", text)
    farm.wait_done()
    farm.check_complete(n_repeats=0)
    logs = "".join(p.read_text() for p in farm.folder.glob("w*.log"))
    assert logs.count("dropped an invalid message") == len(forged) - 1
    assert "celery.backend_cleanup" in logs  # an unregistered task, logged and discarded
    assert all(farm.processes[name].poll() is None for name in ("w1", "w2"))


def test_drain_lets_a_worker_leave(farm: SmallFarm) -> None:
    begin(farm)
    farm.farm.drain("w1")
    began = time.monotonic()
    farm.processes["w1"].wait(30)
    left_s = time.monotonic() - began
    farm.wait_done()
    note("drain (seconds: until it left)", farm, farm.check_complete(n_repeats=0), left_s)


@pytest.mark.parametrize("prefix", REFUSALS)
def test_redis_refuses_for_a_while(farm: SmallFarm, prefix: str) -> None:
    begin(farm)
    with REFUSALS[prefix](farm.redis):
        time.sleep(8)
    seconds = farm.wait_done(120)
    assert all(process.poll() is None for process in farm.processes.values())
    note(f"Redis answers {prefix} for 8 s", farm, farm.check_complete(n_repeats=2), seconds)
    logs = "".join(log.read_text() for log in farm.folder.glob("*.log"))
    assert f" refused: {prefix} " in logs
    assert "Traceback" not in logs


@pytest.mark.parametrize("prefix", REFUSALS)
def test_a_farm_that_starts_at_a_redis_that_refuses(farm: SmallFarm, prefix: str) -> None:
    with REFUSALS[prefix](farm.redis):
        farm.coordinator()
        farm.worker("w1")
        time.sleep(6)
        assert all(process.poll() is None for process in farm.processes.values())
    farm.submit(2)
    seconds = farm.wait_done(120)
    note(f"started while Redis answers {prefix}", farm, farm.check_complete(n_repeats=0), seconds)


@pytest.mark.parametrize("prefix", REFUSALS)
def test_redis_refuses_for_a_while_a_farm_without_work(farm: SmallFarm, prefix: str) -> None:
    # Its workers wait in a blocking read of the queues.
    begin(farm, n_houses=1, slow_s=0.0)
    farm.wait_done()
    with REFUSALS[prefix](farm.redis):
        time.sleep(6)
        assert all(process.poll() is None for process in farm.processes.values())
    farm.submit(2, prefix="later")
    seconds = farm.wait_done(120)
    for log in farm.folder.glob("*.log"):
        assert "Traceback" not in log.read_text(), log
    assert set(farm.starts().values()) <= {1, 2}  # the job's final task belongs to both jobs
    note(f"Redis answers {prefix} for 6 s to an idle farm", farm, 0, seconds)


def test_every_connection_to_redis_is_dropped_again_and_again(farm: SmallFarm) -> None:
    begin(farm)
    for _ in range(12):
        farm.redis.client.client_kill_filter(_type="normal")
        time.sleep(0.5)
    seconds = farm.wait_done(120)
    assert all(process.poll() is None for process in farm.processes.values())
    note(
        "CLIENT KILL TYPE normal, 12 times in 6 s", farm, farm.check_complete(n_repeats=2), seconds
    )


def test_redis_closes_connections_that_are_idle_for_a_second(farm: SmallFarm) -> None:
    with configured(farm.redis, "timeout", "1"):
        begin(farm)
        seconds = farm.wait_done(120)
        assert all(process.poll() is None for process in farm.processes.values())
    repeated = farm.check_complete(n_repeats=2)
    note("Redis closes connections idle for 1 s", farm, repeated, seconds)


def test_a_proxy_before_redis_stalls(tmp_path: Path) -> None:
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    with StallingProxy(server.port) as proxy:
        farm = SmallFarm(tmp_path, server, redis_url=proxy.url)
        try:
            begin(farm, n_houses=10)
            # From now on open connections are half-open; new ones work.
            proxy.stall()
            n_before = sum(farm.starts().values())
            farm.wait(lambda: sum(farm.starts().values()) > n_before + 4, 35, "it goes on")
            # A task whose lease expired meanwhile is sent to its worker again after a minute.
            seconds = farm.wait_done(240)
            assert all(process.poll() is None for process in farm.processes.values())
            repeated = farm.check_complete(n_repeats=6)
            note("a proxy stalls all connections for ever", farm, repeated, seconds)
        finally:
            farm.close()
            server.end()
