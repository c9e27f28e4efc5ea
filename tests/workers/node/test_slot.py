"""A slot with a ledger in memory, a fake render process and a fake clock."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.inputs.slot_bench import JOB, TASK, Bench, bench
from workers.ids import failed_key, log_key
from workers.ledger.task_ledger import Claim, LedgerUnavailable

__all__ = ["bench"]  # a fixture


def test_a_worker_logs_finished_tasks(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    bench.next.at(1, "ready")
    bench.next.at(5, "done", batches=[], n_views=0)
    with caplog.at_level("INFO", "pbrs.slot"):
        bench.run()
    assert f"{TASK} of job {JOB}: done in 5.0 s" in caplog.text


def test_a_task_is_claimed_run_and_finished(bench: Bench) -> None:
    bench.next.at(1, "ready")
    bench.next.at(5, "done", batches=[], n_views=0)
    bench.run()
    request = json.loads(bench.started[0].requests[0])
    assert (request["house"], request["stage"], request["views"]) == ("h0", "gl", ["a", "b"])
    end = bench.ledger.finished[TASK]
    assert (end.seconds, end.n_views) == (5.0, 2)


def test_the_lease_is_kept_while_the_process_talks_and_while_it_is_silent(bench: Bench) -> None:
    bench.next.at(0, "ready")
    for k in range(1, 200):
        bench.next.at(k / 2, "step")  # twice a second, so that no poll is idle
    bench.next.at(190, "done", batches=[], n_views=0)
    bench.run()
    assert bench.ledger.n_heartbeats == 9  # every 20 s
    assert TASK in bench.ledger.finished


@pytest.mark.parametrize("answer", ["lost", "cancelled"])
def test_a_lost_or_cancelled_task_is_killed(bench: Bench, answer: str) -> None:
    bench.ledger.heartbeats = ["ok", answer]
    bench.next.at(0, "ready")
    bench.run()
    assert bench.started[0].was_killed
    assert [f.fault for f in bench.ledger.faults[TASK]] == [answer]
    assert 40 <= bench.clock.now < 43


def test_preemption_hands_the_task_back_immediately_and_without_a_log(bench: Bench) -> None:
    bench.next.at(0, "ready")
    bench.next.at(7, lambda: bench.config.preemption_file.touch())
    bench.run()
    (fault,) = bench.ledger.faults[TASK]
    assert (fault.fault, fault.log) == ("preempted", "")
    assert bench.clock.now < 10


@pytest.mark.parametrize(("code", "kind"), [(-11, "crash"), (-9, "resource")])
def test_a_death_costs_one_attempt_and_leaves_its_log(bench: Bench, code: int, kind: str) -> None:
    child = bench.next
    child.at(0, "ready")

    def die() -> None:
        child.log = "about to crash\n"
        child.dies(code)

    child.at(3, die)
    bench.run()
    (fault,) = bench.ledger.faults[TASK]
    assert (fault.fault, fault.attempt) == (kind, 1)
    assert bench.store.get(log_key(JOB, TASK, 1)) == b"about to crash\n"
    bench.next.at(10, "ready")
    bench.next.at(11, "done", batches=[], n_views=0)
    bench.run()
    assert bench.ledger.attempts[TASK] == 2
    assert TASK in bench.ledger.finished


def test_silence_and_deadline_end_a_task(bench: Bench) -> None:
    bench.next.at(0, "ready")
    bench.run()
    bench.next.at(bench.clock.now, "ready")
    for k in range(0, 2000, 50):
        bench.next.at(bench.clock.now + k, "step")
    bench.run()
    assert [f.fault for f in bench.ledger.faults[TASK]] == ["silent", "timeout"]
    assert "longer than 1000 s" in bench.ledger.faults[TASK][1].message


def test_a_fault_the_process_reports_keeps_its_class(bench: Bench) -> None:
    bench.next.at(0, "ready")
    bench.next.at(1, "fault", "h0: two walls", fault="data", fingerprint="BadHouse: two walls 3")
    bench.run()
    (fault,) = bench.ledger.faults[TASK]
    assert (fault.fault, fault.message) == ("data", "h0: two walls")
    assert fault.fingerprint == "data: BadHouse: two walls #"
    assert json.loads(bench.store.get(failed_key(JOB, TASK)))["fault"] == "data"
    assert not bench.started[0].was_killed


def test_storage_that_does_not_answer_opens_the_breaker(bench: Bench) -> None:
    bench.next.at(0, "ready")
    bench.next.at(5, "waiting", "bucket away")
    bench.next.at(9, "done", batches=[], n_views=0)
    bench.run()
    assert bench.registry.reason == "bucket away"
    assert TASK in bench.ledger.finished


def test_a_long_task_takes_another_of_its_house_with_it(bench: Bench) -> None:
    bench.ledger.affine[TASK] = "h0/1/gl"
    child = bench.next
    child.at(0, "ready")
    child.at(5, "done", batches=[], n_views=0)
    child.at(9, "done", batches=[], n_views=0)
    bench.run()
    assert set(bench.ledger.finished) == {TASK, "h0/1/gl"}
    assert len(bench.started) == 1


def test_redis_away_is_waited_for_up_to_a_limit(bench: Bench) -> None:
    bench.ledger.n_away = 3
    bench.next.at(0, "ready")
    bench.next.at(1, "done", batches=[], n_views=0)
    bench.run()
    assert TASK in bench.ledger.finished
    bench.ledger.n_away = 10_000
    with pytest.raises(LedgerUnavailable):
        bench.run("h0/1/gl")
    assert 600 < bench.clock.now < 640


def test_a_refused_task_starts_no_process(bench: Bench) -> None:
    bench.ledger.refusal = Claim("version", "9.9")
    bench.run()
    assert bench.started == []
    assert bench.registry.refusals == [
        f"job {JOB} has steps of another version; `pbrs-farm adopt {JOB}`"
    ]
    assert bench.clock.now == 1.0  # it waits, so that other workers may take the task


def test_the_lease_of_a_dead_sibling_is_ended(bench: Bench) -> None:
    gone = 2**22 - 1  # above any process id in use
    bench.ledger.leases[TASK] = f"w1:{gone}:0:abcd"
    bench.run()
    assert [f.fault for f in bench.ledger.faults[TASK]] == ["lost"]
    bench.ledger.leases["h0/1/gl"] = f"w1:{os.getpid()}:0:abcd"
    bench.run("h0/1/gl")
    assert "h0/1/gl" in bench.ledger.leases


SECOND, THIRD = "h0/1/gl", "h0/2/gl"


def of_one_house(bench: Bench, *seconds: float) -> None:
    """The house has one batch for each of `seconds`, which is its duration in the process."""
    start = 0.0
    for k, took in enumerate(seconds):
        bench.ledger.inputs[f"h0/{k}/gl"] = ";".join("v" for _ in seconds)
        start += took
        bench.next.at(start, "done", batches=[], n_views=1)
    bench.next.at(0, "ready")


def test_short_tasks_are_claimed_and_reported_together(bench: Bench) -> None:
    of_one_house(bench, 0.5, 0.5, 0.5)
    bench.run(TASK, SECOND, THIRD)
    assert bench.ledger.reports == [[TASK, SECOND, THIRD]]
    assert len(bench.started) == 1


def test_finished_tasks_are_reported_every_five_seconds(bench: Bench) -> None:
    of_one_house(bench, 4.0, 4.0, 4.0)
    bench.run(TASK, SECOND, THIRD)
    assert bench.ledger.reports == [[TASK, SECOND], [THIRD]]


def test_a_heartbeat_renews_running_waiting_and_unreported_tasks(bench: Bench) -> None:
    of_one_house(bench, 2.0, 40.0, 1.0)
    bench.run(TASK, SECOND, THIRD)
    assert bench.ledger.beaten[0] == [SECOND, THIRD, TASK]


def test_a_task_of_several_that_fails_leaves_the_others_be(bench: Bench) -> None:
    for k in range(3):
        bench.ledger.inputs[f"h0/{k}/gl"] = "v;v;v"
    bench.next.at(0, "ready")
    bench.next.at(1, "done", batches=[], n_views=1)
    bench.next.at(2, "fault", "h0: two walls", fault="data", fingerprint="x")
    bench.next.at(3, "done", batches=[], n_views=1)
    bench.run(TASK, SECOND, THIRD)
    assert [f.fault for f in bench.ledger.faults[SECOND]] == ["data"]
    assert bench.ledger.reports == [[TASK, THIRD]]


def test_preemption_returns_tasks_not_begun_and_reports_finished_ones(bench: Bench) -> None:
    of_one_house(bench, 1.0)
    bench.ledger.inputs |= {TASK: "v;v;v", SECOND: "v;v;v", THIRD: "v;v;v"}
    bench.next.at(3, lambda: bench.config.preemption_file.touch())
    bench.run(TASK, SECOND, THIRD)
    assert list(bench.ledger.finished) == [TASK]
    assert [f.fault for t in (SECOND, THIRD) for f in bench.ledger.faults[t]] == ["preempted"] * 2
    assert bench.ledger.leases == {}


# For a fresh interpreter, as pytest's is never forked.
_START_OF_SLOT = """
import sys
from pathlib import Path
from pbrs_farm.run.processes import child_process
from workers.config import FarmConfig
from workers.node import slot
from pbrs_farm.store.secret import Secret

def started(_target, _log):
    sys.exit("started afresh")

child_process._started = started
slot.RedisLedger = slot.Registry = lambda _argument: None
slot.make_slot(FarmConfig(Secret("memory://"), scratch=Path(sys.argv[1])))
"""


def test_a_slot_does_not_fork_its_render_process(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _START_OF_SLOT, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "started afresh" in done.stderr
