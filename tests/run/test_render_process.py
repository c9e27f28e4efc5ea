"""The supervisor of render processes, with a fake clock and process: who is killed, when."""

from __future__ import annotations

import atexit
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO

import pytest

from pbrs_farm.crash_notes import LINE_WRITER, waiting_lines
from pbrs_farm.operating_system import can_fork
from pbrs_farm.run.processes import child_process
from pbrs_farm.run.processes.child_process import ChildProcess
from pbrs_farm.run.processes.limits import ProcessLimits
from pbrs_farm.run.processes.messages import Handler, Message, Send
from pbrs_farm.run.processes.render_process import Ended, RenderProcess
from tests.run.fake_child import FakeChild, FakeClock

LIMITS = ProcessLimits(
    start_s=60, step_s=100, silence_s=30, memory_mb=500, recycle_mb=300, recycle_tasks=3
)


class Bench:
    """A RenderProcess and the fake processes it has started; `next` is the next one to start."""

    def __init__(self, limits: ProcessLimits = LIMITS) -> None:
        self.clock = FakeClock()
        self.started: list[FakeChild] = []
        self.next = FakeChild(self.clock)
        self.process = RenderProcess(self._start, limits, clock=self.clock)

    def _start(self) -> FakeChild:
        self.started.append(self.next)
        self.next = FakeChild(self.clock)
        return self.started[-1]

    def run(self, *, task_s: float = math.inf) -> tuple[list[Message], Ended]:
        """Give it a task and wait for its end. Returns its messages until then."""
        self.process.begin(b"task", task_s=task_s)
        heard = []
        while True:
            message = self.process.poll(1.0)
            if isinstance(message, Ended):
                assert not self.process.is_busy
                return heard, message
            heard += [message] if message is not None else []


def test_a_task_ends_with_the_message_of_its_process() -> None:
    bench = Bench()
    for at_s, kind in ((2.0, "ready"), (3.0, "step"), (9.0, "done")):
        bench.next.at(at_s, kind, kind, n=7)  # type: ignore[arg-type]
    heard, ended = bench.run()
    assert [m.kind for m in heard] == ["ready", "step"]
    assert ended == Ended(9.0, "", "done", {"n": 7})
    assert bench.started[0].requests == [b"task"]
    assert not bench.started[0].was_killed


def test_a_process_serves_one_task_after_another() -> None:
    bench = Bench()
    child = bench.next
    child.at(0, "ready")
    child.at(1, "done")
    bench.run()
    child.at(2, "fault", "odd", fault="bug")
    _heard, ended = bench.run()
    assert (ended.cause, ended.text, ended.body) == ("reported", "odd", {"fault": "bug"})
    assert len(bench.started) == 1


def test_a_silent_process_is_killed_and_the_next_task_gets_another() -> None:
    bench = Bench()
    bench.next.at(0, "ready")
    _heard, ended = bench.run()
    assert ended.cause == "silent"
    assert 30 < ended.seconds <= 32
    assert bench.started[0].was_killed
    bench.next.at(40, "ready")
    bench.next.at(41, "done")
    assert bench.run()[1].cause == ""
    assert len(bench.started) == 2


def test_a_line_in_the_log_is_a_sign_of_life() -> None:
    bench = Bench()
    child = bench.next

    def speak() -> None:
        child.log += "line\n"

    child.at(0, "ready")
    for at_s in (20, 40, 60):
        child.at(at_s, speak)
    child.at(80, "done")
    assert bench.run()[1].cause == ""


def test_a_step_over_its_time_is_killed_though_it_writes_to_its_log() -> None:
    bench = Bench()
    child = bench.next

    def speak() -> None:
        child.log += "line\n"

    child.at(0, "ready")
    child.at(10, "step", "light")
    for at_s in range(20, 200, 10):
        child.at(at_s, speak)
    _heard, ended = bench.run()
    assert ended.cause == "timeout"
    assert "100 s; killed" in ended.text
    assert 110 < bench.clock.now <= 112


def test_each_step_has_a_time_limit_and_so_has_the_task() -> None:
    bench = Bench()
    bench.next.at(0, "ready")
    for at_s in range(0, 300, 20):
        bench.next.at(at_s, "step")
    _heard, ended = bench.run(task_s=200)
    assert ended.cause == "timeout"
    assert 200 < ended.seconds <= 202


def test_time_without_storage_counts_for_no_limit() -> None:
    bench = Bench()
    bench.next.at(0, "ready")
    for at_s in range(20, 400, 20):
        bench.next.at(at_s, "waiting")
    bench.next.at(395, "done")
    assert bench.run(task_s=50)[1].cause == ""


def test_the_start_is_not_part_of_the_tasks_time() -> None:
    bench = Bench()
    bench.next.at(50, "ready")
    bench.next.at(75, "done")
    assert bench.run(task_s=26)[1].cause == ""


def test_a_process_that_does_not_start_is_the_machines_fault() -> None:
    _heard, ended = Bench().run()
    assert ended.cause == "machine"
    assert 60 < ended.seconds <= 62
    bench = Bench()
    bench.next.at(1, "fault", "MachineFailed: no EGL")
    _heard, ended = bench.run()
    assert (ended.cause, ended.text) == ("machine", "MachineFailed: no EGL")
    assert bench.started[0].was_killed


def test_a_process_over_its_memory_is_killed_even_while_it_talks() -> None:
    bench = Bench()
    child = bench.next
    child.at(0, "ready")
    for k in range(20):
        child.at(k / 4, "event")
    child.at(5, lambda: setattr(child, "used_mb", 501.0))
    for k in range(20, 100):
        child.at(k / 4, "event")
    _heard, ended = bench.run()
    assert ended.cause == "resource"
    assert "501 MB resident, limit 500" in ended.text
    assert 5 <= ended.seconds <= 7


@pytest.mark.parametrize(
    ("code", "cause", "text"),
    [
        (-signal.SIGSEGV, "crash", "its process was killed by SIGSEGV"),
        (3, "crash", "its process ended with 3"),
        (-signal.SIGKILL, "resource", "out of memory?"),
    ],
)
def test_a_death_is_reported_with_its_cause(code: int, cause: str, text: str) -> None:
    bench = Bench()
    child = bench.next
    child.at(0, "ready")
    child.at(2, lambda: child.dies(code))
    _heard, ended = bench.run()
    assert ended.cause == cause
    assert text in ended.text


def test_a_process_that_died_idle_costs_no_task() -> None:
    bench = Bench()
    bench.next.at(0, "ready")
    bench.next.at(1, "done")
    bench.run()
    bench.started[0].dies(-signal.SIGKILL)
    bench.next.at(2, "ready")
    bench.next.at(3, "done")
    assert bench.run()[1].cause == ""


def test_worn_and_swollen_processes_are_replaced_between_tasks() -> None:
    bench = Bench()
    for k in range(5):
        bench.next.at(0, "ready")
        child = (
            bench.started[-1] if bench.started and not bench.started[-1].was_killed else bench.next
        )
        child.at(k, "done")
        assert bench.run()[1].cause == ""
    assert len(bench.started) == 2  # three tasks each
    bench.started[-1].used_mb = 301
    bench.started[-1].at(9, "done")
    bench.run()
    assert bench.started[-1].was_killed


def test_closing_lets_an_idle_process_end_and_kills_a_busy_one() -> None:
    bench = Bench()
    bench.next.at(0, "ready")
    bench.next.at(1, "done")
    bench.run()
    bench.process.close()
    assert bench.started[0].was_closed
    bench.process.begin(b"task")
    bench.process.close()
    assert bench.started[1].was_killed


def test_an_early_process_serves_its_task_or_is_killed_without_one() -> None:
    bench = Bench()
    bench.next.at(0, "ready")
    bench.next.at(1, "done")
    bench.process.start()
    assert bench.run()[1].cause == ""
    assert len(bench.started) == 1
    bench.process.stop()
    bench.process.start()
    bench.process.close()
    assert bench.started[1].was_killed


def test_only_a_process_without_threads_and_devices_is_forked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert not child_process.may_fork()  # a test may hold anything
    monkeypatch.setattr(child_process, "sends_notes", lambda: True)
    monkeypatch.setattr(child_process, "_UNFORKABLE", frozenset({"moderngl"}))
    monkeypatch.setattr(child_process, "LOADED", loaded := set[str]())
    monkeypatch.delitem(sys.modules, "moderngl", raising=False)
    threads = [threading.main_thread()]
    monkeypatch.setattr(threading, "enumerate", lambda: threads)
    assert child_process.may_fork() == can_fork()
    threads.append(threading.Thread(name=LINE_WRITER))
    assert child_process.may_fork() == can_fork()
    threads.append(threading.Thread())
    assert not child_process.may_fork()
    threads.pop()
    loaded.add("height of a-package 1")
    assert not child_process.may_fork()
    loaded.clear()
    monkeypatch.setitem(sys.modules, "moderngl", sys)
    assert not child_process.may_fork()


_HELD: list[BinaryIO] = []


def make_handler(send: Send) -> Handler:
    """A real process for the test below: it acts according to the request's word."""

    def handle(line: bytes) -> Message:
        word = line.decode().strip()
        os.write(1, f"{word}\n".encode())  # native libraries print too
        if word == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if word == "hang":
            time.sleep(60)
        if word == "close":  # files that the parent had open
            for file in _HELD:
                file.close()
        send(Message("event", word, {"pid": os.getpid()}))
        return Message("done", word)

    return handle


def _live_and_die(log: Path) -> None:
    """Have real processes act as the fake ones above; their output goes to a log."""
    start = partial(ChildProcess, "tests.run.test_render_process:make_handler", log)
    process = RenderProcess(start, ProcessLimits(silence_s=2.0))

    def run(word: str) -> tuple[str, str]:
        process.begin(word.encode())
        while not isinstance(message := process.poll(0.2), Ended):
            pass
        return message.cause, message.text

    try:
        assert run("fine") == ("", "fine")
        assert process.log_tail() == "fine\n"
        assert run("close") == ("", "close")
        assert run("crash") == ("crash", "its process was killed by SIGSEGV")
        assert run("fine") == ("", "fine")
        assert run("hang")[0] == "silent"
        assert run("fine") == ("", "fine")
    finally:
        process.close()


def test_real_processes_live_and_die_as_the_fake_ones(tmp_path: Path) -> None:
    _live_and_die(tmp_path / "log")


def forking_verb(words: Sequence[str]) -> int:
    """A command whose render processes are forks, while files are open and lines are written."""
    _HELD.extend(os.fdopen(os.dup(0), "rb") for _k in range(10))
    if words[1:]:
        sys.stderr.close()
    with waiting_lines("forks", first_s=60):
        vars(child_process)["_started"] = None  # a call raises an error
        _live_and_die(Path(words[0]))
    return 0


@pytest.mark.skipif(not can_fork(), reason="forks on Linux only")
@pytest.mark.parametrize("without_output", [False, True])
def test_forks_of_a_command_live_and_die_alike(tmp_path: Path, without_output: bool) -> None:
    # In a fresh interpreter, as pytest's may have threads, OpenGL and Mitsuba.
    words = ["tests.run.test_render_process:forking_verb", str(tmp_path / "log")]
    words += ["close"] if without_output else []
    code = "import sys; from pbrs_farm.run.processes.verb_process import run_watched as run; "
    code += "sys.exit(run(sys.argv[1], sys.argv[2:], print))"
    shell = 'exec "$@" >&-' if without_output else 'exec "$@"'
    command = ["sh", "-c", shell, "sh", sys.executable, "-c", code, *words]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0, done.stderr


class _Kept:
    """An object that a library holds until the interpreter exits."""

    def __del__(self) -> None:
        os.write(2, b"taken apart\n")


_KEPT: list[_Kept] = []


def make_leaving_handler(_send: Send) -> Handler:
    """A handler with work left when its process ends."""
    atexit.register(sys.stdout.write, "left in order\n")
    _KEPT.append(_Kept())
    return lambda line: Message("done", line.decode())


def test_an_ending_process_finishes_its_work_without_interpreter_teardown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    target = "tests.run.test_render_process:make_leaving_handler"
    process = RenderProcess(partial(ChildProcess, target, tmp_path / "log"), ProcessLimits())
    process.begin(b"fine")
    while not isinstance(process.poll(0.2), Ended):
        pass
    process.close()
    assert process.log_tail() == "left in order\n"
